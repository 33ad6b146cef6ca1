"""Pictures as SVG (https://www.w3.org/TR/SVG2/): the same bytes for the same pictures, with selectable text."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from xml.sax.saxutils import escape

from rise_engine.author.drawing.pictures import Picture, PictureRow
from rise_engine.author.drawing.state_graph import cell_length
from rise_engine.base.text import clean

CELL, ROW, FONT = 8, 18, 13
"""Width of a character, height of a row, and font size, in px."""
MARGIN = 16
HEADING = 34
"""Height of a picture's title."""
GAP = 20
"""Between two pictures."""

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

    :param title: what a screen reader announces.
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
            if character == "○" and _has_way_below(rows, number, column):
                down.setdefault(column, set()).add(2 * number + 1)
    for number in sorted(across):
        y = HEADING + number * ROW + ROW // 2
        for first, last in _runs(across[number]):
            yield f"M{first * CELL // 2},{y}H{last * CELL // 2}"
    for column in sorted(down):
        x = column * CELL + CELL // 2
        for first, last in _runs(down[column]):
            yield f"M{x},{HEADING + first * ROW // 2}V{HEADING + last * ROW // 2}"


def _has_way_below(rows: Sequence[PictureRow], number: int, column: int) -> bool:
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
