"""What an evaluation sees: the memory, a source of chance, and a place to report keys that do not exist."""

from __future__ import annotations

from collections.abc import Callable, Mapping, MutableSet
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeAlias

Json: TypeAlias = Any
"""A JSON value: null, boolean, integer, number, string, array or object."""


class Missing:
    """The type of MISSING, the value of a key that does not exist: false, 0 or "" by context."""

    __slots__ = ()

    def __bool__(self) -> bool:
        return False

    def __repr__(self) -> str:
        return "MISSING"


MISSING: Final = Missing()


class AskedSituation(Protocol):
    """What a property of a study asks about how a session stands: `in('Main', 'Start')`, `runs('R_Yes')`, ..."""

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
    """The argument of a compiled expression. Build one, keep it, and change the memory behind it."""

    memory: Mapping[str, Json]
    """A plain dict in the engine."""
    rand: Callable[[], float] | None = None
    """Gives the next number in [0, 1); null: `rand()` is an evaluation error."""
    missing: MutableSet[str] | None = None
    """Collects the keys that an evaluation wanted and that do not exist; null: not collected."""
    below: Callable[[int], int] | None = None
    """Gives the next whole number from 0 up to, but without, its argument; null: `shuffle` is an evaluation error."""
    parts: dict[str, Json] | None = None
    """Collects the parts that an evaluation read (`items[i].text`) with their values, null for what was not there;
    null: not collected."""
    situation: AskedSituation | None = None
    """What `in`, `rule`, `runs` and `waits` ask; null, as while a session runs: they are an evaluation error."""

    def value_of_absent_key(self, key: str, default: Json) -> Json:
        """The value of a key that is no flat key: from within an object, or else `default`, and it is reported."""
        if "." in key:
            found, value = lookup(self.memory, key)
            if found:
                return value
        if self.missing is not None:
            self.missing.add(key)
        return default


def lookup(memory: Mapping[str, Json], key: str) -> tuple[bool, Json]:
    """Whether a key exists, and its value (else null).

    A flat key comes first: `person.name` may be one key. Otherwise the first part is a key and each further part
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
    """Whether a part of a key is there in an object or a list, and its value (else null)."""
    if isinstance(value, dict) and part in value:
        return True, value[part]
    if isinstance(value, list) and (index := list_index(value, part)) is not None:
        return True, value[index]
    return False, None


def list_index(items: list[Json], part: str) -> int | None:
    """The index that a part of a key means within a list, if there is such an entry."""
    if not (part.isascii() and part.isdigit() and len(part) < 10):
        return None
    index = int(part)
    return index if index < len(items) else None
