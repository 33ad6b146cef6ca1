"""Reads a report's page as a browser does, for tests: its tables, headings and attributes, and whether it is whole."""

from __future__ import annotations

from html.parser import HTMLParser

VOID = frozenset({"meta", "br", "img", "link", "input", "hr"})


class PageReader(HTMLParser):
    """Fails where tags do not close in their order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        """Tag, name and value of every attribute."""
        self.headings: list[str] = []
        self.tables: dict[str, list[list[str]]] = {}
        """Rows of cells by a table's caption, the head first."""
        self.texts: list[str] = []
        self._rows: list[list[str]] = []
        self.feed(text)
        self.close()
        assert not self.open, self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        self.tags.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        if tag == "table":
            self._rows = self.tables[dict(attrs)["aria-label"] or ""] = []
        if tag == "tr":
            self._rows.append([])
        if tag in ("td", "th"):
            self._rows[-1].append("")
        if tag == "h2":
            self.headings.append("")

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, (tag, self.open)
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if {"td", "th"} & set(self.open):
            self._rows[-1][-1] += data
        if "h2" in self.open:
            self.headings[-1] += data
        if "style" not in self.open:
            self.texts.append(data)

    @property
    def text(self) -> str:
        """Everything that can be read."""
        return "\n".join(self.texts)

    def table(self, start: str) -> dict[str, dict[str, str]]:
        """The rows of the table whose caption begins so, by their first cell; each a value by its column."""
        rows = next(rows for caption, rows in self.tables.items() if caption.startswith(start))
        return {row[0]: dict(zip(rows[0], row, strict=True)) for row in rows[1:]}
