"""What people hear or read of the tables of a scenario, cell by cell, and what of it is not translated.

A column is translated that has another one beside it, `text.de` beside `text`, or that a text of an act names:
`{items[i].text}` (docs/reference/languages.md).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from msgspec import Struct

from rise_engine.expression.nodes import Key, Literal, Part
from rise_engine.scenario.model import SourceLocation, Table
from rise_engine.scenario.spoken_texts import SpokenText

_LISTED = 5
"""Rows that a sentence names."""


class TableText(Struct, frozen=True):
    """A text in a table."""

    table: Table
    row: int
    """From 0."""
    column: str

    @property
    def id(self) -> str:
        """As an expression names it: `items[2].text`."""
        return f"{self.table.name}[{self.row}].{self.column}"

    @property
    def text(self) -> str:
        """On one line."""
        return _on_one_line(self.table.rows[self.row][self.table.columns.index(self.column)])

    def translation(self, language: str) -> str:
        """What it is in another language; empty: it is not translated."""
        found = self.table.translations.get(language, {}).get(self.column)
        return _on_one_line(found.values[self.row]) if found is not None else ""


def _on_one_line(value: object) -> str:
    return " ".join(value.split()) if isinstance(value, str) else ""


def table_texts(tables: Mapping[str, Table], spoken: Iterable[SpokenText]) -> Iterator[TableText]:
    """The texts of all columns that are translated, those without a letter or a number left out.

    :param spoken: the texts of the acts, which can name columns.
    """
    said = set(_columns_said(spoken))
    for table in tables.values():
        translated = {column for columns in table.translations.values() for column in columns}
        for at, column in enumerate(table.columns):
            if column in translated or (table.name, column) in said:
                for number, row in enumerate(table.rows):
                    value = row[at]
                    if isinstance(value, str) and any(character.isalnum() for character in value):
                        yield TableText(table, number, column)


def _columns_said(texts: Iterable[SpokenText]) -> Iterator[tuple[str, str]]:
    """The columns that texts of acts name, each with its table."""
    for text in texts:
        for slot in text.template.slots:
            match slot.part.root if slot.part is not None else None:
                case Part(Key(name), (_, str(column) | Literal(str(column)))):
                    yield name, column


def missing_sentences(texts: Iterable[TableText], language: str) -> Iterator[tuple[SourceLocation, str]]:
    """A place and a sentence for each column of which something is not translated."""
    missing: dict[tuple[str, str], list[TableText]] = {}
    for text in texts:
        if not text.translation(language):
            missing.setdefault((text.table.name, text.column), []).append(text)
    for (name, column), found in missing.items():
        table = found[0].table
        given = table.translations.get(language, {}).get(column)
        if given is None:
            what = f"the table `{name}` is not translated into `{language}`: it has no column `{column}.{language}`"
            yield table.location, f"{what} beside `{column}`, which is spoken"
            continue
        rows = ", ".join(f"{each.row + 1} (“{each.text[:30]}”)" for each in found[:_LISTED])
        more = ", ..." if len(found) > _LISTED else ""
        word = "row" if len(found) == 1 else "rows"
        yield given.location, f"the table `{name}` has no `{column}.{language}` in {word} {rows}{more}"
