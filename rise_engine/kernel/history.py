"""What is needed to go a step back: the states that a rule came through, and what the memory was then (semantics.md
12.4)."""

from __future__ import annotations

from bisect import bisect_left
from collections import deque
from collections.abc import Iterable
from typing import Any, TypeAlias

from msgspec import Struct, field

MAX_STEPS = 50
"""States that are remembered of a rule, the present one included."""
LEAST_STRETCHES = 256
"""So many stretches are kept before any are joined."""

Steps: TypeAlias = "deque[tuple[str, int]]"
"""The states of a rule, the present one last, each with the stretch of the memory's changes in which it was entered."""


class ValueBefore(Struct, frozen=True):
    """What a key had before it was changed."""

    existed: bool
    value: Any = None


class MemoryLog(Struct):
    """What keys had before they were changed, in stretches between the steps of rules.

    Of each stretch only the first change of a key counts, so that its size follows the keys and not the changes. A step
    costs a flag; a change, a look into a dict.
    """

    number: int = 0
    """Of the last stretch."""
    stepped: bool = False
    """A rule has entered a state since the last change: the next one begins a stretch."""
    stretches: dict[int, dict[str, ValueBefore]] = field(default_factory=dict)
    limit: int = LEAST_STRETCHES
    """How many stretches there may be before those are joined that no step lies between."""

    def note(self, key: str, existed: bool, value: Any) -> None:
        """A key is about to be changed from this value."""
        if self.stepped:
            self.stepped = False
            self.number += 1
            self.stretches[self.number] = {key: ValueBefore(existed, value)}
        elif self.number:  # before the first step there is nothing to go back to
            self.stretches[self.number].setdefault(key, ValueBefore(existed, value))

    @property
    def is_full(self) -> bool:
        """Whether it is time to `join`."""
        return len(self.stretches) > self.limit

    def join(self, steps: Iterable[Iterable[tuple[str, int]]]) -> None:
        """Join the stretches that no step of any rule lies between, and forget those before all of them."""
        marks = sorted({number for each in steps for _, number in each})
        joined: dict[int, tuple[int, dict[str, ValueBefore]]] = {}
        for number, stretch in self.stretches.items():
            if (place := bisect_left(marks, number)) or number == self.number:
                before = joined[place][1] if place in joined else {}
                joined[place] = number, stretch | before
        self.stretches = dict(joined.values())
        self.limit = max(LEAST_STRETCHES, 2 * len(self.stretches))

    def changed_since(self, number: int, memory: dict[str, Any]) -> dict[str, ValueBefore]:
        """What keys had when a state was entered that have something else now, the key that was changed first first."""
        before: dict[str, ValueBefore] = {}
        for stretch, values in self.stretches.items():
            if stretch > number:
                for key, value in values.items():
                    before.setdefault(key, value)
        return {
            key: value
            for key, value in before.items()
            if (key in memory) != value.existed or (value.existed and memory[key] != value.value)
        }


def step_before(steps: Steps) -> tuple[str, int] | None:
    """The state before the present one, and its stretch; null when none is known."""
    return steps[-2] if len(steps) > 1 else None
