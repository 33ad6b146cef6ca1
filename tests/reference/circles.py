"""Who goes round in circles (semantics.md 6.4)."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .rules import Rules, Run


@dataclass(eq=False)
class Step:
    """A start of a rule, or a transition that it takes."""

    rule: str
    """Empty: no step of a rule, but a task in the chain."""
    cause: Step | None
    task: int | None = None


class Circles:
    """Counts the steps of one go."""

    def __init__(self, rules: Rules) -> None:
        self.rules = rules
        self.steps: Counter[str] = Counter()
        self.in_vain = 0
        self.same_go = False
        self.stopped: set[str] = set()
        """The rules that were stopped in this go: they do not start again in it."""
        self.most_steps = 1000
        self.most_in_vain = 100

    def begin(self, same_go: bool) -> None:
        """Another input; `same_go` for a time that took no time."""
        self.same_go = same_go
        if not same_go:
            self.steps.clear()
            self.stopped.clear()
            self.in_vain = 0

    def about_to_step(self, run: Run, cause: Step | None) -> Step | None:
        """A rule is about to take a step; perhaps one of the rules is stopped for it. Nothing when it is this one."""
        step = Step(run.name, cause)
        if self.steps[run.name] >= self.most_steps:
            before, self.rules.step = self.rules.step, cause
            self._look(run, step)
            self.rules.step = before
            if run not in self.rules.stack:
                return None
            self.steps[run.name] = 0
        return step

    def count(self, run: Run) -> None:
        """The step has been taken: the rule is where it leads to."""
        self.steps[run.name] += 1

    def _look(self, run: Run, step: Step) -> None:
        chain = []
        at: Step | None = step
        while at is not None:
            chain.append(at.rule)
            at = at.cause
        chain.reverse()
        running = {each.name for each in self.rules.stack}
        times = Counter(name for name in chain if name in running)
        most = max(times.values())
        if most >= 2:
            self._stop(next(name for name in chain if times.get(name) == most))
        elif self.same_go:
            self._stop(run.name)
        else:
            self.in_vain += 1
            if self.in_vain > self.most_in_vain:
                causes = [event.cause.rule for event in self.rules.events if event.cause is not None]
                raised = Counter(name for name in causes if name in running)
                if raised:
                    self._stop(max(raised, key=lambda name: raised[name]))

    def _stop(self, name: str) -> None:
        self.stopped.add(name)
        for run in list(self.rules.stack):
            if run.name == name:
                self.rules.fault(run, "it goes round in circles")
                self.rules.session.standing.update()
