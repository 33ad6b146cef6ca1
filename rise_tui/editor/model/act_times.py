"""When the actions of an act begin and end, as far as that can be told before it is performed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

from rise_engine.author.edit.outline import WrittenAct
from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.loader import LoadResult
from rise_engine.scenario.model import ActionCall, ActionSpec, Json
from rise_engine.scenario.parameters import fill_parameters
from rise_engine.scenario.template import MissingValueError


class ActionTime(NamedTuple):
    """Seconds from the act's beginning."""

    begin: float
    end: float


def action_times(act: WrittenAct, checked: LoadResult) -> dict[str, ActionTime]:
    """By the ids of the actions, with the memory's start values; those that wait for each other count as at once."""
    waits = {action.id: action.wait_for for action in act.actions}
    seconds = _action_seconds(act, checked)
    times: dict[str, ActionTime] = {}

    def end_of(id: str, on_way: frozenset[str]) -> float:
        if id in times:
            return times[id].end
        if id in on_way or id not in waits:
            return 0.0
        begin = max((end_of(before, on_way | {id}) for before in waits[id]), default=0.0)
        times[id] = ActionTime(begin, begin + seconds[id])
        return times[id].end

    for action in act.actions:
        end_of(action.id, frozenset())
    return times


def act_seconds(act: WrittenAct, checked: LoadResult) -> float:
    """How long the whole act will probably take."""
    return max((each.end for each in action_times(act, checked).values()), default=0.0)


def _action_seconds(act: WrittenAct, checked: LoadResult) -> dict[str, float]:
    read = checked.draft.acts.get(act.name)
    calls = {action.id: action.calls for action in read.actions} if read is not None else {}
    specs, memory = checked.robot.actions, checked.draft.memory
    found: dict[str, float] = {}
    for action in act.actions:
        known = [_seconds(each, specs.get(each.type), memory) for each in calls.get(action.id, ())]
        if not known:  # it cannot be read: what its declaration says
            spec = specs.get(action.calls[0].type) if action.calls else None
            known = [spec.seconds if spec is not None else 0.0]
        found[action.id] = sum(known) / len(known)
    return found


def _seconds(call: ActionCall, spec: ActionSpec | None, memory: Mapping[str, Json]) -> float:
    if spec is None:
        return 0.0
    try:
        return expected_seconds(spec, fill_parameters(call, spec, memory))
    except (MissingValueError, ValueError):
        return expected_seconds(spec, {})
