"""Memory values in the form in which people read and type them: JSON, with bare words if they are unambiguous."""

from __future__ import annotations

import json
from typing import Any

from rise_engine.base.text import UNSEEN, escape_unseen_json

JSON_TYPES = (
    *((type(None), "null"), (bool, "boolean"), (int, "integer"), (float, "number")),
    *((str, "string"), (list, "array"), (tuple, "array")),
)
"""Narrowest type first, because a boolean is also an integer in Python."""


def format_value(value: Any) -> str:
    """A memory value in typed form: JSON, but strings without quotation marks if that is unambiguous.

    Invisible characters and those that could move the cursor are escaped; such a string is written as JSON.
    """
    bare = isinstance(value, str) and value == value.strip() and value and not UNSEEN.search(value)
    if bare and parse_typed_value(value)[1] == "string":
        return str(value)
    return escape_unseen_json(json.dumps(value, ensure_ascii=False))


def json_type_name(value: Any) -> str:
    """The JSON type of a value, in the console's words."""
    return next((name for kind, name in JSON_TYPES if isinstance(value, kind)), "object")


def parse_typed_value(text: str) -> tuple[Any, str, str]:
    """Read a typed text. Returns value, type, and a remark if it looks like JSON but is invalid.

    A JSON literal has its own type. Anything else is a string, exactly as typed.
    """
    bare = text.strip()
    try:
        value = json.loads(
            bare, parse_constant=_refuse_constant, parse_float=_finite_number, object_pairs_hook=_unique_members
        )
    except RecursionError:
        return text, "string", "nested too deeply for JSON"
    except ValueError as error:
        looks_json = bare[:1] in ("{", "[", '"')
        return text, "string", f"not JSON: {_reason_text(error)}" if looks_json else ""
    return value, json_type_name(value), ""


def _reason_text(error: ValueError) -> str:
    if isinstance(error, json.JSONDecodeError):
        return f"{error.msg.lower()} at {error.pos + 1}"
    return str(error)


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is no JSON")


def _finite_number(text: str) -> float:
    value = float(text)
    if value in (float("inf"), float("-inf")):
        raise ValueError("the number is too large")
    return value


def _unique_members(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError("a key is given twice")
    return found
