"""Rules and acts as pictures: in text, as SVG and as Mermaid diagrams.

Text and SVG use the same rows: lines at the left, words to their right.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Literal, NamedTuple, TypeAlias
from xml.sax.saxutils import escape

from rise_engine.author.drawing.act_graph import ActRow, act_rows
from rise_engine.author.drawing.rule_text import transition_label
from rise_engine.author.drawing.state_graph import (
    GraphEdge,
    GraphLayout,
    GraphRow,
    cell_length,
    find_state_order,
    lay_out_graph,
    shorten_to,
)
from rise_engine.base.text import clean, pluralize
from rise_engine.scenario.model import Act, Action, ActionCall, Rule
from rise_engine.scenario.speech.ssml import plain_words

PieceRole: TypeAlias = Literal["name", "label", "note"]
LONG_RAIL = 8
"""Rows of a rail beyond which the label also names the target."""
MIN_NAME_WIDTH = 4
"""Minimum cells of a state's name that stay visible."""
INDENT = 2
"""Cells of indentation for transitions behind names, if a state and its transition down share a row."""
MAX_LINES = 8
"""Maximum number of lines side by side in an act."""


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
    """Draw a rule like the console does for a rule that is not running."""
    layout = lay_out_graph(rule, width)
    transitions = sum(len(state.transitions) for state in rule.states.values())
    summary = f"{pluralize(len(rule.states), 'state')}, {pluralize(transitions, 'transition')}"
    return Picture("rule", rule.name, summary, tuple(_state_row(layout, row) for row in layout.rows), width)


def _state_row(layout: GraphLayout, row: GraphRow) -> PictureRow:
    lines, pieces = row.rails, []
    column = layout.gutter
    if row.is_state:
        lines += "○"
        column += 2
        room = layout.names if layout.names and row.edge is not None else layout.width - column
        words = "".join(f"  {note}" for note in row.notes)
        name = shorten_to(row.state, max(MIN_NAME_WIDTH, room - cell_length(words)))
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
        pieces += _transition_pieces(layout, row.edge, column)
    return PictureRow(lines, tuple(pieces))


def _transition_pieces(layout: GraphLayout, edge: GraphEdge, column: int) -> list[Piece]:
    """Place a transition's label, and its target where no rail shows it."""
    room = max(3, layout.width - column)
    label, tail = clean(edge.label), ""
    if edge.kind in ("stays", "again"):
        tail = edge.kind
    elif edge.target is not None and (edge.kind == "word" or _rail_length(layout, edge) > LONG_RAIL):
        tail = "→ " + shorten_to(edge.target, max((room - 4) // 2, room - 4 - cell_length(label)))
    label = shorten_to(label, max(3, room - cell_length(tail) - (2 if tail else 0)))
    pieces = [Piece(column, label, "label")]
    if tail:
        gap = 1 if tail.startswith("→") else 2
        pieces.append(Piece(column + cell_length(label) + gap, tail, "note"))
    return pieces


def _rail_length(layout: GraphLayout, edge: GraphEdge) -> int:
    return abs(edge.row - layout.row_of[edge.target]) if edge.kind == "rail" and edge.target is not None else 0


def picture_of_act(act: Act, width: int) -> Picture:
    """Draw an act with the order of its actions."""
    rows = act_rows(act, MAX_LINES)
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
    if row.undrawn:
        words = f"after {', '.join(row.undrawn)}  {words}"
    if words := shorten_to(words, max(3, width - after)):
        pieces.append(Piece(after, words, "label"))
    return PictureRow(row.rails, tuple(pieces))


def call_text(call: ActionCall) -> str:
    """Shorten an action's text or parameters, as the author wrote them, with memory values in braces."""
    parameters = {name: template.text for name, template in call.parameters.items()}
    message = parameters.pop("message", None)
    spoken = [] if message is None else [f"“{plain_words(message).strip()}”"]
    return clean(" ".join([*spoken, *parameters.values()]))


def text_of(picture: Picture) -> list[str]:
    """Return the picture's lines of characters, none wider than the picture."""
    lines = []
    for row in picture.rows:
        line = row.lines
        for piece in row.pieces:
            line += " " * (piece.column - cell_length(line)) + piece.text
        lines.append(line.rstrip())
    return lines


# --- SVG --------------------------------------------------------------------------------------------------------------


CELL, ROW, FONT = 8, 18, 13
"""Width of a character, height of a row, and font size, in px."""
MARGIN = 16
HEADING = 34
"""Height of a picture's title."""
GAP = 20
"""Pixels between two pictures."""

_ENDS = {
    "│": "UD",
    "─": "LR",
    "╭": "DR",
    "╰": "UR",
    "├": "UDR",
    "┤": "UDL",
    "╯": "UL",
    "┬": "LRD",
    "┴": "LRU",
    "┼": "UDLR",
    "╶": "R",
    "►": "LR",
}
"""The sides of its cell that a character's lines reach: up, down, left, right."""
_STYLE = (
    "text{font:13px ui-monospace,'DejaVu Sans Mono',Menlo,Consolas,monospace;fill:#1f2328;white-space:pre}"
    ".h{font-weight:bold;font-size:15px}.label{fill:#0a5a9c}.note{fill:#59636e}"
    ".l{stroke:#59636e;stroke-width:1.3;fill:none;stroke-linecap:round}.n{fill:#fff;stroke:#1f2328;stroke-width:1.5}"
    ".a{fill:#59636e}"
)


def svg_text(title: str, pictures: Sequence[Picture]) -> str:
    """Draw all pictures below each other.

    :param title: the title for screen readers.
    """
    width = 2 * MARGIN + CELL * max((_used_width(picture) for picture in pictures), default=40)
    height = MARGIN
    groups = []
    for picture in pictures:
        inside = "\n".join(_picture(picture))
        groups.append(f'<g transform="translate({MARGIN},{height})">\n{inside}\n</g>')
        height += HEADING + ROW * len(picture.rows) + GAP
    height += MARGIN - (GAP if pictures else 0)
    about = "; ".join(f"{picture.kind} {picture.name}: {picture.summary}" for picture in pictures)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}">\n<title>{escape(clean(title))}</title>\n<desc>{escape(clean(about))}</desc>\n'
        f"<style>{_STYLE}</style>\n"
        f'<rect width="{width}" height="{height}" fill="#fff"/>\n' + "\n".join(groups) + "\n</svg>\n"
    )


def _used_width(picture: Picture) -> int:
    ends = [piece.column + cell_length(piece.text) for row in picture.rows for piece in row.pieces]
    return max([*ends, cell_length(f"{picture.name}  {picture.summary}") + 4, 20])


def _picture(picture: Picture) -> Iterator[str]:
    yield (
        f'<text class="h" y="15">{escape(clean(picture.name))}'
        f'<tspan class="note" font-size="{FONT}" font-weight="normal" dx="16">{escape(picture.summary)}</tspan></text>'
    )
    yield f'<path class="l" d="{"".join(_line_path(picture.rows))}"/>'
    for number, row in enumerate(picture.rows):
        top = HEADING + number * ROW
        middle = top + ROW // 2
        for column, character in enumerate(row.lines):
            x = column * CELL + CELL // 2
            if character == "►":
                yield f'<path class="a" d="M{x - 3},{middle - 4}l7,4l-7,4z"/>'
            elif character == "○":
                yield f'<circle class="n" cx="{x}" cy="{middle}" r="5"/>'
            elif character not in _ENDS and not character.isspace():
                yield f'<text class="note" x="{column * CELL}" y="{middle + 5}">{escape(character)}</text>'
        for piece in row.pieces:
            room = cell_length(piece.text) * CELL
            yield (
                f'<text class="{piece.role}" x="{piece.column * CELL}" y="{middle + 5}" textLength="{room}" '
                f'lengthAdjust="spacingAndGlyphs">{escape(piece.text)}</text>'
            )


def _line_path(rows: Sequence[PictureRow]) -> Iterator[str]:
    """Draw all lines as one path, joining straight pieces."""
    across: dict[int, set[int]] = {}
    down: dict[int, set[int]] = {}
    for number, row in enumerate(rows):
        for column, character in enumerate(row.lines):
            for end in _ENDS.get(character, ""):
                if end in "LR":
                    across.setdefault(number, set()).add(2 * column + (end == "R"))
                else:
                    down.setdefault(column, set()).add(2 * number + (end == "D"))
            if character == "○" and _has_line_below(rows, number, column):
                down.setdefault(column, set()).add(2 * number + 1)
    for number in sorted(across):
        y = HEADING + number * ROW + ROW // 2
        for first, last in _runs(across[number]):
            yield f"M{first * CELL // 2},{y}H{last * CELL // 2}"
    for column in sorted(down):
        x = column * CELL + CELL // 2
        for first, last in _runs(down[column]):
            yield f"M{x},{HEADING + first * ROW // 2}V{HEADING + last * ROW // 2}"


def _has_line_below(rows: Sequence[PictureRow], number: int, column: int) -> bool:
    """Return whether a line continues below a state."""
    below = rows[number + 1].lines if number + 1 < len(rows) else ""
    return len(below) > column and "U" in _ENDS.get(below[column], "")


def _runs(halves: Iterable[int]) -> Iterator[tuple[int, int]]:
    """Join adjacent half cells into pairs of start and end."""
    start = end = None
    for half in sorted(halves):
        if half != end:
            if start is not None and end is not None:
                yield start, end
            start = half
        end = half + 1
    if start is not None and end is not None:
        yield start, end


# --- Mermaid ----------------------------------------------------------------------------------------------------------


_MERMAID_MARKS = {"#": "#35;", '"': "#quot;", ";": "#59;", ":": "#58;", "<": "#lt;", ">": "#gt;", "%": "#37;"}
"""Characters with a special meaning in Mermaid, and their replacements."""


def mermaid_of_rules(rules: Sequence[Rule]) -> str:
    """Draw a state diagram; several rules become composite states beside each other."""
    lines = ["stateDiagram-v2"]
    for number, rule in enumerate(rules):
        if len(rules) == 1:
            lines += [f"    %% rule {_mermaid(rule.name)}", *_mermaid_states(rule, "s", "    ")]
        else:
            inside = _mermaid_states(rule, f"r{number}s", "        ")
            lines += [f'    state "{_mermaid(rule.name)}" as r{number} {{', *inside, "    }"]
    return "\n".join(lines) + "\n"


def _mermaid_states(rule: Rule, prefix: str, indent: str) -> Iterator[str]:
    ids = {name: f"{prefix}{number}" for number, name in enumerate(find_state_order(rule).states)}
    for name, id in ids.items():
        yield f'{indent}state "{_mermaid(name)}" as {id}'
    yield f"{indent}[*] --> {ids[rule.initial]}"
    for name, id in ids.items():
        transitions = rule.states[name].transitions
        for transition in transitions:
            target = name if transition.target is None else transition.target
            stays = " (stays)" if transition.target is None else ""
            yield f"{indent}{id} --> {ids[target]} : {_mermaid(transition_label(transition, condition=True) + stays)}"
        if not transitions:
            yield f"{indent}{id} --> [*]"


def mermaid_of_acts(acts: Sequence[Act]) -> str:
    """Draw a flowchart from top to bottom; an arrow means "has to end before"."""
    lines = ["flowchart TD"]
    for number, act in enumerate(acts):
        ids = {action.id: f"a{number}_{index}" for index, action in enumerate(act.actions)}
        lines.append(f'    subgraph g{number} ["{_mermaid(act.name)}"]')
        lines += [f'        {ids[action.id]}["{_mermaid(action_text(action))}"]' for action in act.actions]
        for action in act.actions:
            lines += [f"        {ids[before]} --> {ids[action.id]}" for before in _waits(action, ids)]
        lines.append("    end")
    return "\n".join(lines) + "\n"


def _mermaid(text: str) -> str:
    return "".join(_MERMAID_MARKS.get(character, character) for character in clean(text))


def action_text(action: Action) -> str:
    """Describe an action for its box: its id, its type, and its words."""
    words = " / ".join(filter(None, map(call_text, action.calls)))
    types = " / ".join(dict.fromkeys(call.type for call in action.calls))
    return f"{action.id} {types}  {words}".strip()


def _waits(action: Action, known: dict[str, str]) -> Iterator[str]:
    return (before for before in dict.fromkeys(action.wait_for) if before in known)
