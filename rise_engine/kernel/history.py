"""What is needed to go a step back: the states that a rule came through, and what the memory was then (semantics.md
12.4)."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from typing import Any, TypeAlias

from msgspec import Struct, field

MAX_STEPS = 50
"""States that are remembered of a rule, the present one included."""
LEAST_CHANGES = 256
"""So many changes of the memory are kept before any are left out."""

Steps: TypeAlias = list[tuple[str, int]]
"""The states of a rule, the present one last, each with the number of the record that says that it was entered."""


class ValueBefore(Struct, frozen=True):
    """What a key had before it was changed."""

    existed: bool
    value: Any = None


class MemoryLog(Struct):
    """What keys had before they were changed.

    Of several changes of a key that no step lies between, the first is enough; so its size follows keys and steps, and
    not how often something is changed. It costs something when the memory is changed, and nothing otherwise.
    """

    changes: list[tuple[int, str, ValueBefore]] = field(default_factory=list)
    """The number of the record of each, the key, and what it had."""
    limit: int = LEAST_CHANGES
    """How many there may be before those are left out that no step needs."""

    def note(self, number: int, key: str, existed: bool, value: Any) -> None:
        """A key was changed, as the record with this number says, from this value."""
        self.changes.append((number, key, ValueBefore(existed, value)))

    @property
    def is_full(self) -> bool:
        """Whether it is time to `trim`."""
        return len(self.changes) > self.limit

    def trim(self, steps: Iterable[Iterable[tuple[str, int]]], least: int = LEAST_CHANGES) -> None:
        """Leave out what no step of any rule needs; from now on there may be `least` changes at any rate."""
        marks = sorted({number for each in steps for _, number in each})
        needed: dict[tuple[int, str], tuple[int, str, ValueBefore]] = {}
        for change in self.changes:
            if place := bisect_left(marks, change[0]):
                needed.setdefault((place, change[1]), change)
        self.changes = list(needed.values())
        self.limit = max(least, LEAST_CHANGES, 2 * len(self.changes))

    def changed_since(self, number: int, memory: dict[str, Any]) -> dict[str, ValueBefore]:
        """What keys had at a record that have something else now, the key that was changed first first."""
        before: dict[str, ValueBefore] = {}
        for at, key, value in self.changes:
            if at > number:
                before.setdefault(key, value)
        return {
            key: value
            for key, value in before.items()
            if (key in memory) != value.existed or (value.existed and memory[key] != value.value)
        }


def step_before(steps: Steps) -> tuple[str, int] | None:
    """The state before the present one, and the record of its entering; null when none is known."""
    return steps[-2] if len(steps) > 1 else None
