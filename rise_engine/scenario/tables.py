"""Reading the tables of a scenario, `tables/*.csv` (docs/reference/scenario.md, "Tables").

Each is read-only memory: a list of objects, one for each row.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path

from rise_engine.nearest_name import did_you_mean
from rise_engine.scenario.csv_reader import MAX_CHARACTERS, SEPARATORS, SHOWN, TOO_LONG, CsvReader, TableRecord
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.memory import is_writable_key
from rise_engine.scenario.model import Json, SourceLocation, Table
from rise_engine.scenario.source_files import FileReader, SourceFile
from rise_engine.scenario.table_settings import TableSettings, read_table_settings
from rise_engine.scenario.table_values import ColumnType, convert_value, guess_type, has_comma_numbers

TABLES_FOLDER = "tables"
MAX_TABLE_BYTES = 2_000_000
MAX_ROWS = 10_000
_KINDS: dict[ColumnType, str] = {"text": "a text", "number": "a number", "bool": "true or false"}


def read_tables(files: FileReader, draft: ScenarioDraft, diagnostics: Diagnostics) -> None:
    """Read every table of a scenario into `draft`, in the order of their names."""
    folder = files.folder / TABLES_FOLDER
    try:
        paths = [folder / name for name in files.tree.names(folder) if not name.startswith(".")]
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
    table = None
    if source is not None:
        key = ("table", source, name, settings)
        table = files.memo.read_part(key, draft, diagnostics, partial(_read_rows, source, name, settings))
    if table is None:
        draft.unreadable_parts.add("tables")
    else:
        draft.tables[name] = table
        draft.memory_key_locations[name] = table.location


def _read_rows(
    source: SourceFile, name: str, settings: TableSettings, draft: ScenarioDraft, diagnostics: Diagnostics
) -> Table | None:
    return _TableReader(source, name, settings, draft, diagnostics).read()


_ENCODING_REMEDY = (
    'in Excel, save it as `CSV UTF-8`, or write encoding = "cp1252" into tables/{name}.toml if it is Windows-1252'
)


class _TableReader(CsvReader):
    def __init__(
        self, source: SourceFile, name: str, settings: TableSettings, draft: ScenarioDraft, diagnostics: Diagnostics
    ) -> None:
        super().__init__(source, diagnostics, settings.separator)
        self.name = name
        self.draft = draft
        self.settings = settings

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
        self.settings.check_columns(columns, self.diagnostics)
        if self.has_problems():
            return None
        by_column = [self.read_column(name, at, rows) for at, name in enumerate(columns)]
        if self.has_problems():
            return None
        values = [list(row) for row in zip(*by_column, strict=True)]
        return Table(self.name, tuple(columns), values, self.source.location(start))

    def read_header(self, header: TableRecord, rows: Sequence[TableRecord]) -> list[str]:
        """The names of the columns that are used."""
        names = super().read_header(header, rows)
        if len(names) == 1 and (other := next((each for each in (*SEPARATORS, "|") if each in names[0]), None)):
            message = (
                f"there is one column only; if a {SHOWN[other]} stands between the values, write "
                f"separator = {_quote(other)} into tables/{self.name}.toml"
            )
            self.report(header.start, message)
        return names

    def report_value(self, offset: int, message: str) -> None:
        self.problems += 1
        self.diagnostics.error("table-value", self.source.location(offset), message)

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
                self.report(self.value_at(row, at), TOO_LONG)
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


def _quote(separator: str) -> str:
    return '"\\t"' if separator == "\t" else f'"{separator}"'
