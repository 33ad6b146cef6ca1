"""A mark for cameras: the whole terminal in one colour, with the mark's number, for a moment."""

from __future__ import annotations

from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip
from textual.widget import Widget

from rise_tui.rendering.themes import BLACK, WHITE

FLASH_SECONDS = 0.6
"""Seconds that it is shown: 15 pictures of a camera at 25 pictures a second."""
_DIGITS = {
    "0": "### # # # # # ###",
    "1": " #  ##   #   #  ###",
    "2": "###   # ### #   ###",
    "3": "###   # ###   # ###",
    "4": "# # # # ###   #   #",
    "5": "### #   ###   # ###",
    "6": "### #   ### # # ###",
    "7": "###   #   #   #   #",
    "8": "### # # ### # # ###",
    "9": "### # # ###   # ###",
}
"""Five rows of three dots, with a blank between rows."""
_WIDTH, _HEIGHT = 3, 5


def flash_rows(number: int, width: int, height: int) -> list[str]:
    """The number in the middle of `width` times `height` cells: `#` for painted cells, blanks elsewhere.

    A cell is twice as high as it is wide, so a dot is twice as many cells wide as high.

    >>> print("\\n".join(row.rstrip() for row in flash_rows(4, 8, 5)))
     ##  ##
     ##  ##
     ######
         ##
         ##
    """
    digits = str(number)
    columns = len(digits) * (_WIDTH + 1) - 1
    scale = min(height // _HEIGHT, width // (2 * columns))
    if scale < 1:
        return [" " * width] * height
    dots = [" ".join(_row(digit, row) for digit in digits) for row in range(_HEIGHT)]
    wide = ["".join(dot * 2 * scale for dot in row).center(width)[:width] for row in dots]
    rows = [row for row in wide for _ in range(scale)]
    above = (height - len(rows)) // 2
    return [" " * width] * above + rows + [" " * width] * (height - len(rows) - above)


def _row(digit: str, row: int) -> str:
    return _DIGITS[digit][row * (_WIDTH + 1) :][:_WIDTH].ljust(_WIDTH)


class Flash(Widget, can_focus=False):
    """Covers everything else on a screen, but takes no keys: they go where they went before."""

    DEFAULT_CSS = """
    Flash { layer: flash; overlay: screen; width: 100%; height: 100%; }
    """

    def __init__(self, number: int, *, on_dark: bool) -> None:
        """`on_dark`: whether the screen below is dark, for the strongest contrast."""
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
