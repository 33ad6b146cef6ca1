"""What values mean to operators: truth, numbers, equality, and how a value is named in a message."""

from __future__ import annotations

import json
from math import inf

from rise_engine.base.json_codec import MAX_LEVELS
from rise_engine.expression.environment import MISSING, Json


def is_true(value: Json) -> bool:
    """A number is true when it is above 0; a string, list or object when it is not empty; null never."""
    if value.__class__ is bool:
        return bool(value)
    if isinstance(value, (int, float)):
        return value > 0
    return bool(value)


def nesting_levels(value: Json) -> int:
    """How many lists and objects are within each other; counting ends just beyond MAX_LEVELS."""
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
    """A number as an IEEE double, however long it is."""
    try:
        return float(value)
    except OverflowError:
        return inf if value > 0 else -inf


def native_number(value: float) -> int | float:
    """A result as the memory keeps it: a whole number is an integer as long as 64 bits hold it."""
    if -9223372036854775808.0 <= value < 9223372036854775808.0 and value == (whole := int(value)):
        return whole
    return value


def equal(left: Json, right: Json) -> bool:
    """Equality never crosses types, but a boolean equals 1 or 0. Lists and objects compare by value.

    A key that does not exist takes the type of the other side, and equals null. Whole numbers compare exactly.
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
    """Whether a key that does not exist equals a value: it is false, 0, "" or null, but no list and no object."""
    if other is None or other is MISSING:
        return True
    return isinstance(other, (str, int, float)) and not other


def contains(whole: Json, part: Json) -> bool:
    """A string contains a string, a list an entry, an object a key. Raises TypeError for anything else."""
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
    """A value in a message."""
    if value is MISSING:
        return "a key that does not exist"
    if isinstance(value, bool) or value is None:
        return json.dumps(value)
    if isinstance(value, str):
        return "the text " + json.dumps(value if len(value) <= 40 else value[:39] + "…", ensure_ascii=False)
    if isinstance(value, (int, float)):
        return f"the number {value!r}" if abs(value) < 1e16 or isinstance(value, float) else "a very large number"
    return "a list" if isinstance(value, list) else "an object" if isinstance(value, dict) else "no JSON value"
