"""What was worked out while a scenario was checked, kept for the next check: of what has not changed nothing is read.

Whatever is read of one file is a value with findings, and depends on what stands in its key alone. So a check with what
was kept gives the same as one that reads everything (`tests/scenario/test_checker.py`).
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, TypeVar

from rise_engine.expression import Assignment, Expression
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft

Value = TypeVar("Value")
_ROUNDS = 16
"""After so many checks that did not need it, something is forgotten: an undo, or a look at what an edit would give,
finds it still there."""
_MOST_EXPRESSIONS = 20_000


class Memo:
    """Values by what they were worked out from. For one check at a time."""

    def __init__(self) -> None:
        self._kept: dict[Hashable, tuple[Any, list[int]]] = {}
        """Value, and the round in which it was last needed."""
        self._numbers: dict[str, tuple[Any, int]] = {}
        self._round = 0
        self.expressions: dict[str, Expression] = {}
        """By text, for all files."""
        self.assignments: dict[str, Assignment] = {}

    def get(self, key: Hashable, make: Callable[[], Value]) -> Value:
        """What is kept under a key; what `make` gives if there is nothing."""
        if (known := self._kept.get(key)) is None:
            self._kept[key] = known = (make(), [self._round])
        known[1][0] = self._round
        value: Value = known[0]
        return value

    def read(self, key: Hashable, diagnostics: Diagnostics, make: Callable[[Diagnostics], Value]) -> Value:
        """As `get`, of something that gives findings: they are told each time."""

        def make_with_findings() -> tuple[Value, Diagnostics]:
            found = Diagnostics()
            return make(found), found

        value, found = self.get(key, make_with_findings)
        diagnostics.add(found)
        return value

    def read_part(
        self,
        key: Hashable,
        draft: ScenarioDraft,
        diagnostics: Diagnostics,
        make: Callable[[ScenarioDraft, Diagnostics], Value],
    ) -> Value:
        """As `read`, of something that makes a part of a draft, which is added to `draft`."""

        def make_part(found: Diagnostics) -> tuple[Value, ScenarioDraft]:
            part = ScenarioDraft(self.expressions, self.assignments)
            return make(part, found), part

        value, part = self.read(key, diagnostics, make_part)
        draft.add(part)
        return value

    def number(self, kind: str, value: object) -> int:
        """A number for a value that cannot be a key itself: the same as last time if it is equal to that one."""
        before, number = self._numbers.get(kind, (None, 0))
        if before is value or (number and before == value):
            return number
        self._numbers[kind] = value, number + 1
        return number + 1

    def end_round(self) -> None:
        """Forget what has not been needed for long."""
        self._kept = {key: kept for key, kept in self._kept.items() if self._round - kept[1][0] < _ROUNDS}
        self._round += 1
        if len(self.expressions) + len(self.assignments) > _MOST_EXPRESSIONS:
            self.expressions.clear()
            self.assignments.clear()
