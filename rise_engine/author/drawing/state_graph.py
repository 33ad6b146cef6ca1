"""A rule as a drawing in text: its states below each other, loops and branches as rails at the left. Pure.

Each state has a row, and so has each transition. A transition to the state below goes straight down. Every other one
leaves to the left and follows the rail of its target to the arrow. All transitions to one state share a rail with one
arrow. A rail that crosses a transition is drawn over it. A transition without a free rail names its target.

The layout depends on the rule and the width alone: a state never changes its place, only its marks change.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import zip_longest
from typing import Literal, NamedTuple, TypeAlias
from unicodedata import category, east_asian_width

from rise_engine.author.drawing.rule_text import transition_label
from rise_engine.base.text import clean
from rise_engine.scenario.model import Rule

# --- cells of text ----------------------------------------------------------------------------------------------------

_WITHOUT_WIDTH = ("Mn", "Me", "Cf")
"""Unicode categories of combining marks and invisible characters."""


def cell_length(text: str) -> int:
    """Count the cells of a text (https://www.unicode.org/reports/tr11/).

    East Asian wide characters and most emoji take two cells, combining marks none.

    >>> cell_length("Grün"), cell_length("挨拶"), cell_length("e\\u0301")
    (4, 4, 1)
    """
    if text.isascii():
        return len(text)
    return sum(_character_cells(character) for character in text)


def _character_cells(character: str) -> int:
    if category(character) in _WITHOUT_WIDTH:
        return 0
    return 2 if east_asian_width(character) in ("W", "F") else 1


def shorten_to(text: str, width: int) -> str:
    """Make a text safe to show in at most `width` cells; a longer text ends in `…`.

    >>> shorten_to("After the welcome", 10)
    'After the…'
    """
    text = clean(text)
    if cell_length(text) <= width:
        return text
    cells, kept = 0, ""
    for character in text:
        cells += _character_cells(character)
        if cells > width - 1:
            break
        kept += character
    return kept.rstrip() + "…" if width > 0 else ""


# --- the order of states ----------------------------------------------------------------------------------------------

Targets = Mapping[str, Sequence[str]]
"""For every state, its possible next states in the file's order, each once."""


class StateOrder(NamedTuple):
    """All states of a rule, each once."""

    states: tuple[str, ...]
    reached: int
    """How many states, from the first on, the rule can reach; the others follow."""


def find_state_order(rule: Rule) -> StateOrder:
    """Order the rule's states: successors come below, first transitions first, end states after states that go on.

    The order depends on the rule alone, so that a state never changes its place.
    """
    targets = {
        name: tuple(
            dict.fromkeys(transition.target for transition in state.transitions if transition.target in rule.states)
        )
        for name, state in rule.states.items()
    }
    first = [rule.initial] if rule.initial in targets else []
    course = _find_course(first, targets)
    rest = _find_course((name for name in targets if name not in set(course)), targets, frozenset(course))
    return StateOrder((*course, *rest), len(course))


def _find_course(roots: Iterable[str], targets: Targets, known: frozenset[str] = frozenset()) -> list[str]:
    """Order everything that the roots reach: a state comes after all that lead to it, apart from loops."""
    entries, loops, found = _explore(roots, targets, known)
    open_entries = dict.fromkeys(found, 0)
    for source in found:
        for target in _onward_states(source, targets, loops, open_entries):
            open_entries[target] += 1
    placed: list[str] = []
    ready = [root for root in reversed(entries) if not open_entries[root]]
    while ready:
        state = ready.pop()
        placed.append(state)
        follow = []
        for target in _onward_states(state, targets, loops, open_entries):
            open_entries[target] -= 1
            if not open_entries[target]:
                follow.append(target)
        follow.reverse()  # the last of the list is placed next
        ready.extend(sorted(follow, key=lambda one: bool(targets[one])))
    return placed


def _onward_states(
    source: str, targets: Targets, loops: set[tuple[str, str]], among: Mapping[str, int]
) -> Iterable[str]:
    return (target for target in targets[source] if target in among and (source, target) not in loops)


def _explore(
    roots: Iterable[str], targets: Targets, known: frozenset[str]
) -> tuple[list[str], set[tuple[str, str]], list[str]]:
    """Search depth first, first transitions first: return the entries, the transitions closing a loop, the states."""
    entries: list[str] = []
    loops: set[tuple[str, str]] = set()
    found: list[str] = []
    seen = set(known)
    for root in roots:
        if root in seen:
            continue
        entries.append(root)
        seen.add(root)
        found.append(root)
        walked = [(root, iter(targets[root]))]
        walking = {root}
        while walked:
            state, rest = walked[-1]
            target = next(rest, None)
            if target is None:
                walked.pop()
                walking.discard(state)
            elif target in walking:
                loops.add((state, target))
            elif target not in seen:
                seen.add(target)
                found.append(target)
                walking.add(target)
                walked.append((target, iter(targets[target])))
    return entries, loops, found


EdgeKind: TypeAlias = Literal["down", "rail", "word", "again", "stays"]
"""How a transition is drawn: straight down, by a rail, by its target's name; `again` enters its own state again."""

LONG = 26
"""Maximum number of rows in which a state and its transition down have a row each."""
ROOM_FOR_BOTH = 44
"""Cells that a shared row needs for its texts."""
MARKS = 12
"""Cells that stay free after a name for a state's marks: `  maybe next`."""


class GraphEdge(NamedTuple):
    """One transition as it is drawn."""

    source: str
    number: int
    """Index among its state's transitions, in the file's order."""
    target: str | None
    label: str
    kind: EdgeKind
    row: int
    """The row with its label."""
    lane: int = -1
    """The lane of its rail; 0 is the nearest to the states."""


class GraphRow(NamedTuple):
    """One row: a state, a transition, or, in a long rule, a state and its transition down."""

    state: str
    """The state; for a transition's row, the state that it leaves."""
    is_state: bool
    edge: GraphEdge | None
    rails: str = ""
    """The cells left of the node."""
    node: str = ""
    """The character of a transition in the column of the states; empty: a state, whose mark changes."""
    notes: tuple[str, ...] = ()
    """Constant remarks on a state: `start`, `end`, `never reached`."""


class GraphLayout(NamedTuple):
    rows: tuple[GraphRow, ...]
    edges: dict[tuple[str, int], GraphEdge]
    """By state and index."""
    row_of: dict[str, int]
    gutter: int
    """Cells of the rails."""
    names: int
    """Cells of the column of names with their marks in a long rule; 0: labels have rows of their own."""
    width: int


class _Rail(NamedTuple):
    target: str
    arrow: int
    """The row of the target."""
    top: int
    bottom: int
    lane: int
    sources: tuple[int, ...]


def lay_out_graph(rule: Rule, width: int) -> GraphLayout:
    """Lay out a rule in `width` cells."""
    order = find_state_order(rule)
    most = most_lanes(width)
    compact = sum(1 + len(state.transitions) for state in rule.states.values()) > LONG
    compact = compact and width - 2 * most - 3 >= ROOM_FOR_BOTH
    plan = _plan_rows(rule, order, compact)
    row_of = {row.state: index for index, row in enumerate(plan) if row.is_state}
    edges = {(row.edge.source, row.edge.number): row.edge for row in plan if row.edge is not None}
    rails = _assign_lanes([edge for edge in edges.values() if edge.kind == "rail"], row_of, most)
    lane_of = {row: rail.lane for rail in rails for row in rail.sources}
    for key, edge in edges.items():
        if edge.kind == "rail":
            lane = lane_of.get(edge.row, -1)
            edges[key] = edge._replace(lane=lane, kind="rail" if lane >= 0 else "word")
    lanes = max((rail.lane + 1 for rail in rails), default=0)
    names = max(map(cell_length, rule.states)) + MARKS if compact else 0
    return GraphLayout(
        tuple(_draw_rows(rule, order, plan, edges, [_gutter_text(row, rails, lanes) for row in range(len(plan))])),
        edges,
        row_of,
        2 * lanes + 1,
        min(names, (width - 2 * lanes - 3) * 3 // 5),
        width,
    )


def edge_path(layout: GraphLayout, edge: GraphEdge) -> Iterator[tuple[int, int]]:
    """Yield the cells, row and column, of a transition's rail from its label to the arrow; none without a rail."""
    if edge.kind != "rail" or edge.target is None:
        return
    arrow = layout.row_of[edge.target]
    column = layout.gutter - 2 * (edge.lane + 1)
    for row in (edge.row, arrow):
        for cell in range(column, layout.gutter):
            if cell == column or layout.rows[row].rails[cell] != "│":
                yield row, cell
    for row in range(min(edge.row, arrow) + 1, max(edge.row, arrow)):
        yield row, column


def most_lanes(width: int) -> int:
    """Return how many rails fit side by side in a width."""
    return min(max((width - 30) // 9, 2), 6)


def _draw_rows(
    rule: Rule, order: StateOrder, plan: list[GraphRow], edges: dict[tuple[str, int], GraphEdge], gutters: list[str]
) -> Iterator[GraphRow]:
    """Add the rails and nodes to the rows of the plan."""
    reached = set(order.states[: order.reached])
    falling = {edge.source for edge in edges.values() if edge.kind == "down"}
    for index, row in enumerate(plan):
        edge = edges[row.edge.source, row.edge.number] if row.edge is not None else None
        node, notes = "", {}
        if row.is_state:
            notes = {
                "start": row.state == rule.initial,
                "end": not rule.states[row.state].transitions,
                "never reached": row.state not in reached,
            }
        elif edge is not None:
            is_last = index + 1 == len(plan) or plan[index + 1].is_state
            node = _node_character(edge, last=is_last and row.state not in falling)
        yield row._replace(edge=edge, rails=gutters[index], node=node, notes=tuple(filter(notes.get, notes)))


def _plan_rows(rule: Rule, order: StateOrder, compact: bool) -> list[GraphRow]:
    """Plan a row for each state and each transition, before the rails are known."""
    plan: list[GraphRow] = []
    for name, below in zip_longest(order.states, order.states[1:]):
        down: list[GraphEdge] = []
        other: list[GraphEdge] = []
        for index, transition in enumerate(rule.states[name].transitions):
            target = transition.target
            kind: EdgeKind = (
                "stays" if target is None
                else "again" if target == name
                else "down" if target == below
                else "rail" if target in rule.states
                else "word"
            )  # fmt: skip
            label = transition_label(transition)
            if transition.condition is not None and not transition.is_eventless:
                label = f"{label} if {transition.condition.text}"
            (down if kind == "down" else other).append(GraphEdge(name, index, target, label, kind, 0))
        beside = down.pop(0)._replace(row=len(plan)) if compact and down else None
        plan.append(GraphRow(name, True, beside))
        for edge in (*other, *down):
            plan.append(GraphRow(name, False, edge._replace(row=len(plan))))
    return plan


def _assign_lanes(edges: list[GraphEdge], row_of: dict[str, int], most: int) -> list[_Rail]:
    """Give each target one rail, short transitions first. If there is no room, the longest have none."""
    rails: dict[str, _Rail] = {}
    for edge in sorted(edges, key=lambda each: (abs(each.row - row_of[each.target or ""]), each.row)):
        target = edge.target or ""
        arrow = row_of[target]
        known = rails.get(target) or _Rail(target, arrow, arrow, arrow, 0, ())
        top, bottom = min(known.top, edge.row), max(known.bottom, edge.row)
        others = [
            rail for rail in rails.values() if rail.target != target and rail.top <= bottom and top <= rail.bottom
        ]
        taken = {rail.lane for rail in others}
        for lane in (known.lane, *range(most)):
            if lane not in taken:
                rails[target] = _Rail(target, arrow, top, bottom, lane, (*known.sources, edge.row))
                break
    return list(rails.values())


def _gutter_text(row: int, rails: list[_Rail], lanes: int) -> str:
    """Draw the rails in one row, and the connection from or to one of them."""
    cells = [" "] * (2 * lanes + 1)
    joined = -1
    for rail in rails:
        if not rail.top <= row <= rail.bottom:
            continue
        column = len(cells) - 2 * (rail.lane + 1)
        if row == rail.arrow or row in rail.sources:
            joined = column
            cells[column] = "╭" if row == rail.top else "╰" if row == rail.bottom else "├"
            if row == rail.arrow:
                cells[-1] = "►"
        else:
            cells[column] = "│"
    if joined >= 0:
        for column in range(joined + 1, len(cells)):
            if cells[column] == " ":
                cells[column] = "─"
    return "".join(cells)


def _node_character(edge: GraphEdge, *, last: bool) -> str:
    match edge.kind:
        case "down":
            return "↓"
        case "rail":
            return "╯" if last else "┤"
        case "word":
            return "╰" if last else "├"
        case _:
            return "↺"
