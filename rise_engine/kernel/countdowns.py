"""The times that rules count in their states: `after`, `while`, and computed times (semantics.md 5.5)."""

from __future__ import annotations

from typing import Literal

from rise_engine.expression import Environment, EvaluationError
from rise_engine.expression.values import describe
from rise_engine.kernel.compiled_rules import CompiledTransition
from rise_engine.kernel.core import Core, TimerTarget
from rise_engine.kernel.records import CountdownRecord
from rise_engine.kernel.rule_stack import RuleRun
from rise_engine.scenario.durations import MAX_SECONDS, seconds_from
from rise_engine.scenario.model import Delay

MIN_SECONDS = 0.001
"""Shorter times are rounded up to this."""


def compute_delay(delay: Delay, env: Environment) -> tuple[float | None, str]:
    """The current seconds of a delay with an expression; or None, and the reason.

    A number is in the delay's unit. Without a unit it is in seconds, and a text such as `2s` is a time too.
    """
    assert delay.expression is not None
    try:
        value = delay.expression.compiled_value(env)
    except EvaluationError as error:
        return None, str(error)
    seconds = seconds_from(value, delay.unit)
    if seconds is None:
        return None, f"`{delay.text}` is {describe(value)}, which is no time"
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
    """Stop counting, because the condition does not hold any more."""
    for timer in [timer for timer, timed in run.timers.items() if timed is transition]:
        del run.timers[timer]
        core.cancel_timer(timer)
    core.emit(CountdownRecord, run.name, run.state.id, transition.index, "broken")
