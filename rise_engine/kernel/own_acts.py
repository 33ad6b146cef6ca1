"""The acts that rules have started themselves, whose ends they can wait for with `ended` (semantics.md 5.4)."""

from __future__ import annotations

from collections.abc import Mapping

from rise_engine.kernel.compiled_rules import CompiledRule
from rise_engine.kernel.core import Core, Task
from rise_engine.kernel.failures import first_task
from rise_engine.kernel.records import ENGINE
from rise_engine.kernel.rule_stack import RuleRun, RuleStack
from rise_engine.scenario.model import ActOutcome


class OwnActs:
    """Tracks the acts that running rules have started. Each `RuleRun` has its own."""

    def __init__(self, core: Core, stack: RuleStack, compiled: Mapping[str, CompiledRule]) -> None:
        self._core = core
        self._stack = stack
        self._compiled = compiled

    def note_started(self, task: Task) -> None:
        """Note that an act is about to be scheduled. If a rule asked for it, the rule may wait for its end."""
        run = self._starter_of(task)
        if run is not None and task.behavior in self._compiled[run.name].acts_of_own_ends:
            run.own_acts[task.behavior] = task.id

    def note_ended(self, task: Task, outcome: ActOutcome) -> None:
        """Offer the end of the latest act of this name to the rule that started it, before all other rules."""
        run = self._starter_of(task)
        if run is not None and run.own_acts.get(task.behavior) == task.id:
            del run.own_acts[task.behavior]
            if (topic := self._compiled[run.name].own_ends.get((task.behavior, outcome))) is not None:
                self._core.events.append((topic, ENGINE, self._core.cause))

    def note_repeated(self, before: Task, now: Task) -> None:
        """Note that a failed act is repeated. It stays the latest act of its name for the rule that waits for it."""
        run = self._starter_of(before)
        if run is not None and run.own_acts.get(before.behavior) == before.id:
            run.own_acts[now.behavior] = now.id

    def find_rule(self, task: Task) -> RuleRun | None:
        """The running rule that started an act, or the first act that it repeats; None if that rule has ended."""
        run = self._starter_of(task)
        return run if run is not None and run.task.id < first_task(task) else None

    def _starter_of(self, task: Task) -> RuleRun | None:
        return self._stack.get(task.source.removeprefix("rule:")) if task.source.startswith("rule:") else None
