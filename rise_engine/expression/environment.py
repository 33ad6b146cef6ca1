"""The input of an evaluation (memory, random numbers, places to report missing keys), and the meaning of values."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, MutableSet
from dataclasses import dataclass
from math import inf
from typing import Any, Final, Protocol, TypeAlias

from rise_engine.base.json_codec import MAX_LEVELS

Json: TypeAlias = Any
"""A JSON value: null, boolean, integer, number, string, array or object."""


class Missing:
    """The type of MISSING, the value of a key that does not exist: false, 0 or "" depending on context."""

    __slots__ = ()

    def __bool__(self) -> bool:
        return False

    def __repr__(self) -> str:
        return "MISSING"


MISSING: Final = Missing()


class AskedSituation(Protocol):
    """The situation of a session that a study's property can test: `in('Main', 'Start')`, `runs('R_Yes')`, ..."""

    def in_state(self, rule: str, state: str) -> bool:
        """Whether a rule runs and is in this state."""

    def rule_runs(self, rule: str) -> bool:
        """Whether a rule runs."""

    def act_runs(self, act: str) -> bool:
        """Whether an act runs at least once."""

    def act_waits(self, act: str) -> bool:
        """Whether an act waits at least once."""


@dataclass(slots=True, eq=False)
class Environment:
    """The argument of a compiled expression. Build it once, and change its memory."""

    memory: Mapping[str, Json]
    """A plain dict in the engine."""
    rand: Callable[[], float] | None = None
    """Returns the next number in [0, 1). Without it, `rand()` is an evaluation error."""
    missing: MutableSet[str] | None = None
    """Collects missing keys that an evaluation reads; None: they are not collected."""
    below: Callable[[int], int] | None = None
    """Returns the next whole number from 0 up to its argument, exclusive. Without it, `shuffle` is an error."""
    parts: dict[str, Json] | None = None
    """Collects parts that are read (`items[i].text`) with their values, null if missing; None: not collected."""
    situation: AskedSituation | None = None
    """Answers `in`, `rule`, `runs` and `waits`. None, as in sessions: they are an evaluation error."""

    def value_of_absent_key(self, key: str, default: Json) -> Json:
        """Return the value of a key that is not a flat key: from within an object, or else `default` after a report."""
        if "." in key:
            found, value = lookup(self.memory, key)
            if found:
                return value
        if self.missing is not None:
            self.missing.add(key)
        return default


def lookup(memory: Mapping[str, Json], key: str) -> tuple[bool, Json]:
    """Return whether a key exists, and its value (else None).

    A flat key comes first: `person.name` may be one key. Otherwise the first part is a key, and each further part
    selects from its value: a name from an object, a whole number (`list.0`) from a list.
    """
    if key in memory:
        return True, memory[key]
    head, *rest = key.split(".")
    if not rest or head not in memory:
        return False, None
    found, value = True, memory[head]
    for part in rest:
        found, value = reach_into(value, part)
        if not found:
            break
    return found, value


def reach_into(value: Json, part: str) -> tuple[bool, Json]:
    """Return whether an object or a list has this part, and its value (else None)."""
    if isinstance(value, dict) and part in value:
        return True, value[part]
    if isinstance(value, list) and (index := list_index(value, part)) is not None:
        return True, value[index]
    return False, None


def list_index(items: list[Json], part: str) -> int | None:
    """The list index that a part of a key means; None: there is no such entry."""
    if not (part.isascii() and part.isdigit() and len(part) < 10):
        return None
    index = int(part)
    return index if index < len(items) else None


# --- what values mean for operators -----------------------------------------------------------------------------------


def is_true(value: Json) -> bool:
    """Whether a number is above 0, or a string, list or object is not empty; null is false."""
    if value.__class__ is bool:
        return bool(value)
    if isinstance(value, (int, float)):
        return value > 0
    return bool(value)


def nesting_levels(value: Json) -> int:
    """The nesting depth of lists and objects. Stops counting just beyond MAX_LEVELS."""
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
    """A result in the memory's form: whole numbers are integers as long as they fit into 64 bits."""
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
    """Whether a string contains a string, a list an entry, an object a key. Raises TypeError for other values."""
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
