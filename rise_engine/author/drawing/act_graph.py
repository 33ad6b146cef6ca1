"""An act's graph as lines beside its actions: which action must end before which begins. Pure.

Time runs downwards, level by level, with one row for each action. A line means "this action has ended". It begins at
its action (`╭`, or `┬` to the right of others) and leads down to every action that waits for it (`├ ┼`, and `╰ ┴` at
the last one). A line that only passes is drawn over the others (`│`). `╶` marks an action that waits for nothing and
that nothing waits for.
"""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.author.drawing.act_seconds import action_levels
from rise_engine.scenario.model import Act

_ENTERS = {(True, True): "╰", (True, False): "├", (False, True): "┴", (False, False): "┼"}
"""How a line meets the row of a waiting action, by: no other line is to its left, it ends here."""


class ActRow(NamedTuple):
    """One action."""

    position: int
    """Index in the act."""
    level: int
    """From 1. It can begin when the levels before have ended."""
    first: bool
    """Whether it is the first of its level."""
    rails: str = ""
    """Box-drawing characters, the same number in every row."""
    untold: tuple[str, ...] = ()
    """Ids of actions that it waits for and whose line does not lead here, because there are too many lines."""


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
            untold = tuple(act.actions[before].id for before in waits[position] if before not in lanes.values())
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
            drawn.append((ActRow(position, number, position == level[0], untold=untold), cells))
    width = 1 + max((lane for _, cells in drawn for lane, cell in cells.items() if cell != "─"), default=-1)
    return [row._replace(rails=_rails_text(cells, width)) for row, cells in drawn]


def _rails_text(cells: dict[int, str], width: int) -> str:
    tied = any(cell not in "│─" for cell in cells.values())
    return "".join(cells.get(lane, " ") for lane in range(width)) + ("─" if tied else "╶")
