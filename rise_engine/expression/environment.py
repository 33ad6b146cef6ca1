"""The input of an evaluation: the memory, sources of random numbers, and places to report missing keys."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableSet
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeAlias

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
        """Whether an act runs, at least once."""

    def act_waits(self, act: str) -> bool:
        """Whether an act waits to be run, at least once."""


@dataclass(slots=True, eq=False)
class Environment:
    """The argument of a compiled expression. Build it once, keep it, and change the memory behind it."""

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
    """Answers `in`, `rule`, `runs` and `waits`. None, as while a session runs: they are an evaluation error."""

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
    reaches into its value: a name into an object, a whole number (`list.0`) into a list.
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
    """The index in a list that a part of a key means, or None if there is no such entry."""
    if not (part.isascii() and part.isdigit() and len(part) < 10):
        return None
    index = int(part)
    return index if index < len(items) else None
