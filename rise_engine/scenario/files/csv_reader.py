"""Reads files of comma-separated values, as spreadsheets write them, into rows with places.

Python's csv module reads the values. It does not give their places, so this module finds the places to report.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence

from msgspec import Struct

from rise_engine.base.text import match_end
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import SourceFile

MAX_COLUMNS = 200
MAX_CHARACTERS = 10_000
"""Maximum characters of a value."""
TOO_LONG = f"a value has more than {MAX_CHARACTERS:,} characters; is a quotation mark never closed?"
SEPARATORS = (",", ";", "\t")
SHOWN = {",": "comma", ";": "semicolon", "\t": "tab", "|": "vertical line"}
"""The names of the separators."""
_EXCEL_FIRST_LINE = re.compile(r"sep=(.)\r?\n")
_TO_SEPARATOR = re.compile(r'"(?:[^"]|"")*"?|[^"]')
_BLANKS = re.compile(" *")


class TableRecord(Struct, frozen=True):
    """One row of a table: one line, or several if a value contains line ends."""

    start: int
    """Its offset in the file."""
    end: int
    values: list[str]
    """Without surrounding blanks."""


class CsvReader:
    """Reads the header and the rows of one file, and reports errors."""

    code = "table-form"
    """The code of diagnostics about the file's form."""

    def __init__(self, source: SourceFile, diagnostics: Diagnostics, separator: str = "") -> None:
        """
        :param source: the file.
        :param diagnostics: gets the diagnostics.
        :param separator: the separator of values; empty: the one in the header.
        """
        self.source = source
        self.diagnostics = diagnostics
        self.given_separator = separator
        self.separator = separator or ","
        self.most_columns = MAX_COLUMNS
        self.problems = 0

    def has_problems(self) -> bool:
        return self.problems > 0

    def report(self, offset: int, message: str) -> None:
        self.problems += 1
        self.diagnostics.error(self.code, self.source.location(offset), message)

    def find_separator(self) -> int:
        """Find the separator of values. Returns the offset of the first row."""
        text = self.source.text
        excel = _EXCEL_FIRST_LINE.match(text)
        if excel is not None:
            self.separator = self.given_separator or excel.group(1)
        elif not self.given_separator:
            end = text.find("\n")
            line = text[: end if end >= 0 else len(text)]
            pieces = (found.group() for found in _TO_SEPARATOR.finditer(line))
            self.separator = next((piece for piece in pieces if piece in SEPARATORS), ",")
        return excel.end() if excel is not None else 0

    def read_records(self, start: int) -> Iterator[TableRecord]:
        """Yield the rows that have a value, including the header."""
        lines = self.source.text[start:].split("\n")
        ends = [start]
        for line in lines:
            ends.append(ends[-1] + len(line) + 1)
        reader = csv.reader(
            (f"{line}\n" for line in lines), delimiter=self.separator, skipinitialspace=True, strict=True
        )
        while True:
            first = reader.line_num
            try:
                values = next(reader, None)
            except csv.Error as error:
                self.report_syntax(error, ends[first], ends[reader.line_num])
                return
            if values is None:
                return
            values = [value.strip().replace("\r\n", "\n") for value in values]
            if any(values):
                yield TableRecord(ends[first], ends[reader.line_num], values)

    def report_syntax(self, error: csv.Error, start: int, end: int) -> None:
        """Report a value that the csv module could not read."""
        text = self.source.text[start:end]
        shown = SHOWN.get(self.separator, f"`{self.separator}`")
        if "new-line" in str(error):
            message = "a carriage return alone ends no line; save the file with the line ends of Windows or Unix"
            self.report(start + max(0, text.find("\r")), message)
        elif "limit" in str(error):
            # The limit applies to the whole process. If another library has raised it, the value is read, and the
            # reader of the columns reports it in the same words.
            self.report(start, TOO_LONG)
        else:
            starts, bad = find_values(text, self.separator)
            if bad is not None:
                message = (
                    f"a closing quotation mark is followed by a {shown} or the end of the line; within a value in "
                    'quotation marks, a quotation mark is written twice: ""'
                )
                self.report(start + bad, message)
            else:
                self.report(start + starts[-1], "this quotation mark is never closed")

    def value_at(self, row: TableRecord, at: int) -> int:
        """The offset in the file of the value of a column, or of the row's last value if the row is too short."""
        starts, _ = find_values(self.source.text[row.start : row.end], self.separator)
        return row.start + starts[min(at, len(starts) - 1)]

    def read_header(self, header: TableRecord, rows: Sequence[TableRecord]) -> list[str]:
        """The names of the used columns."""
        names = header.values
        used = _count_used(names)
        for row in rows:  # Excel leaves a column without name and values where one was deleted
            used = max(used, _count_used(row.values[: len(names)]))
        if used > self.most_columns:
            self.report(header.start, f"a table has at most {self.most_columns} columns; this one has {used}")
            return names[:used]
        first: dict[str, int] = {}
        for at, name in enumerate(names[:used]):
            if not name:
                self.report(self.value_at(header, at), f"column {at + 1} has values and no name")
            elif name in first:
                self.report(self.value_at(header, at), f"column {first[name] + 1} is called `{name}` already")
            first.setdefault(name, at)
        return names[:used]

    def check_length(self, row: TableRecord, count: int) -> bool:
        """Whether a row has a value for each column, and no more."""
        values = row.values
        beside = next((at for at in range(count, len(values)) if values[at]), None)
        if beside is not None:
            message = (
                f"this row has a value more than the header has names ({count}); a value with a "
                f"{SHOWN.get(self.separator, self.separator)} in it needs quotation marks"
            )
            self.report(self.value_at(row, beside), message)
            return False
        if len(values) < count:
            end = row.start + len(self.source.text[row.start : row.end].rstrip("\r\n"))
            self.report(end, f"this row has {len(values)} values, and the header {count} names")
            return False
        return True


def _count_used(values: Sequence[str]) -> int:
    """The number of values up to the last one that is not empty."""
    return next((at + 1 for at in range(len(values) - 1, -1, -1) if values[at]), 0)


def find_values(text: str, separator: str) -> tuple[list[int], int | None]:
    """The offsets of the values of one row in its text, and the offset of the first error, or None."""
    starts: list[int] = []
    at = line_end = 0
    while True:
        at = match_end(_BLANKS, text, at)
        starts.append(at)
        if text.startswith('"', at):
            at = _closing_quote(text, at + 1)
            if at < 0:
                return starts, None
            if text[at : at + 1] not in ("", "\r", "\n", separator):
                return starts, at
        else:
            if line_end <= at:
                line_end = text.find("\n", at)
                line_end = line_end if line_end >= 0 else len(text)
            found = text.find(separator, at, line_end)
            at = found if found >= 0 else line_end
        if text[at : at + 1] != separator:
            return starts, None
        at += 1


def find_spans(text: str, separator: str) -> list[tuple[int, int]]:
    """The ranges of the values of one correct row in its text: with quotation marks, without blanks."""
    starts, _ = find_values(text, separator)
    spans = []
    for start, following in zip(starts, [*starts[1:], None], strict=True):
        if text.startswith('"', start):
            spans.append((start, _closing_quote(text, start + 1)))
            continue
        end = len(text) if following is None else following
        written = text[start:end]
        if following is not None:
            written = written[: written.rindex(separator)]
        spans.append((start, start + len(written.rstrip())))
    return spans


def _closing_quote(text: str, at: int) -> int:
    """The offset after the quotation mark that closes a value; -1: there is none."""
    while (at := text.find('"', at)) >= 0 and text.startswith('"', at + 1):
        at += 2
    return at + 1 if at >= 0 else -1
