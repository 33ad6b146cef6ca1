"""Reduces a repaint to the cells that the terminal does not show yet."""

from __future__ import annotations

from collections.abc import Iterator

from rich.console import Console
from rich.control import Control
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate
from textual.geometry import Size
from textual.strip import Strip

from rise_tui.rendering.cell_buffer import CellBuffer, CellRun
from rise_tui.rendering.style_codes import shorten_styles


class DiffUpdate(CompositorUpdate):
    """An update, reduced to the cells that the terminal does not show yet.

    The stock updates write every cell of every repainted region. Opening or closing any dialog, and any change of
    focus, writes the whole screen, 27 kB at 120x40; leaving a row writes all of it.
    """

    def __init__(self, update: LayoutUpdate | ChopsUpdate, cells: CellBuffer, size: Size) -> None:
        """`cells`: the contents of a terminal of this size; it takes in what is written."""
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
