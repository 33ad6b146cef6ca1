"""The terminal's contents, cell by cell, so that a repaint sends only different cells. Without a screen.

Textual paints regions: opening a small dialog sends every cell of the terminal again, 27 kB at 120x40.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple, TypeAlias

from rich.cells import cell_len
from rich.console import Console
from rich.control import Control
from rich.segment import Segment
from rich.style import Style
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate
from textual.geometry import Size
from textual.strip import Strip

GAP = 8
"""Up to this many equal cells between two different ones cost less than moving the cursor."""
SECOND = "\0"
"""The start of a wide character's second cell, so that it differs whenever the character does."""

Cell: TypeAlias = tuple[str, Style | None]


class CellRun(NamedTuple):
    """Cells to write from a position."""

    x: int
    y: int
    strip: Strip


class CellBuffer:
    """The written contents. Call `forget` after anything else has written to the terminal."""

    def __init__(self) -> None:
        self._rows: list[list[Cell | None]] = []
        self._size = 0, 0

    @property
    def is_known(self) -> bool:
        """Whether anything was written since the last `forget`."""
        return self._size != (0, 0)

    def forget(self) -> None:
        """Forget everything: the next update is written in full."""
        self._rows, self._size = [], (0, 0)

    def resize(self, width: int, height: int) -> None:
        """Forget everything if the size has changed, because the window's contents are then unknown."""
        if self._size != (width, height):
            self._rows, self._size = [[None] * width for _ in range(height)], (width, height)

    def put(self, x: int, y: int, strip: Strip) -> list[CellRun]:
        """Store new content at a position. Returns the cells to write."""
        if not 0 <= y < len(self._rows):
            return []
        row = self._rows[y]
        cells = cells_of(strip)[: max(0, len(row) - x)]
        before, row[x : x + len(cells)] = row[x : x + len(cells)], cells
        return [CellRun(x + start, y, strip_of(cells[start:end])) for start, end in differing_spans(before, cells)]


def cells_of(strip: Iterable[Segment]) -> list[Cell]:
    """One entry for each cell. Marks without a width belong to the cell before."""
    cells: list[Cell] = []
    for text, style, control in strip:
        if control:
            continue
        if text.isascii():
            cells += [(character, style) for character in text]
            continue
        for character in text:
            width = cell_len(character)
            if width:
                cells.append((character, style))
                cells += [(SECOND + character, style)] * (width - 1)
            elif cells:
                cells[-1] = (cells[-1][0] + character, cells[-1][1])
    return cells


def strip_of(cells: Iterable[Cell]) -> Strip:
    """Cells as a strip to write."""
    return Strip(
        [
            Segment("".join(text for text, _ in run if not text.startswith(SECOND)), style)
            for style, run in groupby(cells, key=lambda cell: cell[1])
        ]
    )


def differing_spans(before: Sequence[Cell | None], after: Sequence[Cell]) -> list[tuple[int, int]]:
    """The spans in which two rows differ. Spans that are close together become one."""
    found: list[tuple[int, int]] = []
    for x, (old, new) in enumerate(zip(before, after, strict=True)):
        if old == new:
            continue
        if found and x - found[-1][1] <= GAP:
            found[-1] = found[-1][0], x + 1
        else:
            found.append((x, x + 1))
    return found


# --- what of a repaint is sent ----------------------------------------------------------------------------------------

# Rich writes a full style before each piece and resets it afterwards. For a moved cursor in a list, that is half of the
# bytes. So style codes without effect are omitted, too.


class DiffUpdate(CompositorUpdate):
    """An update, reduced to the cells that the terminal does not show yet.

    Textual's own updates write every cell of every repainted region. A dialog or a change of focus writes the whole
    screen, 27 kB at 120x40; leaving a row writes all of it.
    """

    def __init__(self, update: LayoutUpdate | ChopsUpdate, cells: CellBuffer, size: Size) -> None:
        """`cells`: the contents of a terminal of this size, updated with everything written."""
        self._update, self._cells, self._size = update, cells, size

    def render_segments(self, console: Console) -> str:
        """The terminal's codes for the cells that differ."""
        self._cells.resize(*self._size)
        update = self._update
        runs = (
            _runs_of_lines(update, self._cells)
            if isinstance(update, LayoutUpdate)
            else _runs_of_chops(update, self._cells)
        )
        return shorten_styles(
            "".join(Control.move_to(run.x, run.y).segment.text + run.strip.render(console) for run in runs)
        )


def _runs_of_lines(update: LayoutUpdate, cells: CellBuffer) -> Iterator[CellRun]:
    for y, line in enumerate(update.strips, update.region.y):
        yield from cells.put(update.region.x, y, Strip.join(line))


def _runs_of_chops(update: ChopsUpdate, cells: CellBuffer) -> Iterator[CellRun]:
    """The runs of a partial update. A chop is a piece of a line between two borders; a span is the part to paint."""
    for y, start, end in update.spans:
        for (x, strip), chop_end in zip(update.chops[y].items(), update.chop_ends[y], strict=False):
            left, right = max(x, start), min(chop_end, end)
            if strip is not None and left < right:
                yield from cells.put(left, y, strip.crop(left - x, right - x))


# --- style codes ------------------------------------------------------------------------------------------------------

_STYLE = re.compile(r"\x1b\[([\d;]*)m")
_MOVE = re.compile(r"\x1b\[[\d;]*[A-HJKfdG]")
_COLOUR = re.compile(r"(?:^|;)((?:38|48);(?:5;\d+|2;\d+;\d+;\d+)|3[0-79]|4[0-79]|9[0-7]|10[0-7])(?=;|$)")
_SEEN_ON_BLANKS = frozenset("479")
"""Underlined, reversed, struck out."""


class _Style(NamedTuple):
    """The effect of a code; empty: the terminal's default."""

    attributes: str = ""
    """Bold and similar."""
    foreground: str = ""
    background: str = ""


def shorten_styles(codes: str) -> str:
    """Return the same text with the same look, without codes that have no effect. It begins and ends without a style.

    The colour of a blank is invisible, and may differ.
    """
    first, *rest = _STYLE.split(codes)
    written, shown, wanted = [first], _Style(), _Style()
    for parameters, text in zip(rest[::2], rest[1::2], strict=True):
        wanted = _read(parameters)
        if printed := _MOVE.sub("", text):
            is_blank = not printed.strip(" ")
            if not (is_blank and _looks_alike_on_blanks(shown, wanted)):
                written.append(_change(shown, wanted))
                shown = wanted
        written.append(text)
    written.append(_change(shown, _Style()))
    return "".join(written)


def _read(parameters: str) -> _Style:
    if parameters in ("", "0"):
        return _Style()
    colours = _COLOUR.findall(parameters)
    foreground = next((each for each in colours if each[0] in "39"), "")
    background = next((each for each in colours if each[0] in "41"), "")
    return _Style(_COLOUR.sub("", parameters).strip(";"), foreground, background)


def _looks_alike_on_blanks(one: _Style, other: _Style) -> bool:
    seen = _SEEN_ON_BLANKS & {*one.attributes.split(";"), *other.attributes.split(";")}
    return one.background == other.background and not seen


def _change(shown: _Style, wanted: _Style) -> str:
    """The codes from one style to another."""
    if shown == wanted:
        return ""
    if wanted == _Style():
        return "\x1b[0m"
    takes_back = any(before and not after for before, after in zip(shown[1:], wanted[1:], strict=True))
    if takes_back or shown.attributes not in ("", wanted.attributes):
        return f"\x1b[{';'.join(('0', *filter(None, wanted)))}m"
    return f"\x1b[{';'.join(after for before, after in zip(shown, wanted, strict=True) if after and after != before)}m"
