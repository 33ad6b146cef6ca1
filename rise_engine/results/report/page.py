"""A report as one HTML file: its own drawings, no script, nothing fetched; light and dark, on a screen and on A4.

Text browsers can read it too: it has headings, tables with headers, and a title on every drawing.
"""

from __future__ import annotations

from collections.abc import Iterable
from importlib.resources import files

from rise_engine.results.report.document import Block, Document, Facts, Figure, Paragraph, ReportTable, Section
from rise_engine.results.report.svg import element, escape

POLICY = "default-src 'none'; style-src 'unsafe-inline'"
"""What a browser may do with it: show it with its own styles."""


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
    return element("p", escape(table.caption), class_="caption") + made  # a `caption` is as narrow as its table


def _cells(row: tuple[str, ...], numbers: frozenset[int]) -> Iterable[str]:
    for at, value in enumerate(row):
        kind = "number" * (at in numbers)
        yield (
            element("td", escape(value), class_=kind) if at else element("th", escape(value), scope="row", class_=kind)
        )


def _anchor(title: str) -> str:
    return "".join(each if each.isalnum() else "-" for each in title.lower())
