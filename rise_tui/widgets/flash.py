"""A mark that a camera sees: the whole terminal in one colour, with the mark's number, for a moment."""

from __future__ import annotations

from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip
from textual.widget import Widget

from rise_tui.model.flash import FLASH_SECONDS, flash_rows

WHITE, BLACK = "#ffffff", "#000000"


class Flash(Widget, can_focus=False):
    """Lies over everything else of a screen, and takes no key: what is pressed meanwhile goes where it went before."""

    DEFAULT_CSS = """
    Flash { layer: flash; overlay: screen; width: 100%; height: 100%; }
    """

    def __init__(self, number: int, *, on_dark: bool) -> None:
        """`on_dark`: whether what it lies over is dark; it must differ as much as it can."""
        super().__init__()
        self.number = number
        ground, ink = (WHITE, BLACK) if on_dark else (BLACK, WHITE)
        self._ground, self._ink = Style(color=ink, bgcolor=ground), Style(color=ground, bgcolor=ink)

    def on_mount(self) -> None:
        self.set_timer(FLASH_SECONDS, self.remove)

    def render_line(self, y: int) -> Strip:
        width, height = self.size
        row = flash_rows(self.number, width, height)[y]
        pieces: list[Segment] = []
        at = 0
        while at < len(row):
            end = at
            while end < len(row) and row[end] == row[at]:
                end += 1
            pieces.append(Segment(" " * (end - at), self._ink if row[at] == "#" else self._ground))
            at = end
        return Strip(pieces, width)
