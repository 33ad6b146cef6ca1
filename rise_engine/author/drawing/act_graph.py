"""An act's graph as lines beside its actions, which show the actions that each action waits for. Pure.

Time runs downwards, level by level, with one row for each action. A line means "this action has ended". It begins at
its action (`╭`, or `┬` to the right of others) and leads down to every action that waits for it (`├ ┼`, and `╰ ┴` at
the last one). A line that only passes is drawn over the others (`│`). `╶` marks an action that neither waits nor is
awaited. This module also estimates an act's duration level by level, before its first run.
"""

from __future__ import annotations

from collections.abc import Mapping
from graphlib import TopologicalSorter
from typing import Any, NamedTuple

from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.model import Act, Action, ActionCall, Scenario
from rise_engine.scenario.parameters import fill_parameters
from rise_engine.scenario.speech.template import MissingValueError

# --- levels and seconds -----------------------------------------------------------------------------------------------


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


# --- rows -------------------------------------------------------------------------------------------------------------


_ENTERS = {(True, True): "╰", (True, False): "├", (False, True): "┴", (False, False): "┼"}
"""How a line meets the row of a waiting action, by: it has no other line to its left, it ends here."""


class ActRow(NamedTuple):
    """One action."""

    position: int
    """Index in the act."""
    level: int
    """From 1. It can begin when all earlier levels have ended."""
    first: bool
    """Whether it is the first of its level."""
    rails: str = ""
    """Box-drawing characters, the same number in every row."""
    undrawn: tuple[str, ...] = ()
    """Ids of actions that it waits for, but whose lines do not lead here, because there are too many lines."""


def act_rows(act: Act, most: int) -> list[ActRow]:
    """Lay out all actions of an act with at most `most` lines side by side."""
    positions = {action.id: position for position, action in enumerate(act.actions)}
    waits = [dict.fromkeys(positions[id] for id in action.wait_for if id in positions) for action in act.actions]
    open_ends = [sum(position in each for each in waits) for position in range(len(act.actions))]
    lanes: dict[int, int] = {}
    """The action whose line is in each lane."""
    drawn: list[tuple[ActRow, dict[int, str]]] = []
    """Each row with the cells of its lanes."""
    for number, level in enumerate(action_levels(act), 1):
        for position in level:
            cells = dict.fromkeys(lanes, "│")
            enters = sorted(lane for lane, owner in lanes.items() if owner in waits[position])
            free = next(lane for lane in range(len(lanes) + 1) if lane not in lanes)
            begins = free if open_ends[position] and free < most else -1
            touched = sorted([*enters, *([begins] if begins >= 0 else [])])
            undrawn = tuple(act.actions[before].id for before in waits[position] if before not in lanes.values())
            for lane in enters:
                owner = lanes[lane]
                open_ends[owner] -= 1
                cells[lane] = _ENTERS[lane == touched[0], not open_ends[owner]]
                if not open_ends[owner]:
                    del lanes[lane]
            if begins >= 0:
                cells[begins] = "╭" if begins == touched[0] else "┬"
                lanes[begins] = position
            for lane in range(touched[0] if touched else most, most):
                cells.setdefault(lane, "─")
            drawn.append((ActRow(position, number, position == level[0], undrawn=undrawn), cells))
    width = 1 + max((lane for _, cells in drawn for lane, cell in cells.items() if cell != "─"), default=-1)
    return [row._replace(rails=_rails_text(cells, width)) for row, cells in drawn]


def _rails_text(cells: dict[int, str], width: int) -> str:
    tied = any(cell not in "│─" for cell in cells.values())
    return "".join(cells.get(lane, " ") for lane in range(width)) + ("─" if tied else "╶")
