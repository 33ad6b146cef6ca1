"""Reading the tables of a scenario, `tables/*.csv` (docs/reference/scenario.md, "Tables").

Each is read-only memory: a list of objects, one for each row. Python's csv module reads the values; what it cannot say
is where they stand, which is found again here when there is something to say about one.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from msgspec import Struct

from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.memory import is_writable_key
from rise_engine.scenario.model import Json, SourceLocation, Table
from rise_engine.scenario.source_files import FileReader, SourceFile
from rise_engine.scenario.table_settings import TableSettings, read_table_settings
from rise_engine.scenario.table_values import ColumnType, convert_value, guess_type, has_comma_numbers
from rise_engine.text import match_end

TABLES_FOLDER = "tables"
MAX_TABLE_BYTES = 2_000_000
MAX_ROWS = 10_000
MAX_COLUMNS = 200
MAX_CHARACTERS = 10_000
"""Of one value."""
SEPARATORS = (",", ";", "\t")
_KINDS: dict[ColumnType, str] = {"text": "a text", "number": "a number", "bool": "true or false"}
_SHOWN = {",": "comma", ";": "semicolon", "\t": "tab", "|": "vertical line"}
_EXCEL_FIRST_LINE = re.compile(r"sep=(.)\r?\n")
_TO_SEPARATOR = re.compile(r'"(?:[^"]|"")*"?|[^"]')
_BLANKS = re.compile(" *")


class TableRecord(Struct, frozen=True):
    """One line of a table, or several when a value goes over their ends."""

    start: int
    """Its offset in the file."""
    end: int
    values: list[str]
    """Without blanks around them."""


def read_tables(files: FileReader, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Read every table of a scenario into `draft`, in the order of their names."""
    folder = files.folder / TABLES_FOLDER
    try:
        paths = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except (FileNotFoundError, NotADirectoryError):
        return
    except OSError as error:
        message = f"this folder cannot be read: {error.strerror or error}"
        diagnostics.error("unreadable", SourceLocation(TABLES_FOLDER), message)
        draft.unreadable_parts.add("tables")
        return
    names = {path.stem for path in paths if path.suffix.lower() == ".csv"}
    for path in paths:
        if path.suffix.lower() == ".csv":
            _read_table(path, files, draft, diagnostics)
        elif path.suffix == ".toml" and path.stem not in names:
            location = SourceLocation(files.display_name(path))
            message = f"there is no table `{path.stem}.csv` beside this file{did_you_mean(path.stem, names)}"
            diagnostics.error("table-form", location, message)


def _read_table(path: Path, files: FileReader, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    name = path.stem
    location = SourceLocation(files.display_name(path))
    settings = read_table_settings(path.with_suffix(".toml"), files, diagnostics)
    source = files.read(path, MAX_TABLE_BYTES, settings.encoding, _ENCODING_REMEDY.format(name=name))
    if not is_writable_key(name) or "." in name:
        message = f"a table is called as a key is: letters, digits and `_`, beginning with a letter, not `{name}`"
        diagnostics.error("bad-name", location, message)
        source = None
    elif name in draft.tables:  # items.csv and items.CSV
        diagnostics.error("duplicate-name", location, f"there is another table `{name}`")
        source = None
    table = _TableReader(source, name, settings, draft, diagnostics).read() if source is not None else None
    if table is None:
        draft.unreadable_parts.add("tables")
    else:
        draft.tables[name] = table
        draft.memory_key_locations[name] = table.location


_ENCODING_REMEDY = (
    'in Excel, save it as `CSV UTF-8`, or write encoding = "cp1252" into tables/{name}.toml if it is Windows-1252'
)


class _TableReader:
    def __init__(
        self, source: SourceFile, name: str, settings: TableSettings, draft: ScenarioDraft, diagnostics: Diagnostics
    ) -> None:
        self.source = source
        self.name = name
        self.draft = draft
        self.settings = settings
        self.diagnostics = diagnostics
        self.separator = settings.separator or ","
        self.problems = 0

    def read(self) -> Table | None:
        """The table, or None after findings."""
        start = self.find_separator()
        records = list(self.read_records(start))
        if self.has_problems():
            return None
        if not records:
            self.report(start, "this file is empty; its first row has the names of the columns")
            return None
        header, *rows = records
        columns = self.read_header(header, rows)
        if len(rows) > MAX_ROWS:
            self.report(rows[MAX_ROWS].start, f"a table has at most {MAX_ROWS:,} rows")
        rows = [row for row in rows if self.check_length(row, len(columns))]
        self.settings.check_columns(columns)
        if self.has_problems():
            return None
        by_column = [self.read_column(name, at, rows) for at, name in enumerate(columns)]
        if self.has_problems():
            return None
        values = [list(row) for row in zip(*by_column, strict=True)]
        return Table(self.name, tuple(columns), values, self.source.location(start))

    def has_problems(self) -> bool:
        return self.problems > 0

    def report(self, offset: int, message: str) -> None:
        self.problems += 1
        self.diagnostics.error("table-form", self.source.location(offset), message)

    def report_value(self, offset: int, message: str) -> None:
        self.problems += 1
        self.diagnostics.error("table-value", self.source.location(offset), message)

    def find_separator(self) -> int:
        """Find out what stands between the values; returns where the first row begins."""
        text = self.source.text
        excel = _EXCEL_FIRST_LINE.match(text)
        if excel is not None:
            self.separator = self.settings.separator or excel.group(1)
        elif not self.settings.separator:
            end = text.find("\n")
            line = text[: end if end >= 0 else len(text)]
            pieces = (found.group() for found in _TO_SEPARATOR.finditer(line))
            self.separator = next((piece for piece in pieces if piece in SEPARATORS), ",")
        return excel.end() if excel is not None else 0

    def read_records(self, start: int) -> Iterator[TableRecord]:
        """The rows that have a value, the header among them."""
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
        """What the csv module could not read."""
        text = self.source.text[start:end]
        shown = _SHOWN.get(self.separator, f"`{self.separator}`")
        if "new-line" in str(error):
            message = "a carriage return alone ends no line; save the file with the line ends of Windows or Unix"
            self.report(start + max(0, text.find("\r")), message)
        elif "limit" in str(error):
            self.report(
                start, f"a value has more than {MAX_CHARACTERS:,} characters; is a quotation mark never closed?"
            )
        else:
            starts, bad = find_values(text, self.separator)
            if bad is not None:
                message = (
                    f"behind a closing quotation mark stands a {shown} or the end of the line; within a value in "
                    'quotation marks, a quotation mark is written twice: ""'
                )
                self.report(start + bad, message)
            else:
                self.report(start + starts[-1], "this quotation mark is never closed")

    def value_at(self, row: TableRecord, at: int) -> int:
        """Where the value of a column stands in the file; behind the row, when it has none."""
        starts, _ = find_values(self.source.text[row.start : row.end], self.separator)
        return row.start + starts[min(at, len(starts) - 1)]

    def read_header(self, header: TableRecord, rows: Sequence[TableRecord]) -> list[str]:
        names = header.values
        used = _count_used(names)
        for row in rows:  # a column without name and values is what Excel leaves of a deleted one
            used = max(used, _count_used(row.values[: len(names)]))
        if used > MAX_COLUMNS:
            self.report(header.start, f"a table has at most {MAX_COLUMNS} columns; this one has {used}")
            return names[:used]
        first: dict[str, int] = {}
        for at, name in enumerate(names[:used]):
            if not name:
                self.report(self.value_at(header, at), f"column {at + 1} has values and no name")
            elif name in first:
                self.report(self.value_at(header, at), f"column {first[name] + 1} is called `{name}` already")
            first.setdefault(name, at)
        if used == 1 and (other := next((each for each in (*SEPARATORS, "|") if each in names[0]), None)):
            message = (
                f"there is one column only; if a {_SHOWN[other]} stands between the values, write "
                f"separator = {_quote(other)} into tables/{self.name}.toml"
            )
            self.report(header.start, message)
        return names[:used]

    def check_length(self, row: TableRecord, count: int) -> bool:
        """Whether a row has a value for each column, and none beside."""
        values = row.values
        beside = next((at for at in range(count, len(values)) if values[at]), None)
        if beside is not None:
            message = (
                f"this row has a value more than the header has names ({count}); a value with a "
                f"{_SHOWN.get(self.separator, self.separator)} in it stands in quotation marks"
            )
            self.report(self.value_at(row, beside), message)
        elif len(values) < count:
            end = row.start + len(self.source.text[row.start : row.end].rstrip("\r\n"))
            self.report(end, f"this row has {len(values)} values, and the header {count} names")
        return not self.has_problems()

    def read_column(self, name: str, at: int, rows: Sequence[TableRecord]) -> list[Json]:
        """The values of one column, all of one type; null where there is none."""
        settings = self.settings
        texts = [row.values[at] for row in rows]
        kind = settings.types.get(name)
        if kind is None:
            kind = guess_type(texts, settings.decimal)
            if kind == "text" and settings.decimal == "." and has_comma_numbers(texts):
                self.warn_of_commas(name, at, rows)
        values: list[Json] = []
        for row, text in zip(rows, texts, strict=True):
            if len(text) > MAX_CHARACTERS:
                self.report(self.value_at(row, at), f"a value has at most {MAX_CHARACTERS:,} characters")
            value = convert_value(text, kind, settings.decimal)
            if value is None and text:
                message = f"`{name}` is {_KINDS[kind]}, and this is none: `{text[:40]}`"
                self.report_value(self.value_at(row, at), message)
            values.append(value)
        return values

    def warn_of_commas(self, name: str, at: int, rows: Sequence[TableRecord]) -> None:
        row = next(row for row in rows if "," in row.values[at])
        message = (
            f'`{name}` is read as text, because its numbers have a comma; write decimal = "," into '
            f'tables/{self.name}.toml, or types.{name} = "text" if it is meant as text'
        )
        location = self.source.location(self.value_at(row, at))
        self.draft.memory_key_locations[f"{self.name}.{name}"] = location
        self.diagnostics.warning("decimal-comma", location, message)


def _count_used(values: Sequence[str]) -> int:
    """How many there are up to the last one that is not empty."""
    return next((at + 1 for at in range(len(values) - 1, -1, -1) if values[at]), 0)


def find_values(text: str, separator: str) -> tuple[list[int], int | None]:
    """Where the values of one row begin in its text, and where something stands that cannot be there."""
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


def _closing_quote(text: str, at: int) -> int:
    """Behind the quotation mark that closes a value; -1 when there is none."""
    while (at := text.find('"', at)) >= 0 and text.startswith('"', at + 1):
        at += 2
    return at + 1 if at >= 0 else -1


def _quote(separator: str) -> str:
    return '"\\t"' if separator == "\t" else f'"{separator}"'
