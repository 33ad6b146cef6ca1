"""The number of a mark as large as a terminal can show it, for cameras. Pure."""

from __future__ import annotations

FLASH_SECONDS = 0.6
"""How long it is shown: 15 pictures of a camera with 25 a second."""
LATE_SECONDS = 1.0
"""A console that hears of a mark later than that shows nothing: at that moment there was no flash."""
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
"""Five rows of three dots, one after the other with a blank between them."""
_WIDTH, _HEIGHT = 3, 5


def flash_rows(number: int, width: int, height: int) -> list[str]:
    """The number in the middle of so many cells: `#` where it is painted, a blank elsewhere.

    A cell is twice as high as wide, so that a dot is twice as many cells wide as high.

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
