"""Of what was painted again, only the cells that the terminal does not show already."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rich.console import Console
from rich.control import Control
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate
from textual.geometry import Size
from textual.strip import Strip

from rise_tui.quiet.frame import Frame, Run


class Difference(CompositorUpdate):
    """Of an update, only the cells that the terminal does not show already.

    The stock updates write every cell of every region that was painted again: opening or closing any dialog writes the
    whole screen, 27 kB at 120x40, and leaving a row writes all of it.
    """

    def __init__(self, update: LayoutUpdate | ChopsUpdate, frame: Frame, size: Size) -> None:
        self._update, self._frame, self._size = update, frame, size

    def render_segments(self, console: Console) -> str:
        self._frame.resize(*self._size)
        update = self._update
        runs = _of_all(update, self._frame) if isinstance(update, LayoutUpdate) else _of_parts(update, self._frame)
        return "".join(written(runs, console))


class Written(CompositorUpdate):
    """The pieces of a frame, which were made before, and what is painted together with them."""

    def __init__(self, text: str, then: CompositorUpdate | None = None) -> None:
        self._text, self._then = text, then

    def render_segments(self, console: Console) -> str:
        return self._text + (self._then.render_segments(console) if self._then is not None else "")


def written(runs: Iterable[Run], console: Console) -> Iterator[str]:
    """As a terminal takes it."""
    for run in runs:
        yield Control.move_to(run.x, run.y).segment.text + run.strip.render(console)


def _of_all(update: LayoutUpdate, frame: Frame) -> Iterator[Run]:
    for y, line in enumerate(update.strips, update.region.y):
        yield from frame.put(update.region.x, y, Strip.join(line))


def _of_parts(update: ChopsUpdate, frame: Frame) -> Iterator[Run]:
    """A chop is a piece of a line between two borders of widgets; a span is what of the line is to be painted."""
    for y, start, end in update.spans:
        for (x, strip), chop_end in zip(update.chops[y].items(), update.chop_ends[y], strict=False):
            left, right = max(x, start), min(chop_end, end)
            if strip is not None and left < right:
                yield from frame.put(left, y, strip.crop(left - x, right - x))
