"""Times that an expression gives (semantics.md 5.5)."""

from __future__ import annotations

from typing import Any

from rise_engine.expression import Environment, EvaluationError
from rise_engine.expression.values import describe
from rise_engine.scenario.durations import MAX_SECONDS, parse_time
from rise_engine.scenario.model import Delay

MIN_SECONDS = 0.001
"""What is less counts as this."""


def compute_delay(delay: Delay, env: Environment) -> tuple[float | None, str]:
    """The seconds that a delay means now; or None, and why it means none.

    `delay` has an expression; a number that it gives is in the delay's unit, or in seconds without one, where a text
    such as `2s` is a time as well.
    """
    assert delay.expression is not None
    try:
        value = delay.expression.compiled_value(env)
    except EvaluationError as error:
        return None, str(error)
    seconds = _seconds_of(value, delay.unit)
    if seconds is None:
        return None, f"`{delay.text}` is {describe(value)}, which is no time"
    if seconds > MAX_SECONDS:
        return None, f"`{delay.text}` is {describe(value)}, which is longer than 24 hours"
    return round(max(seconds, MIN_SECONDS), 6), ""


def _seconds_of(value: Any, unit: float | None) -> float | None:
    if isinstance(value, bool):
        return None
    if isinstance(value, int | float):
        return value * (unit or 1.0) if abs(value) < 1e15 else float("inf") if value > 0 else 0.0
    return parse_time(value) if isinstance(value, str) and unit is None else None
