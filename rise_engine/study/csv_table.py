"""A table that people may have edited: columns by name, rows with places."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from msgspec import Struct

from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.csv_reader import MAX_COLUMNS, CsvReader, TableRecord
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import SourceLocation
from rise_engine.scenario.source_files import FileReader
from rise_engine.scenario.tree import FileTree, Held

MAX_BYTES, MAX_ROWS = 20_000_000, 200_000
_ENCODING_REMEDY = "in Excel or LibreOffice, save it as `CSV UTF-8`"


class CsvRow(Struct, frozen=True):
    """One row, by the names of the columns."""

    values: dict[str, str]
    record: TableRecord


class CsvTable:
    """The columns and rows of a file. Rows of another length than the header are told and left out."""

    def __init__(self, reader: CsvReader, header: TableRecord, columns: list[str], rows: list[CsvRow]) -> None:
        self.columns = columns
        self.rows = rows
        self.diagnostics = reader.diagnostics
        self._reader = reader
        self._header = header

    def column_location(self, column: str) -> SourceLocation:
        """Where a column's name stands; of one that there is not, where the header does."""
        at = self.columns.index(column) if column in self.columns else 0
        return self._reader.source.location(self._reader.value_at(self._header, at))

    def location(self, row: CsvRow, column: str) -> SourceLocation:
        """Where the value of a column stands in a row."""
        at = self.columns.index(column) if column in self.columns else 0
        return self._reader.source.location(self._reader.value_at(row.record, at))

    def report(self, row: CsvRow, column: str, code: str, message: str) -> None:
        self.diagnostics.error(code, self.location(row, column), message)

    def check_columns(self, needed: Iterable[str], allowed: Iterable[str], remedy: str) -> None:
        """Report columns that are not there, and those that nobody reads.

        :param needed: which there must be.
        :param allowed: which else there can be.
        :param remedy: the end of the sentence about a column that nobody reads.
        """
        needed = list(needed)
        missing = [column for column in needed if column not in self.columns]
        known = [*needed, *allowed]
        for column in self.columns:
            if column not in known:
                near = did_you_mean(column, missing or known, limit=0)
                message = f"unknown column `{column}`{near or remedy}"
                self.diagnostics.error("unknown-column", self.column_location(column), message)
        if missing:
            message = f"the column {in_backquotes(missing)} is missing"
            if len(missing) > 1:
                message = f"the columns {in_backquotes(missing)} are missing"
            self.diagnostics.error("missing-column", self.column_location(""), message)


def read_csv(
    folder: Path, name: str, diagnostics: Diagnostics, held: Held | None = None, *, most_columns: int = MAX_COLUMNS
) -> CsvTable | None:
    """The table in a file of a study, or None after findings.

    Comma, semicolon or tab between the values, with or without byte order mark, with the line ends of Windows or Unix.
    """
    tree = FileTree(folder, held, closed=True)
    source = FileReader(folder, diagnostics, tree).read(folder / name, MAX_BYTES, remedy=_ENCODING_REMEDY)
    if source is None:
        return None
    reader = CsvReader(source, diagnostics)
    reader.most_columns = most_columns
    start = reader.find_separator()
    records = list(reader.read_records(start))
    if reader.has_problems():
        return None
    if not records:
        reader.report(start, "this file is empty; its first row has the names of the columns")
        return None
    header, *rest = records
    columns = reader.read_header(header, rest)
    is_wrong = reader.has_problems()
    if len(rest) > MAX_ROWS:
        reader.report(rest[MAX_ROWS].start, f"there are at most {MAX_ROWS:,} rows")
        return None
    rows = [
        CsvRow(dict(zip(columns, record.values, strict=False)), record)
        for record in rest
        if reader.check_length(record, len(columns))
    ]
    return None if is_wrong else CsvTable(reader, header, columns, rows)
