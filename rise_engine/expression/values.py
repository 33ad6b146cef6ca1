"""The meaning of values for operators: truth, numbers, equality, and names of values in messages."""

from __future__ import annotations

import json
from math import inf

from rise_engine.base.json_codec import MAX_LEVELS
from rise_engine.expression.environment import MISSING, Json


def is_true(value: Json) -> bool:
    """Whether a number is above 0, or a string, list or object is not empty; null never is."""
    if value.__class__ is bool:
        return bool(value)
    if isinstance(value, (int, float)):
        return value > 0
    return bool(value)


def nesting_levels(value: Json) -> int:
    """How deep lists and objects are nested. Stops counting just beyond MAX_LEVELS."""
    layer = [value]
    for level in range(MAX_LEVELS + 1):
        layer = [
            inner
            for outer in layer
            if isinstance(outer, (dict, list))
            for inner in ((None, *outer.values()) if isinstance(outer, dict) else (None, *outer))
        ]
        if not layer:
            return level
    return MAX_LEVELS + 1


def to_double(value: int | float) -> float:
    """A number as an IEEE double. Too large ones become infinity."""
    try:
        return float(value)
    except OverflowError:
        return inf if value > 0 else -inf


def native_number(value: float) -> int | float:
    """A result as the memory keeps it: whole numbers are integers as long as they fit into 64 bits."""
    if -9223372036854775808.0 <= value < 9223372036854775808.0 and value == (whole := int(value)):
        return whole
    return value


def equal(left: Json, right: Json) -> bool:
    """Whether two values are equal: never across types, except that a boolean equals 1 or 0.

    Lists and objects compare by value, whole numbers exactly. A missing key takes the type of the other side, and it
    equals null.
    """
    if left is MISSING:
        return absent_equals(right)
    if right is MISSING:
        return absent_equals(left)
    try:
        return bool(left == right)
    except RecursionError:  # lists within lists, thousands of levels deep
        return False


def absent_equals(other: Json) -> bool:
    """Whether a missing key equals a value: false, 0, "" or null, but not a list or an object."""
    if other is None or other is MISSING:
        return True
    return isinstance(other, (str, int, float)) and not other


def contains(whole: Json, part: Json) -> bool:
    """Whether a string contains a string, a list an entry, an object a key. Raises TypeError for anything else."""
    if whole is MISSING:
        return isinstance(part, str) and not part if part is not MISSING else True
    if part is MISSING:
        part = ""
    if isinstance(whole, list):
        return any(equal(entry, part) for entry in whole)
    if isinstance(whole, (str, dict)) and isinstance(part, str):
        return part in whole
    raise TypeError


def describe(value: Json) -> str:
    """Describe a value for a message."""
    if value is MISSING:
        return "a key that does not exist"
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, str):
        return "the text " + json.dumps(value if len(value) <= 40 else value[:39] + "…", ensure_ascii=False)
    if isinstance(value, (int, float)):
        return f"the number {value!r}" if abs(value) < 1e16 or isinstance(value, float) else "a very large number"
    return "a list" if isinstance(value, list) else "an object" if isinstance(value, dict) else "no JSON value"
