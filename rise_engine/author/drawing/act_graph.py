"""An act's graph as lines beside its actions: what has to end before what begins. Pure.

Time runs downwards, one row for each action, level by level. A line is "this action has ended": it begins at its
action (`╭`, or `┬` behind others) and leads down to all that wait for it (`├ ┼`, and `╰ ┴` at the last one). A line
that only passes is drawn over the others (`│`). `╶` stands before an action that waits for nothing and that nothing
waits for.
"""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.author.drawing.act_seconds import action_levels
from rise_engine.scenario.model import Act

_ENTERS = {(True, True): "╰", (True, False): "├", (False, True): "┴", (False, False): "┼"}
"""Where a line meets the row of what waits for it, by: nothing is left of it, it ends here."""


class ActRow(NamedTuple):
    """One action."""

    position: int
    """In the act."""
    level: int
    """Counting from 1: it can begin when the levels before have ended."""
    first: bool
    """It is the first of its level."""
    rails: str = ""
    """As many cells in every row."""
    untold: tuple[str, ...] = ()
    """Ids of actions for which it waits and from which no line leads here, because there are too many."""


def act_rows(act: Act, most: int) -> list[ActRow]:
    """All actions of an act with at most `most` lines beside each other."""
    positions = {action.id: position for position, action in enumerate(act.actions)}
    waits = [dict.fromkeys(positions[id] for id in action.wait_for if id in positions) for action in act.actions]
    open_ends = [sum(position in each for each in waits) for position in range(len(act.actions))]
    lanes: dict[int, int] = {}
    """Which action's line is in which lane."""
    drawn: list[tuple[ActRow, dict[int, str]]] = []
    """Each row, and what is in its lanes."""
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
