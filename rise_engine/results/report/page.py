"""A report as one HTML file, and as lines for a terminal. Both show the same numbers.

The file has its own drawings, no scripts and no external resources. It supports light, dark, screen and A4. Text
browsers can read it too: it has headings, tables with headers, and a title on every drawing. Colours and fonts of
drawings come from its style sheet by class, so that they follow light, dark and print.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable
from html import escape as escape_html
from importlib.resources import files
from unicodedata import east_asian_width

from rise_engine.base.text import clean
from rise_engine.results.report.document import Block, Document, Facts, Figure, Paragraph, ReportTable, Section

_ADDRESSES = re.compile(r"http|url\(", re.IGNORECASE)


def escape(text: str) -> str:
    """Escape a text for an element or an attribute. Invisible characters are marked, all others look the same.

    >>> escape("<b>see http://x</b>")
    '&lt;b&gt;see &#104;ttp://x&lt;/b&gt;'
    """
    safe = escape_html(clean(text), quote=True)
    return _ADDRESSES.sub(lambda found: f"&#{ord(found[0][0])};{found[0][1:]}", safe)


def element(tag: str, inner: str = "", **attributes: str) -> str:
    """Write an element.

    :param tag: its name.
    :param inner: markup made by this module.
    :param attributes: texts by name; `class_` is `class`, `_` becomes `-`, empty ones are omitted.
    """
    given = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(value)}"' for name, value in attributes.items() if value
    )
    return f"<{tag}{given}>{inner}</{tag}>"


class Drawing:
    """A drawing. Later marks cover earlier ones."""

    def __init__(self, width: float, height: float, title: str, description: str = "", *, name: str) -> None:
        """
        :param width: in units, which are pixels on a screen as wide as the drawing.
        :param height: in the same units.
        :param title: a title for people who cannot see it.
        :param description: its content in one or a few sentences.
        :param name: its kind, for the style sheet.
        """
        self.width, self.height, self.title, self.description, self.name = width, height, title, description, name
        self._marks: list[str] = []

    def box(self, x: float, y: float, width: float, height: float, kind: str, hover: str = "") -> None:
        """Draw a filled rectangle. Browsers show `hover` under the pointer."""
        self._add("rect", hover, x=x, y=y, width=max(0.0, width), height=max(0.0, height), class_=kind)

    def line(self, x1: float, y1: float, x2: float, y2: float, kind: str, hover: str = "") -> None:
        self._add("line", hover, x1=x1, y1=y1, x2=x2, y2=y2, class_=kind)

    def dot(self, x: float, y: float, radius: float, kind: str, hover: str = "") -> None:
        self._add("circle", hover, cx=x, cy=y, r=radius, class_=kind)

    def path(self, points: Iterable[tuple[float, float]], kind: str) -> None:
        """Draw a line through points."""
        steps = " ".join(f"{'L' if at else 'M'}{_number(x)} {_number(y)}" for at, (x, y) in enumerate(points))
        self._add("path", "", d=steps, class_=kind)

    def text(self, x: float, y: float, text: str, kind: str = "", anchor: str = "start") -> None:
        """Write a text whose base line begins (`start`), ends (`end`) or has its middle (`middle`) there."""
        self._marks.append(element("text", escape(text), x=_number(x), y=_number(y), class_=kind, text_anchor=anchor))

    def whole(self) -> str:
        """Return the `<svg>` element."""
        head = f"<title>{escape(self.title)}</title>"
        head += f"<desc>{escape(self.description)}</desc>" if self.description else ""
        return element(
            "svg",
            head + "\n" + "\n".join(self._marks) + "\n",
            viewBox=f"0 0 {_number(self.width)} {_number(self.height)}",
            role="img",
            aria_label=self.title,
            class_=self.name,
        )

    def _add(self, tag: str, hover: str, **attributes: str | float) -> None:
        inner = f"<title>{escape(hover)}</title>" if hover else ""
        given = {name: value if isinstance(value, str) else _number(value) for name, value in attributes.items()}
        self._marks.append(element(tag, inner, **given))


def _number(value: float) -> str:
    """Write a coordinate to a hundredth of a unit."""
    return f"{value:.2f}".rstrip("0").rstrip(".")


POLICY = "default-src 'none'; style-src 'unsafe-inline'"
"""The content security policy: a browser may show the page with its own styles, and nothing else."""


def page_text(document: Document) -> str:
    """Write the whole file. Equal documents give the same bytes.

    :param document: the report.
    """
    style = files("rise_engine.results.report").joinpath("page.css").read_text("utf-8")
    body = [_head(document), *(_contents(document.sections)), *map(_section, document.sections)]
    body.append(element("footer", element("p", escape(document.colophon))))
    return "\n".join(
        (
            "<!doctype html>",
            '<html lang="en">',
            "<head>",
            '<meta charset="utf-8">',
            f'<meta HTTP-EQUIV="Content-Security-Policy" content="{escape(POLICY)}">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            '<meta name="color-scheme" content="light dark">',
            f"<title>{escape(document.title)}</title>",
            f"<style>\n{style}</style>",
            "</head>",
            "<body>",
            *body,
            "</body>",
            "</html>",
            "",
        )
    )


def _head(document: Document) -> str:
    parts = [element("p", escape(document.kind), class_="kind"), element("h1", escape(document.title))]
    if document.banner:
        parts.append(element("p", escape(document.banner), class_="banner", role="note"))
    if document.summary:
        parts.append(element("p", escape(document.summary), class_="summary"))
    if document.facts:
        parts.append(_facts(document.facts))
    return element("header", "\n".join(parts))


def _contents(sections: Iterable[Section]) -> list[str]:
    links = [element("a", escape(section.title), href=f"#{_anchor(section.title)}") for section in sections]
    return [element("nav", " ".join(links), aria_label="Contents")] if len(links) > 1 else []


def _section(section: Section) -> str:
    heading = element("h2", escape(section.title), id=_anchor(section.title))
    return element("section", "\n".join((heading, *map(_block, section.blocks))))


def _block(block: Block) -> str:
    match block:
        case Paragraph():
            return element("p", escape(block.text), class_="" if block.voice == "plain" else block.voice)
        case Facts():
            return _facts(block.rows)
        case ReportTable():
            return _table(block)
        case Figure():
            caption = element("figcaption", escape(block.caption)) if block.caption else ""
            return element("figure", "\n".join(block.svg) + caption)


def _facts(rows: Iterable[tuple[str, str]]) -> str:
    lines = (element("div", element("dt", escape(name)) + element("dd", escape(value))) for name, value in rows)
    return element("dl", "\n".join(lines))


def _table(table: ReportTable) -> str:
    head = "".join(
        element("th", escape(name), scope="col", class_="number" * (at in table.numbers))
        for at, name in enumerate(table.head)
    )
    lines = [
        element("tr", "".join(_cells(row, table.numbers)), class_="marked" * (at in table.marked))
        for at, row in enumerate(table.rows)
    ]
    made = element(
        "table",
        element("thead", element("tr", head)) + element("tbody", "\n".join(lines)),
        aria_label=table.caption,
        class_="small" * table.page_only,
    )
    made = element("div", made, class_="scroll")
    made += element("p", escape(table.note), class_="note") if table.note else ""
    if table.folded:
        return element("details", element("summary", escape(table.caption)) + made)
    return element("p", escape(table.caption), class_="caption") + made  # a `caption` is only as wide as its table


def _cells(row: tuple[str, ...], numbers: frozenset[int]) -> Iterable[str]:
    for at, value in enumerate(row):
        kind = "number" * (at in numbers)
        yield (
            element("td", escape(value), class_=kind) if at else element("th", escape(value), scope="row", class_=kind)
        )


def _anchor(title: str) -> str:
    return "".join(each if each.isalnum() else "-" for each in title.lower())


# --- lines for a terminal ---------------------------------------------------------------------------------------------


WIDTH = 80
_GAP = 2
_MIN_WIDTH = 6
"""The minimum width to which columns are narrowed, in characters."""


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
    lines += ["", *_fact_lines(document.facts, width)] if document.facts else []
    for section in document.sections:
        title = clean(section.title)
        lines += ["", "", title, "\u2500" * len(title)]
        for block in section.blocks:
            made = _block_lines(block, width)
            lines += ["", *made] if made and lines[-1][:1] != "\u2500" else made
    if document.colophon:
        lines += ["", *_wrap(document.colophon, width)]
    return lines


def cells_wide(text: str) -> int:
    """Count a text's cells in a terminal."""
    return sum(2 if east_asian_width(each) in "WF" else 1 for each in text)


def _block_lines(block: Block, width: int) -> list[str]:
    match block:
        case Paragraph():
            start = "!! " if block.voice == "warning" else ""
            return [start + line for line in _wrap(block.text, width - len(start))]
        case Facts():
            return _fact_lines(block.rows, width)
        case Figure():
            made = block.text(width) if block.text is not None else []
            return [part for line in made for part in (_wrap(line, width) if cells_wide(line) > width else [line])]
        case ReportTable():
            if block.page_only or block.folded:
                return _wrap(f"({block.caption}: in the HTML report, -o FILE.html)", width)
            return _table_lines(block, width)


def _fact_lines(rows: Iterable[tuple[str, str]], width: int) -> list[str]:
    given = list(rows)
    label = max((cells_wide(clean(name)) for name, _ in given), default=0) + _GAP
    lines = []
    for name, value in given:
        for at, line in enumerate(_wrap(value, width - label) or [""]):
            lines.append((_pad(clean(name), label) if at == 0 else " " * label) + line)
    return lines


def _table_lines(table: ReportTable, width: int) -> list[str]:
    lines = _wrap(table.caption, width)
    shown = [table.head, *table.rows]
    columns = [at for at in range(len(table.head)) if any(row[at] for row in table.rows)]  # without empty columns
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
    """Choose column widths and the gap between columns. Texts that are too wide first narrow the widest columns down to
    whole words; then the gaps shrink; then words are broken."""
    if not rows or not rows[0]:
        return [], _GAP
    columns = range(len(rows[0]))
    widths = [max(cells_wide(row[at]) for row in rows) for at in columns]
    words = [max((cells_wide(word) for row in rows for word in row[at].split()), default=1) for at in columns]
    gap = _GAP
    while sum(widths) + gap * (len(widths) - 1) > width:
        spare = [at for at in columns if widths[at] > max(words[at], _MIN_WIDTH)]
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
