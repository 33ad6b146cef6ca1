"""JSON as the memory accepts it: no duplicate keys, no NaN, no infinity, no half characters (semantics, section 1)."""

from __future__ import annotations

import json
from math import isfinite
from typing import NoReturn

from rise_engine.expression.environment import Json
from rise_engine.expression.errors import ExpressionError
from rise_engine.expression.tokens import TYPOGRAPHIC_QUOTES
from rise_engine.expression.values import MAX_LEVELS, is_64_bit

_TOO_LONG = "a whole number in this JSON value has more than 64 bits"
_SHORTER = "write it as a text, or as a decimal number (1.5e20)"
_TOO_DEEP = f"this JSON value is nested too deeply: more than {MAX_LEVELS} lists and objects within each other"


class _RefusedError(ValueError):
    pass


def read_json(text: str, start: int) -> Json:
    """The JSON value that begins at `start` and fills the rest of the text. Raises ExpressionError."""
    source = text[start:]
    try:
        value = json.loads(source, object_pairs_hook=_object, parse_constant=_constant)
        _check(value, 0)
    except json.JSONDecodeError as error:
        column = start + error.pos + 1
        message = error.msg[:1].lower() + error.msg[1:]
        found = source[error.pos : error.pos + 1]
        hint = "JSON wants double quotes" if found == "'" else ""
        if found in TYPOGRAPHIC_QUOTES and found:
            message, hint = f"`{found}` is a typographic quotation mark", 'write a straight one: "'
        elif found.isspace() and found not in " \t\r\n":
            message, hint = f"the character U+{ord(found):04X} only looks like a blank", "write an ordinary blank"
        raise ExpressionError(f"this is no valid JSON: {message}", text, column, hint) from None
    except _RefusedError as error:
        hint = _SHORTER if str(error) == _TOO_LONG else ""
        raise ExpressionError(str(error), text, start + 1, hint) from None
    except ValueError:  # Python's own limit on the digits of an integer
        raise ExpressionError(_TOO_LONG, text, start + 1, _SHORTER) from None
    except RecursionError:
        raise ExpressionError(_TOO_DEEP, text, start + 1) from None
    return value


def _object(pairs: list[tuple[str, Json]]) -> dict[str, Json]:
    result = dict(pairs)
    if len(result) < len(pairs):
        seen: set[str] = set()
        twice = next(key for key, _ in pairs if key in seen or seen.add(key))  # type: ignore[func-returns-value]
        raise _RefusedError(f"the key {twice!r} is given twice")
    return result


def _constant(name: str) -> NoReturn:
    raise _RefusedError(f"{name} is no JSON value")


def _check(value: Json, level: int) -> None:
    if isinstance(value, (dict, list)) and level >= MAX_LEVELS:
        raise _RefusedError(_TOO_DEEP)
    if isinstance(value, int) and not is_64_bit(value):
        raise _RefusedError(_TOO_LONG)
    if isinstance(value, float) and not isfinite(value):
        raise _RefusedError("a number in this JSON value is too large")
    if isinstance(value, str) and not value.isascii() and any("\ud800" <= character <= "\udfff" for character in value):
        raise _RefusedError("a `\\u` escape in this JSON value is half a character")
    if isinstance(value, dict):
        for key, inner in value.items():
            _check(key, level)
            _check(inner, level + 1)
    elif isinstance(value, list):
        for inner in value:
            _check(inner, level + 1)
