"""Reduces a repaint to the cells that the terminal does not show yet, and to the style codes that change something.

Rich writes a full style before each piece and resets it afterwards. For a moved cursor in a list, that is half of the
bytes sent.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from rich.console import Console
from rich.control import Control
from textual._compositor import ChopsUpdate, CompositorUpdate, LayoutUpdate
from textual.geometry import Size
from textual.strip import Strip

from rise_tui.rendering.cell_buffer import CellBuffer, CellRun


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
    """The same text with the same look, without codes that change nothing. It begins and ends without a style.

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
