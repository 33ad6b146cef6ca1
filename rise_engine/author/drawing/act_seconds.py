"""How long an act will probably take before it has ever run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rise_engine.author.drawing.act_levels import actions_in_order
from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.model import Act, Action, ActionCall, Scenario
from rise_engine.scenario.parameters import fill_parameters
from rise_engine.scenario.template import MissingValueError


def estimate_act_seconds(scenario: Scenario, act: Act, memory: Mapping[str, Any]) -> float:
    """Seconds, with this memory; what needs a value that is not there counts by its declaration."""
    ends: dict[str, float] = {}
    for action in actions_in_order(act):
        begin = max((ends.get(before, 0.0) for before in action.wait_for), default=0.0)
        ends[action.id] = begin + _mean_seconds(scenario, action, memory)
    return max(ends.values(), default=0.0)


def _mean_seconds(scenario: Scenario, action: Action, memory: Mapping[str, Any]) -> float:
    """The mean of an action's variants."""
    estimates = (estimate_call_seconds(scenario, call, memory) for call in action.calls)
    return sum(seconds or 0.0 for seconds in estimates) / max(1, len(action.calls))


def estimate_call_seconds(scenario: Scenario, call: ActionCall, memory: Mapping[str, Any]) -> float | None:
    """Seconds that one call will probably take with this memory; None for an action that the robot does not know."""
    spec = scenario.robot.actions.get(call.type)
    if spec is None:
        return None
    try:
        parameters = fill_parameters(call, spec, memory)
    except (MissingValueError, ValueError):
        parameters = {}
    return expected_seconds(spec, parameters)
