"""How an act goes when it is played: which of its actions begins and ends when."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from itertools import pairwise
from typing import Any

from msgspec import Struct

from rise_engine.drawing.act_levels import actions_in_order
from rise_engine.drawing.act_seconds import estimate_call_seconds
from rise_engine.kernel.act_runner import SPEECH_CHANNEL
from rise_engine.scenario.model import Act, Scenario

MARGIN = 0.01
"""Seconds by which a length may be missed, and that a part is longer than twice."""


class ActionSpan(Struct, frozen=True):
    """One action of an act, in seconds since the act's beginning."""

    id: str
    begin: float
    end: float
    on_robot: bool
    speaks: bool
    may_fail: bool
    """Whether its failure makes the act fail."""


class ActCourse(Struct, frozen=True):
    """All actions of an act."""

    spans: tuple[ActionSpan, ...]

    @property
    def length(self) -> float:
        return max((span.end for span in self.spans), default=0.0)

    def is_on_robot(self, at: float) -> bool:
        """Whether the robot does something of it then."""
        return any(span.on_robot and span.begin <= at < span.end for span in self.spans)

    def parts(self, *, on_robot: bool) -> list[tuple[float, float]]:
        """The longest times in which the robot does something of it, or in which it only waits."""
        marks = sorted({0.0, self.length, *(at for span in self.spans for at in (span.begin, span.end))})
        parts: list[tuple[float, float]] = []
        for begin, end in pairwise(marks):
            if end - begin < 2 * MARGIN or self.is_on_robot((begin + end) / 2) != on_robot:
                continue
            if parts and parts[-1][1] == begin:
                parts[-1] = (parts[-1][0], end)
            else:
                parts.append((begin, end))
        return parts

    def changes_of_voice(self) -> list[float]:
        """When the robot begins to speak in it, or falls silent, before its end."""
        marks = sorted({at for span in self.spans if span.speaks for at in (span.begin, span.end)} - {0.0})
        return [at for at in marks if at < self.length - 1e-6 and self._speaks(at - 1e-6) != self._speaks(at + 1e-6)]

    def _speaks(self, at: float) -> bool:
        return any(span.speaks and span.begin <= at < span.end for span in self.spans)


def course_of(
    scenario: Scenario,
    act: Act,
    memory: Mapping[str, Any],
    seconds: Mapping[str, float],
    factors: Mapping[str, float] | None = None,
) -> ActCourse:
    """The course of an act.

    Arguments:
        scenario: whose act it is.
        act: the act.
        memory: what the memory is, for how long things probably take.
        seconds: how long its actions take, as far as that is known, by their ids.
        factors: how many times longer the robot takes for some of them.
    """
    spans: dict[str, ActionSpan] = {}
    for action in actions_in_order(act):
        specs = [scenario.robot.actions[call.type] for call in action.calls]
        sent = [scenario.robot.actions[spec.substitute] if spec.substitute is not None else spec for spec in specs]
        begin = max((spans[before].end for before in action.wait_for if before in spans), default=0.0)
        length = seconds.get(action.id)
        if length is None:
            length = max((estimate_call_seconds(scenario, call, memory) or 0.0 for call in action.calls), default=0.0)
        on_robot = not all(spec.engine for spec in specs)
        if on_robot and factors:
            length *= factors.get(action.id, 1.0)
        speaks = any(SPEECH_CHANNEL in spec.channels for spec in sent)
        may_fail = on_robot and not action.continue_on_failure
        spans[action.id] = ActionSpan(action.id, begin, begin + length, on_robot, speaks, may_fail)
    return ActCourse(tuple(spans.values()))


def slowed(
    scenario: Scenario,
    act: Act,
    memory: Mapping[str, Any],
    seconds: Mapping[str, float],
    length: float,
    able: Iterable[str],
    pace: tuple[float, float],
) -> dict[str, float]:
    """How many times longer which actions take, so that the act takes `length` seconds: if one is enough, one.

    `able`: the actions of which it can be asked; `pace`: the smallest and the largest factor. As near as possible.
    """
    now = course_of(scenario, act, memory, seconds)
    candidates = sorted(
        (span for span in now.spans if span.on_robot and span.id in set(able) and span.end > span.begin),
        key=lambda span: (span.end != now.length, span.begin - span.end),
    )
    for span in candidates:
        wanted = (length - now.length) / (span.end - span.begin) + 1.0
        if pace[0] <= wanted <= pace[1]:
            factors = {span.id: _rounded(wanted)}
            if abs(course_of(scenario, act, memory, seconds, factors).length - length) < MARGIN:
                return factors
    low, high = pace
    for _ in range(24):
        middle = (low + high) / 2
        factors = {span.id: middle for span in candidates}
        if course_of(scenario, act, memory, seconds, factors).length < length:
            low = middle
        else:
            high = middle
    return {span.id: _rounded(high) for span in candidates}


def with_a_pause(
    scenario: Scenario, act: Act, memory: Mapping[str, Any], seconds: Mapping[str, float], pace: tuple[float, float]
) -> dict[str, float]:
    """How many times longer one of an act's actions takes, so that there is a moment in which the robot does nothing of
    the act; empty: none was found."""
    now = course_of(scenario, act, memory, seconds)
    waits_for = {action.id: set(action.wait_for) for action in act.actions}
    for pause in now.spans:
        before = max(
            (span for span in now.spans if span.id in waits_for[pause.id] and span.on_robot),
            key=lambda span: span.end,
            default=None,
        )
        if pause.on_robot or before is None or before.end == before.begin:
            continue
        others = (span.end for span in now.spans if span.on_robot and span != before and span.begin < pause.end)
        factor = (max(others, default=0.0) - before.begin) / (before.end - before.begin)
        factors = {before.id: _rounded(min(max(factor, 1.0), pace[1]))}
        if course_of(scenario, act, memory, seconds, factors).parts(on_robot=False):
            return factors
    return {}


def _rounded(factor: float) -> float:
    return round(factor, 4)
