"""How many cells of a terminal a text takes; what counts in drawings that line up."""

from __future__ import annotations

from unicodedata import category, east_asian_width

from rise_engine.base.text import clean

_WITHOUT_WIDTH = ("Mn", "Me", "Cf")
"""Marks that stand on the character before, and characters that are not seen."""


def cell_length(text: str) -> int:
    """The cells of a text: two for East Asian wide characters and most emoji, none for combining marks
    (https://www.unicode.org/reports/tr11/).

    >>> cell_length("Grün"), cell_length("挨拶"), cell_length("e\\u0301")
    (4, 4, 1)
    """
    if text.isascii():
        return len(text)
    return sum(_character_cells(character) for character in text)


def _character_cells(character: str) -> int:
    if category(character) in _WITHOUT_WIDTH:
        return 0
    return 2 if east_asian_width(character) in ("W", "F") else 1


def shorten_to(text: str, width: int) -> str:
    """The text, made safe to show, in at most `width` cells; what does not fit ends in `…`.

    >>> shorten_to("After the welcome", 10)
    'After the…'
    """
    text = clean(text)
    if cell_length(text) <= width:
        return text
    cells, kept = 0, ""
    for character in text:
        cells += _character_cells(character)
        if cells > width - 1:
            break
        kept += character
    return kept.rstrip() + "…" if width > 0 else ""
