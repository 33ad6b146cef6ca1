"""Times that rules wait for: computed ones, and conditions that must have held (semantics.md 5.5)."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from rise_engine.expression import EvaluationError
from rise_engine.scenario.model import Delay, Transition

from .session import Session

if TYPE_CHECKING:
    from .rules import Run

UNITS = {"ms": 0.001, "s": 1.0, "min": 60.0}
DAY = 86_400.0


class NoTime(Exception):
    """What was computed is no time."""


class Times:
    """Begins and ends what the transitions of a state count."""

    def __init__(self, session: Session) -> None:
        self.session = session

    def state_entered(self, run: Run) -> None:
        """Every `after` of the state begins; those with `while` only when they hold."""
        for index, way in enumerate(run.state.transitions):
            if way.after is not None and way.held is None:
                self._begin(run, index, way.after, told=way.after.expression is not None)

    def look(self, run: Run, index: int, way: Transition) -> None:
        """Look at the condition of a `while`."""
        assert way.held is not None and way.after is not None
        if self.session.memory.holds(way.held, run.name, run.state.id):
            if index not in run.held:
                run.held.add(index)
                self._begin(run, index, way.after, told=True)
        elif index in run.held:
            run.held.discard(index)
            self.session.forget(run.clocks.pop(index, None))
            self._record(run, index, "broken")

    def state_left(self, run: Run) -> None:
        """Nothing counts any more."""
        for clock in run.clocks.values():
            self.session.forget(clock)
        run.clocks = {}

    def _begin(self, run: Run, index: int, after: Delay, told: bool) -> None:
        try:
            seconds = self._seconds(after)
        except NoTime as why:
            self._record(run, index, "failed", reason=str(why))
            return
        if told:
            self._record(run, index, "began", seconds)

        def is_up() -> None:
            run.clocks.pop(index, None)
            self.session.rules.time_has_passed(run, index)

        run.clocks[index] = self.session.after(seconds, is_up)

    def _seconds(self, after: Delay) -> float:
        if after.expression is None:
            assert after.seconds is not None
            return after.seconds
        missing: set[str] = set()
        memory = self.session.memory
        try:
            value = after.expression.compiled_value(memory.environment(missing))
        except EvaluationError as error:
            raise NoTime(str(error)) from None
        finally:
            memory.note_missing(missing)
        if isinstance(value, str) and after.unit is None:
            written = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*(ms|s|min)\s*", value, re.ASCII)
            if written is None:
                raise NoTime("a text that is no time")
            seconds = float(written[1]) * UNITS[written[2]]
        elif isinstance(value, bool) or not isinstance(value, int | float) or math.isnan(value):
            raise NoTime("no number")
        else:
            seconds = value * (after.unit or 1.0)
        if seconds > DAY:
            raise NoTime("more than 24 hours")
        return round(max(seconds, 0.001), 6)

    def _record(self, run: Run, index: int, status: str, seconds: float | None = None, reason: str = "") -> None:
        self.session.put(
            "countdown",
            rule=run.name,
            state=run.state.id,
            transition=index,
            status=status,
            seconds=seconds,
            reason=reason,
        )
