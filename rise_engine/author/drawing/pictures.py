"""A rule or an act as rows of a picture, the source of text and SVG: lines at the left, words to their right."""

from __future__ import annotations

from typing import Literal, NamedTuple, TypeAlias

from rise_engine.author.drawing.act_graph import ActRow, act_rows
from rise_engine.author.drawing.state_graph import (
    GraphEdge,
    GraphLayout,
    GraphRow,
    cell_length,
    lay_out_graph,
    shorten_to,
)
from rise_engine.base.text import clean, pluralize
from rise_engine.scenario.model import Act, Action, ActionCall, Rule
from rise_engine.scenario.speech.ssml import plain_words

PieceRole: TypeAlias = Literal["name", "label", "note"]
FAR = 8
"""Rows of a rail beyond which the label also names the target."""
LEAST_NAME = 4
"""Cells of a state's name that always stay visible."""
INDENT = 2
"""Cells that indent transitions behind names where a state and its transition down share a row."""
MOST_LINES = 8
"""Lines side by side in an act."""


class Piece(NamedTuple):
    """A text in a row."""

    column: int
    text: str
    role: PieceRole


class PictureRow(NamedTuple):
    lines: str
    """Box-drawing characters, one cell each, from the left edge."""
    pieces: tuple[Piece, ...]
    """From left to right; they do not overlap."""


class Picture(NamedTuple):
    kind: Literal["rule", "act"]
    name: str
    summary: str
    """Its size in words: `45 states, 69 transitions`."""
    rows: tuple[PictureRow, ...]
    width: int
    """The maximum number of cells in a row."""


def picture_of_rule(rule: Rule, width: int) -> Picture:
    """Draw a rule as the console shows it while it does not run."""
    layout = lay_out_graph(rule, width)
    ways = sum(len(state.transitions) for state in rule.states.values())
    summary = f"{pluralize(len(rule.states), 'state')}, {pluralize(ways, 'transition')}"
    return Picture("rule", rule.name, summary, tuple(_state_row(layout, row) for row in layout.rows), width)


def _state_row(layout: GraphLayout, row: GraphRow) -> PictureRow:
    lines, pieces = row.rails, []
    column = layout.gutter
    if row.is_state:
        lines += "○"
        column += 2
        room = layout.names if layout.names and row.edge is not None else layout.width - column
        words = "".join(f"  {note}" for note in row.notes)
        name = shorten_to(row.state, max(LEAST_NAME, room - cell_length(words)))
        pieces.append(Piece(column, name, "name"))
        if words:
            pieces.append(Piece(column + cell_length(name) + 2, words[2:], "note"))
        column += room + 1 if row.edge is not None else 0
    if row.edge is not None:
        if row.is_state:
            pieces.append(Piece(column, "↓", "note"))
            column += 2
        elif row.node:
            lines += row.node
            column += 2 + (INDENT if layout.names else 0)
        pieces += _way_pieces(layout, row.edge, column)
    return PictureRow(lines, tuple(pieces))


def _way_pieces(layout: GraphLayout, edge: GraphEdge, column: int) -> list[Piece]:
    """Place a transition's label, and its target where no rail shows it."""
    room = max(3, layout.width - column)
    label, tail = clean(edge.label), ""
    if edge.way in ("stays", "again"):
        tail = edge.way
    elif edge.target is not None and (edge.way == "word" or _rail_length(layout, edge) > FAR):
        tail = "→ " + shorten_to(edge.target, max((room - 4) // 2, room - 4 - cell_length(label)))
    label = shorten_to(label, max(3, room - cell_length(tail) - (2 if tail else 0)))
    pieces = [Piece(column, label, "label")]
    if tail:
        gap = 1 if tail.startswith("→") else 2
        pieces.append(Piece(column + cell_length(label) + gap, tail, "note"))
    return pieces


def _rail_length(layout: GraphLayout, edge: GraphEdge) -> int:
    return abs(edge.row - layout.row_of[edge.target]) if edge.way == "rail" and edge.target is not None else 0


def picture_of_act(act: Act, width: int) -> Picture:
    """Draw an act: which actions must end before which begin."""
    rows = act_rows(act, MOST_LINES)
    ids = max((cell_length(action.id) for action in act.actions), default=0)
    types = max((cell_length(_types_text(action)) for action in act.actions), default=0)
    drawn = tuple(_action_row(act.actions[row.position], row, ids, types, width) for row in rows)
    return Picture("act", act.name, pluralize(len(act.actions), "action"), drawn, width)


def _types_text(action: Action) -> str:
    return " / ".join(dict.fromkeys(call.type for call in action.calls))


def _action_row(action: Action, row: ActRow, ids: int, types: int, width: int) -> PictureRow:
    start = len(row.rails) + 1
    pieces = [Piece(start, action.id, "note"), Piece(start + ids + 1, _types_text(action), "name")]
    after = start + ids + types + 3
    words = " / ".join(call_text(call) for call in action.calls)
    if row.untold:
        words = f"after {', '.join(row.untold)}  {words}"
    if words := shorten_to(words, max(3, width - after)):
        pieces.append(Piece(after, words, "label"))
    return PictureRow(row.rails, tuple(pieces))


def call_text(call: ActionCall) -> str:
    """Shorten what an action says, or its parameters, as the author wrote them; memory values are in braces."""
    parameters = {name: template.text for name, template in call.parameters.items()}
    message = parameters.pop("message", None)
    said = [] if message is None else [f"“{plain_words(message).strip()}”"]
    return clean(" ".join([*said, *parameters.values()]))


def text_of(picture: Picture) -> list[str]:
    """Return the picture's lines of characters, none wider than the picture."""
    lines = []
    for row in picture.rows:
        line = row.lines
        for piece in row.pieces:
            line += " " * (piece.column - cell_length(line)) + piece.text
        lines.append(line.rstrip())
    return lines
