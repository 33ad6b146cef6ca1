"""Estimates of an act's duration before its first run."""

from __future__ import annotations

from collections.abc import Mapping
from graphlib import TopologicalSorter
from typing import Any

from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.model import Act, Action, ActionCall, Scenario
from rise_engine.scenario.parameters import fill_parameters
from rise_engine.scenario.speech.template import MissingValueError

# --- levels of actions ------------------------------------------------------------------------------------------------


def action_levels(act: Act) -> list[list[int]]:
    """Sort an act's actions into levels: lists of indexes, each level after everything that it waits for."""
    index_of = {action.id: index for index, action in enumerate(act.actions)}
    sorter = TopologicalSorter(
        {index: [index_of[id] for id in action.wait_for if id in index_of] for index, action in enumerate(act.actions)}
    )
    sorter.prepare()
    levels = []
    while sorter.is_active():
        ready = sorter.get_ready()
        levels.append(sorted(ready))
        sorter.done(*ready)
    return levels


def actions_in_order(act: Act) -> list[Action]:
    """Sort an act's actions so that each comes after those that it waits for."""
    return [act.actions[index] for level in action_levels(act) for index in level]


def estimate_act_seconds(scenario: Scenario, act: Act, memory: Mapping[str, Any]) -> float:
    """Estimate an act's seconds with this memory; an action that needs a missing value counts by its declaration."""
    ends: dict[str, float] = {}
    for action in actions_in_order(act):
        begin = max((ends.get(before, 0.0) for before in action.wait_for), default=0.0)
        ends[action.id] = begin + _mean_seconds(scenario, action, memory)
    return max(ends.values(), default=0.0)


def _mean_seconds(scenario: Scenario, action: Action, memory: Mapping[str, Any]) -> float:
    """Average the seconds of an action's variants."""
    estimates = (estimate_call_seconds(scenario, call, memory) for call in action.calls)
    return sum(seconds or 0.0 for seconds in estimates) / max(1, len(action.calls))


def estimate_call_seconds(scenario: Scenario, call: ActionCall, memory: Mapping[str, Any]) -> float | None:
    """Estimate the seconds of one call with this memory; None for an action that the robot does not know."""
    spec = scenario.robot.actions.get(call.type)
    if spec is None:
        return None
    try:
        parameters = fill_parameters(call, spec, memory)
    except (MissingValueError, ValueError):
        parameters = {}
    return expected_seconds(spec, parameters)
