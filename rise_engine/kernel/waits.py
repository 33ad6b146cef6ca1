"""What rules wait for: times in their states (`after`, `while`, computed times: semantics.md 5.5), and the ends of acts
that they started themselves (`ended`: semantics.md 5.4)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

from rise_engine.expression import Environment, EvaluationError
from rise_engine.expression.environment import describe
from rise_engine.kernel.compiled_rules import CompiledRule, CompiledTransition
from rise_engine.kernel.core import Core, Task, TimerTarget
from rise_engine.kernel.failures import first_task
from rise_engine.kernel.records import ENGINE, CountdownRecord
from rise_engine.kernel.rule_stack import RuleRun, RuleStack
from rise_engine.scenario.durations import MAX_SECONDS, seconds_from
from rise_engine.scenario.model import ActOutcome, Delay

MIN_SECONDS = 0.001
"""Shorter times are rounded up to this."""


def compute_delay(delay: Delay, env: Environment) -> tuple[float | None, str]:
    """The current seconds of a delay with an expression; or None, and the reason.

    A number is in the delay's unit, or in seconds without a unit. A text such as `2s` is a time, too.
    """
    assert delay.expression is not None
    try:
        value = delay.expression.compiled_value(env)
    except EvaluationError as error:
        return None, str(error)
    seconds = seconds_from(value, delay.unit)
    if seconds is None:
        return None, f"`{delay.text}` is {describe(value)}, which is not a time"
    if seconds > MAX_SECONDS:
        return None, f"`{delay.text}` is {describe(value)}, which is longer than 24 hours"
    return round(max(seconds, MIN_SECONDS), 6), ""


def begin_countdown(core: Core, run: RuleRun, transition: CompiledTransition) -> None:
    """Start counting. A plain `after` leaves no record of its own."""
    assert transition.after is not None
    seconds, problem = transition.after.seconds, ""
    if seconds is None:
        seconds, problem = compute_delay(transition.after, core.env)
        for key in core.newly_missing():
            core.record_note(f'the memory has no value for {key!r}, which `after="{transition.after.text}"` reads')
    if transition.after.seconds is None or transition.held is not None:
        status: Literal["began", "failed"] = "failed" if seconds is None else "began"
        core.emit(CountdownRecord, run.name, run.state.id, transition.index, status, seconds, problem)
    if seconds is not None:
        timer = core.set_timer(seconds, TimerTarget("after", run.name, str(transition.index)))
        run.timers[timer] = transition


def break_countdown(core: Core, run: RuleRun, transition: CompiledTransition) -> None:
    """Stop counting, because the condition no longer holds."""
    for timer in [timer for timer, timed in run.timers.items() if timed is transition]:
        del run.timers[timer]
        core.cancel_timer(timer)
    core.emit(CountdownRecord, run.name, run.state.id, transition.index, "broken")


# --- acts -------------------------------------------------------------------------------------------------------------


class OwnActs:
    """Tracks the acts that running rules have started. Each `RuleRun` has its own."""

    def __init__(self, core: Core, stack: RuleStack, compiled: Mapping[str, CompiledRule]) -> None:
        self._core = core
        self._stack = stack
        self._compiled = compiled

    def note_started(self, task: Task) -> None:
        """Note that an act will be scheduled. If a rule requested it, the rule may wait for its end."""
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
        """Note that a failed act is repeated. For the rule that waits for it, it stays the latest act of its name."""
        run = self._starter_of(before)
        if run is not None and run.own_acts.get(before.behavior) == before.id:
            run.own_acts[now.behavior] = now.id

    def find_rule(self, task: Task) -> RuleRun | None:
        """The running rule that started an act, or the first act that it repeats; None: that rule has ended."""
        run = self._starter_of(task)
        return run if run is not None and run.task.id < first_task(task) else None

    def _starter_of(self, task: Task) -> RuleRun | None:
        return self._stack.get(task.source.removeprefix("rule:")) if task.source.startswith("rule:") else None
