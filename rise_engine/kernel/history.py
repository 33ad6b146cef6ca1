"""The data for a step back: the earlier states of a rule, and the memory at that time (semantics.md 12.4)."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterable
from typing import Any, TypeAlias

from msgspec import Struct, field

MAX_STEPS = 50
"""The number of remembered states of a rule, including the present one."""
MIN_CHANGES = 256
"""The number of changes of the memory before unneeded ones are removed."""

Steps: TypeAlias = list[tuple[str, int]]
"""The states of a rule, the present one last, each with the number of the record of its entry."""


class ValueBefore(Struct, frozen=True):
    """The value of a key before a change."""

    existed: bool
    value: Any = None


class MemoryLog(Struct):
    """The values of keys before they were changed.

    If a key changes several times between two steps, only the first change is kept. So the size depends on keys and
    steps, not on the number of changes. Only changes of the memory cost time.
    """

    changes: list[tuple[int, str, ValueBefore]] = field(default_factory=list)
    """The number of each change's record, the key, and its value before."""
    limit: int = MIN_CHANGES
    """The number of changes before unneeded ones are removed."""

    def note(self, number: int, key: str, existed: bool, value: Any) -> None:
        """Note that a key was changed from this value, in the record with this number."""
        self.changes.append((number, key, ValueBefore(existed, value)))

    @property
    def is_full(self) -> bool:
        """Whether it is time to `trim`."""
        return len(self.changes) > self.limit

    def trim(self, steps: Iterable[Iterable[tuple[str, int]]], least: int = MIN_CHANGES) -> None:
        """Remove the changes that no step of any rule needs. The next trim comes after at least `least` changes."""
        marks = sorted({number for each in steps for _, number in each})
        needed: dict[tuple[int, str], tuple[int, str, ValueBefore]] = {}
        for change in self.changes:
            if place := bisect_left(marks, change[0]):
                needed.setdefault((place, change[1]), change)
        self.changes = list(needed.values())
        self.limit = max(least, MIN_CHANGES, 2 * len(self.changes))

    def changed_since(self, number: int, memory: dict[str, Any]) -> dict[str, ValueBefore]:
        """The values that keys had at a record, if they differ now. Keys that changed first come first."""
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
    """The state before the present one, and the record of its entry; null: unknown."""
    return steps[-2] if len(steps) > 1 else None
