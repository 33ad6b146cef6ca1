"""What the terminal shows, cell by cell, so that only different cells are sent. Pure: knows no screen.

Textual paints regions: opening a small dialog sends every cell of the terminal again, 27 kB at 120x40.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import groupby
from typing import NamedTuple, TypeAlias

from rich.cells import cell_len
from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip

GAP = 8
"""Up to this many equal cells between two different ones cost less than moving the cursor."""
SECOND = "\0"
"""The beginning of a wide character's second cell, so that it differs whenever the character does."""

Cell: TypeAlias = tuple[str, Style | None]


class CellRun(NamedTuple):
    """Cells to write from a position."""

    x: int
    y: int
    strip: Strip


class CellBuffer:
    """What was written so far. Call `forget` after anything else has written to the terminal."""

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
        """Take in new content at a position; returns what must be written for it."""
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
