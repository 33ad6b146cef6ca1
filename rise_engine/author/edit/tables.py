"""Edits of tables, `tables/NAME.csv`: a cell, a new row or column, a removed row. Separators, quotes, line ends stay.

A study's `participants.csv` is also a table, named after its file. Recorded participants keep their row and name.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msgspec import Struct

from rise_engine.author.edit.edits import AddColumn, AddRow, Edit, RemoveRow, SetCell
from rise_engine.author.edit.plan import EditedText, EditRefused, Files, Plan, StudyState
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.base.text import pluralize
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.csv_reader import MAX_COLUMNS, CsvReader, TableRecord, find_spans
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.files.study_paths import PARTICIPANTS_FILE, STUDY_FILE
from rise_engine.scenario.files.toml_files import TomlFile, TomlTable, read_toml
from rise_engine.scenario.reading.tables import TABLES_FOLDER, TableSettings
from rise_engine.syntax.changes import TextEdit, changed_text

_LOG_FILE = "study.jsonl"
_SHOWN = 60


class _WrittenTable(Struct):
    """The written form of a table."""

    file: EditedText
    encoding: str
    separator: str
    columns: list[str]
    header: TableRecord
    rows: list[TableRecord]

    @property
    def newline(self) -> str:
        return "\r\n" if "\r\n" in self.file.text else "\n"

    def column(self, name: str) -> int:
        """Return the index of a column. :raises EditRefused: there is none of this name."""
        if name not in self.columns:
            near = did_you_mean(name, self.columns)
            raise EditRefused(f"{self.file.name} has no column `{name}`{near}")
        return self.columns.index(name)

    def row(self, number: int) -> TableRecord:
        """Return a row by its index. :raises EditRefused: there is no such row."""
        if not 0 <= number < len(self.rows):
            raise EditRefused(f"{self.file.name} has {pluralize(len(self.rows), 'row')}; there is no row {number + 1}")
        return self.rows[number]

    def write(self, value: str, *, quoted: bool = False) -> str:
        """Return a value in the form between separators."""
        odd = any(each in value for each in (self.separator, '"', "\n", "\r")) or value != value.strip()
        return '"' + value.replace('"', '""') + '"' if quoted or odd else value


class WrittenCells(Struct, frozen=True):
    """The cells of a table in their written form."""

    file: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    lines: tuple[int, ...]
    """The first line of each row in the file, from 1."""


def written_cells(files: Files, name: str) -> WrittenCells:
    """Read the written form of a table. :raises EditRefused: there is none of this name, or it is unreadable."""
    table = _read(name, files)
    width = len(table.columns)
    lines = tuple(table.file.line(row.start) for row in table.rows)
    return WrittenCells(
        table.file.name, tuple(table.columns), tuple(tuple(row.values[:width]) for row in table.rows), lines
    )


def table_names(files: Files) -> tuple[str, ...]:
    """List all tables of a study by name, including unreadable ones."""
    return tuple(sorted(_table_files(files)))


def _table_files(files: Files) -> dict[str, str]:
    """Return the file of each table, by its name."""
    own = [file for file in files if file.startswith(f"{TABLES_FOLDER}/") and file.lower().endswith(".csv")]
    found = {file[len(TABLES_FOLDER) + 1 : -4]: file for file in own}
    return found | ({PARTICIPANTS_FILE: PARTICIPANTS_FILE} if {PARTICIPANTS_FILE, STUDY_FILE} <= files.keys() else {})


def plan_set_cell(edit: SetCell, study: StudyState) -> Plan:
    """Plan a value of a table. :raises EditRefused: its table, row or column is unknown, or the row would be empty."""
    table = _read(edit.table, study.files)
    at, row = table.column(edit.column), table.row(edit.row)
    value = _value(edit.value)
    if edit.table == PARTICIPANTS_FILE and edit.column == "participant" and value != row.values[at]:
        _refuse_known(row.values[at], study.files)
    _check_row([*row.values[:at], value, *row.values[at + 1 :]], table)
    start, end = find_spans(table.file.text[row.start : row.end], table.separator)[at]
    start, end = start + row.start, end + row.start
    text = table.file.text
    written = table.write(value, quoted=text.startswith('"', start, end))
    while written.startswith('"') and text[end : end + 1].strip("\r\n" + table.separator).isspace():
        end += 1  # no blank may follow a quotation mark
    change = TextEdit(start, end, written)
    values = [list(each.values) for each in table.rows]
    values[edit.row][at] = value
    old = row.values[at]
    says = f"{_name(edit.table, edit.row, row)}: {edit.column} is “{_short(value)}” (was “{_short(old)}”)"
    return _plan(table, [change] if value != old else [], values, says)


def plan_add_row(edit: AddRow, study: StudyState) -> Plan:
    """Plan a new row, empty where no value is given. :raises EditRefused: a column is unknown, or all are empty."""
    table = _read(edit.table, study.files)
    given = {table.column(name): _value(value) for name, value in edit.values.items()}
    values = [given.get(at, "") for at in range(len(table.columns))]
    _check_row(values, table)
    number = len(table.rows) if edit.at is None else edit.at
    if not 0 <= number <= len(table.rows):
        raise EditRefused(f"{table.file.name} has {pluralize(len(table.rows), 'row')}; a row cannot be inserted there")
    before = table.rows[number - 1] if number else table.header
    end = len(table.file.text[: before.end].rstrip("\r\n"))
    extra = [""] * (len(before.values) - len(table.columns))  # columns without name that Excel leaves at the end
    line = table.separator.join(table.write(value) for value in (*values, *extra))
    rows = [list(each.values) for each in table.rows]
    rows.insert(number, values)
    says = f"{edit.table} has a new row {number + 1}: {_short(', '.join(filter(None, values)))}"
    return _plan(table, [TextEdit(end, end, table.newline + line)], rows, says)


def plan_remove_row(edit: RemoveRow, study: StudyState) -> Plan:
    """Plan a row's removal. :raises EditRefused: there is no such table or row."""
    table = _read(edit.table, study.files)
    row = table.row(edit.row)
    if edit.table == PARTICIPANTS_FILE:
        _refuse_known(row.values[table.column("participant")], study.files)
    text = table.file.text
    start, end = row.start, min(row.end, len(text))
    if not text.endswith("\n", start, end):  # the file's last line has no line end: remove the one before it
        start = len(text[:start].rstrip("\r\n"))
    rows = [list(each.values) for each in table.rows]
    del rows[edit.row]
    says = f"{_name(edit.table, edit.row, row)} is removed: {_short(', '.join(filter(None, row.values)))}"
    return _plan(table, [TextEdit(start, end, "")], rows, says)


def plan_add_column(edit: AddColumn, study: StudyState) -> Plan:
    """Plan a new column, empty in all rows. :raises EditRefused: there is no such table, or the name is taken."""
    table = _read(edit.table, study.files)
    name, count = _value(edit.column), len(table.columns)
    if not name or "\n" in name:
        raise EditRefused("a column has a name, on one line")
    if name in table.columns:
        raise EditRefused(f"{table.file.name} has a column `{name}` already")
    if count >= MAX_COLUMNS:
        raise EditRefused(f"a table has at most {MAX_COLUMNS} columns")
    at = count if edit.at is None else edit.at
    if not 0 <= at <= count:
        raise EditRefused(f"{table.file.name} has {pluralize(count, 'column')}; a column cannot be inserted there")
    changes, rows = [], []
    for record in (table.header, *table.rows):
        spans = find_spans(table.file.text[record.start : record.end], table.separator)
        written = table.write(name) if record is table.header else ""
        place = record.start + (spans[at][0] if at < count else spans[count - 1][1])
        pieces = (written, table.separator) if at < count else (table.separator, written)
        changes.append(TextEdit(place, place, "".join(pieces)))
        rows.append([*record.values[:at], name if record is table.header else "", *record.values[at:]])
    columns, *values = rows
    return _plan(table, changes, values, f"{edit.table} has a new column {name}", columns[: count + 1])


def _refuse_known(participant: str, files: Files) -> None:
    """Refuse a change of a participant's name or row. :raises EditRefused: a recording names the participant."""
    if participant and f'"{participant}"'.encode() in files.get(_LOG_FILE, b""):
        raise EditRefused(
            f"{participant} is already in {_LOG_FILE}, so the line and the name stay; "
            "write `excluded` into `status` if they do not count"
        )


def _plan(
    table: _WrittenTable, edits: list[TextEdit], rows: list[list[str]], says: str, columns: list[str] | None = None
) -> Plan:
    """Check the result and make the plan. :raises EditRefused: the file would not have these columns and rows."""
    text = changed_text(table.file.text, edits)
    after = _records(table.file.name, text, table.separator)
    columns = table.columns if columns is None else columns
    width = len(columns)
    wanted = [columns, *(row[:width] for row in rows)]
    if after is None or [row.values[:width] for row in after[1]] != wanted:
        raise EditRefused(f"{table.file.name} is written in a way that cannot be changed here; use a spreadsheet")
    if table.encoding == "utf-8":
        return Plan(splices=table.file.splices(edits), says=(says,))
    try:
        return Plan(written={table.file.name: text.encode(table.encoding)}, says=(says,))
    except UnicodeEncodeError as error:
        character = error.object[error.start]
        raise EditRefused(f"{table.file.name} is {table.encoding.upper()}, which has no `{character}`") from None


def _read(name: str, files: Files) -> _WrittenTable:
    """Read a table. :raises EditRefused: it does not exist, or its form is wrong."""
    known = _table_files(files)
    file = known.get(name)
    if file is None:
        near = did_you_mean(name, known)
        raise EditRefused(f"there is no table `{name}`{near}" if known else f"this study has no table `{name}`")
    settings = _settings(f"{file[:-4]}.toml", files)
    text = EditedText(file, files[file], settings.encoding)
    found = _records(file, text.text, settings.separator)
    if found is None or not found[1]:
        raise EditRefused(f"{file} cannot be read as a table; `rise-engine check` says why")
    reader, (header, *rows) = found
    columns = reader.read_header(header, rows)
    if reader.has_problems() or not all(reader.check_length(row, len(columns)) for row in rows):
        raise EditRefused(f"{file} cannot be read as a table; `rise-engine check` says why")
    return _WrittenTable(text, settings.encoding, reader.separator, columns, header, rows)


def _settings(file: str, files: Files) -> TableSettings:
    source = SourceFile(file, b"", files.get(file, b"").decode("utf-8-sig", "replace"))
    found = read_toml(source, Diagnostics()) or TomlFile(source, {})
    return TableSettings(TomlTable(found, (), found.values, Diagnostics()))


def _records(file: str, text: str, separator: str) -> tuple[CsvReader, list[TableRecord]] | None:
    reader = CsvReader(SourceFile(file, b"", text), Diagnostics(), separator)
    records = list(reader.read_records(reader.find_separator()))
    return None if reader.has_problems() else (reader, records)


def _value(written: str) -> str:
    """Normalise a value: without surrounding blanks, and with a table's line ends."""
    return written.strip().replace("\r\n", "\n").replace("\r", "\n")


def _check_row(values: list[str], table: _WrittenTable) -> None:
    if not any(values):
        raise EditRefused(f"a row of {table.file.name} without any value would not be read; remove the row instead")


def _name(table: str, number: int, row: TableRecord) -> str:
    first = f" ({_short(row.values[0])})" if row.values and row.values[0] else ""
    return f"{table}, row {number + 1}{first}"


def _short(text: str) -> str:
    text = " ".join(text.split())
    return text if len(text) <= _SHOWN else f"{text[: _SHOWN - 1]}…"


PLANNERS: dict[type[Edit], Callable[[Any, StudyState], Plan]] = {
    SetCell: plan_set_cell,
    AddRow: plan_add_row,
    RemoveRow: plan_remove_row,
    AddColumn: plan_add_column,
}
