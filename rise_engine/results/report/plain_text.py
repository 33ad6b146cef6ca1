"""A report as lines for a terminal: the numbers of the page, and drawings as text."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from unicodedata import east_asian_width

from rise_engine.base.text import clean
from rise_engine.results.report.document import Block, Document, Facts, Figure, Paragraph, ReportTable

WIDTH = 80
_GAP = 2
_LEAST = 6
"""The smallest width to which columns are narrowed, in characters."""


def text_lines(document: Document, width: int = WIDTH) -> list[str]:
    """Write the report in lines that fit the width and are safe to show.

    :param document: the report.
    :param width: the width in characters, at least 40.
    """
    width = max(40, width)
    lines = [clean(document.kind).upper(), *_wrap(document.title, width)]
    if document.banner:
        lines += ["", *(f"!! {line}" for line in _wrap(document.banner, width - 3))]
    if document.summary:
        lines += ["", *_wrap(document.summary, width)]
    lines += ["", *_facts(document.facts, width)] if document.facts else []
    for section in document.sections:
        title = clean(section.title)
        lines += ["", "", title, "\u2500" * len(title)]
        for block in section.blocks:
            made = _block(block, width)
            lines += ["", *made] if made and lines[-1][:1] != "\u2500" else made
    if document.colophon:
        lines += ["", *_wrap(document.colophon, width)]
    return lines


def cells_wide(text: str) -> int:
    """Count a text's cells in a terminal."""
    return sum(2 if east_asian_width(each) in "WF" else 1 for each in text)


def _block(block: Block, width: int) -> list[str]:
    match block:
        case Paragraph():
            start = "!! " if block.voice == "warning" else ""
            return [start + line for line in _wrap(block.text, width - len(start))]
        case Facts():
            return _facts(block.rows, width)
        case Figure():
            made = block.text(width) if block.text is not None else []
            return [part for line in made for part in (_wrap(line, width) if cells_wide(line) > width else [line])]
        case ReportTable():
            if block.page_only or block.folded:
                return _wrap(f"({block.caption}: in the HTML report, -o FILE.html)", width)
            return _table(block, width)


def _facts(rows: Iterable[tuple[str, str]], width: int) -> list[str]:
    given = list(rows)
    label = max((cells_wide(clean(name)) for name, _ in given), default=0) + _GAP
    lines = []
    for name, value in given:
        for at, line in enumerate(_wrap(value, width - label) or [""]):
            lines.append((_pad(clean(name), label) if at == 0 else " " * label) + line)
    return lines


def _table(table: ReportTable, width: int) -> list[str]:
    lines = _wrap(table.caption, width)
    shown = [table.head, *table.rows]
    columns = [at for at in range(len(table.head)) if any(row[at] for row in table.rows)]  # without empty ones
    widths, gap = _column_widths([[clean(row[at]).replace("\u00a0", " ") for at in columns] for row in shown], width)
    for number, row in enumerate(shown):
        cells = [_wrap(row[at], widths[place]) or [""] for place, at in enumerate(columns)]
        for at in range(max(map(len, cells), default=0)):
            parts = [
                _pad(cell[at] if at < len(cell) else "", widths[place], right=columns[place] in table.numbers)
                for place, cell in enumerate(cells)
            ]
            lines.append((" " * gap).join(parts).rstrip())
        if number == 0:
            lines.append("\u2500" * min(width, sum(widths) + gap * (len(widths) - 1)))
    return [*lines, *_wrap(table.note, width)]


def _column_widths(rows: list[list[str]], width: int) -> tuple[list[int], int]:
    """Choose column widths and the gap between columns. If the texts are too wide, the widest columns shrink while
    their words stay whole; then the gaps shrink; then words are broken."""
    if not rows or not rows[0]:
        return [], _GAP
    columns = range(len(rows[0]))
    widths = [max(cells_wide(row[at]) for row in rows) for at in columns]
    words = [max((cells_wide(word) for row in rows for word in row[at].split()), default=1) for at in columns]
    gap = _GAP
    while sum(widths) + gap * (len(widths) - 1) > width:
        spare = [at for at in columns if widths[at] > max(words[at], _LEAST)]
        if spare:
            widths[max(spare, key=lambda at: widths[at])] -= 1
        elif gap > 1:
            gap = 1
        elif max(widths) > 1:
            widths[widths.index(max(widths))] -= 1
        else:
            break
    return widths, gap


def _pad(text: str, width: int, *, right: bool = False) -> str:
    blanks = " " * max(0, width - cells_wide(text))
    return blanks + text if right else text + blanks


def _wrap(text: str, width: int) -> list[str]:
    """Wrap a text to a number of cells. Wide characters count as two."""
    text = clean(text).replace("\u00a0", " ")
    if cells_wide(text) <= width:
        return [text] if text else []
    narrow = width if cells_wide(text) == len(text) else max(1, width // 2)
    return textwrap.wrap(text, max(1, narrow), break_on_hyphens=False)
