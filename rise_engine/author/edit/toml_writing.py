"""Keys and values as TOML writes them."""

from __future__ import annotations

import json
import re
from math import isfinite
from typing import Any

from rise_engine.author.edit.plan import EditRefused

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")


def toml_key(name: str) -> str:
    """A key as TOML has it, in quotation marks where it must be."""
    return name if _BARE_KEY.fullmatch(name) else _basic(name)


def toml_value(value: Any, like: str = "") -> str:
    """A value in one line.

    :param value: what JSON has.
    :param like: how the value before was written; its quotation marks are kept where they can be.
    :raises EditRefused: TOML has no such value: null, NaN, a whole number of more than 64 bits.
    """
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return _written_text(value, like)
        case int() if -(2**63) <= value < 2**63:
            return str(value)
        case float() if isfinite(value):
            return repr(value)
        case list() | tuple():
            return f"[{', '.join(map(toml_value, value))}]"
        case dict():
            pairs = ", ".join(f"{toml_key(key)} = {toml_value(each)}" for key, each in value.items())
            return f"{{ {pairs} }}" if pairs else "{}"
        case None:
            raise EditRefused("a TOML file has no null; leave the entry out instead")
    raise EditRefused(f"a TOML file cannot hold {value}")


def _written_text(value: str, like: str) -> str:
    if like.startswith('"""') and "\n" in value:
        newline = "\r\n" if "\r\n" in like else "\n"
        opening = newline if like.startswith(("\n", "\r\n"), 3) else ""
        return f'"""{opening}{newline.join(_basic(line)[1:-1] for line in value.split(chr(10)))}"""'
    if like.startswith("'") and "'" not in value and _CONTROL.search(value) is None:
        return f"'{value}'"
    return _basic(value)


def _basic(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
