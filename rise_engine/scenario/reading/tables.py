"""Reads the tables of a scenario, `tables/*.csv` (docs/reference/scenario.md, "Tables").

Each table is read-only memory: a list of objects, one per row. `tables/NAME.toml` has its settings and the types of its
columns.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

from msgspec import Struct

from rise_engine.base.json_codec import is_64_bit
from rise_engine.base.nearest_name import did_you_mean, suggest
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.csv_reader import MAX_CHARACTERS, SHOWN, TOO_LONG, CsvReader, TableRecord
from rise_engine.scenario.files.source_files import MAX_TOML_BYTES, FileReader, SourceFile
from rise_engine.scenario.files.toml_files import TomlFile, TomlTable, read_toml
from rise_engine.scenario.model import Json, SourceLocation, Table, TranslatedColumn
from rise_engine.scenario.reading.memory import is_writable_key
from rise_engine.scenario.speech.languages import language_problem, meant_language

ColumnType: TypeAlias = Literal["text", "number", "bool"]
DecimalMark: TypeAlias = Literal[".", ","]

_WHOLE = re.compile(r"[-+]?(?:0|[1-9][0-9]{0,18})")
_DIGITS = re.compile(r"[-+]?[0-9]+")
_NUMBER = {
    mark: re.compile(
        rf"[-+]?(?:(?:0|[1-9][0-9]*)(?:{re.escape(mark)}[0-9]*)?|{re.escape(mark)}[0-9]+)(?:[eE][-+]?[0-9]+)?"
    )
    for mark in (".", ",")
}
"""Without leading zeros: `007` is a code that needs its zeros."""
_TRUTH = {"true": True, "false": False}


def guess_type(texts: Sequence[str], decimal: DecimalMark) -> ColumnType:
    """The type of a column: number or bool if all values except empty ones are; else text."""
    for kind in ("number", "bool"):
        if any(texts) and all(convert_value(text, kind, decimal) is not None for text in texts if text):
            return kind
    return "text"


def convert_value(text: str, kind: ColumnType, decimal: DecimalMark) -> Json:
    """The value of a text in a column of this type; null for an empty or an invalid text."""
    if not text or kind == "text":
        return text or None
    if kind == "bool":
        return _TRUTH.get(text.lower())
    if _WHOLE.fullmatch(text) and is_64_bit(int(text)):
        return int(text)
    if _NUMBER[decimal].fullmatch(text) and not _DIGITS.fullmatch(text):
        number = float(text.replace(",", "."))
        return number if math.isfinite(number) else None
    return None


def has_comma_numbers(texts: Sequence[str]) -> bool:
    """Whether a column would be numeric if the comma were its decimal mark."""
    return any("," in text for text in texts) and guess_type(texts, ",") == "number"


# --- settings ---------------------------------------------------------------------------------------------------------


_KEYS = ("separator", "decimal", "encoding", "types")
SEPARATORS = (",", ";", "\t", "|")
ENCODINGS = ("utf-8", "cp1252")


class TableSettings:
    """The settings of one table; defaults without a file."""

    def __init__(self, table: TomlTable) -> None:
        table.report_unknown_keys(_KEYS)
        self._table = table
        self.separator: str = self._read_choice("separator", SEPARATORS, "", '`separator` is ",", ";", "\\t" or "|"')
        """The separator of values; empty: the one in the header."""
        self.decimal: DecimalMark = self._read_choice("decimal", (".", ","), ".", '`decimal` is "." or ","')
        self.encoding: str = self._read_choice("encoding", ENCODINGS, "utf-8", '`encoding` is "utf-8" or "cp1252"')
        self.types: dict[str, ColumnType] = {}
        """By column; others are guessed."""
        types = table.section("types")
        for column, kind in types.values.items():
            if kind in get_args(ColumnType):
                self.types[column] = kind
            else:
                types.report_value("wrong-value", column, f'`{column}` is "text", "number" or "bool"')

    def _read_choice(self, key: str, known: Sequence[str], usual: str, message: str) -> Any:
        value = self._table.values.get(key, usual)
        if value in known or value == usual:
            return value
        self._table.report_value("wrong-value", key, message)
        return usual

    def check_columns(self, columns: Sequence[str], diagnostics: Diagnostics) -> None:
        """Report types for missing columns."""
        types = TomlTable(self._table.file, (), self._table.values, diagnostics).section("types")
        for column in types.values:
            if column not in columns:
                message, near = f"the table has no column `{column}`", suggest(column, columns)
                types.report_key("unknown-key", message, column, suggestion=near)


def read_table_settings(path: Path, files: FileReader, diagnostics: Diagnostics) -> TableSettings:
    """Read the settings in a file, or the defaults if there is none; with errors, the valid part."""
    name = files.display_name(path)
    source = files.read(path, MAX_TOML_BYTES) if files.tree.exists(path) else None
    return files.memo.read(("table settings", name, source), diagnostics, partial(_make, name, source))


def _make(name: str, source: SourceFile | None, diagnostics: Diagnostics) -> TableSettings:
    file = read_toml(source, diagnostics) if source is not None else None
    file = file or TomlFile(SourceFile(name, b"", ""), {})
    return TableSettings(TomlTable(file, (), file.values, diagnostics))


TABLES_FOLDER = "tables"
MAX_TABLE_BYTES = 2_000_000
MAX_ROWS = 10_000
_KINDS: dict[ColumnType, str] = {"text": "a text", "number": "a number", "bool": "true or false"}


class ScenarioLanguages(Struct, frozen=True):
    """The languages that columns of tables can have."""

    own: str = ""
    """The language of the acts; empty: unknown."""
    others: tuple[str, ...] = ()
    """The languages into which the study is translated."""


_ONE_LANGUAGE = ScenarioLanguages()


def read_tables(
    files: FileReader,
    draft: ScenarioDraft,
    diagnostics: Diagnostics,
    languages: ScenarioLanguages = _ONE_LANGUAGE,
) -> None:
    """Read every table of a scenario into `draft`, in the order of their names.

    :param languages: a column `text.de` is a translation of the column `text` if `de` is one of these.
    """
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
            _read_table(path, files, draft, diagnostics, languages)
        elif path.suffix == ".toml" and path.stem not in names:
            location = SourceLocation(files.display_name(path))
            message = f"there is no table `{path.stem}.csv` beside this file{did_you_mean(path.stem, names)}"
            diagnostics.error("table-form", location, message)


def _read_table(
    path: Path, files: FileReader, draft: ScenarioDraft, diagnostics: Diagnostics, languages: ScenarioLanguages
) -> None:
    name = path.stem
    location = SourceLocation(files.display_name(path))
    settings = read_table_settings(path.with_suffix(".toml"), files, diagnostics)
    source = files.read(path, MAX_TABLE_BYTES, settings.encoding, _ENCODING_REMEDY.format(name=name))
    if not is_writable_key(name) or "." in name:
        message = f"a table's name has letters, digits and `_`, and begins with a letter, not `{name}`"
        base, _, tag = name.rpartition(".")
        if base and not language_problem(tag):
            message = f"a table has no file of its own in another language; put its `{tag}` into tables/{base}.csv, in "
            message += f"columns such as `text.{tag}` beside `text`"
        diagnostics.error("bad-name", location, message)
        source = None
    elif name in draft.tables:  # items.csv and items.CSV
        diagnostics.error("duplicate-name", location, f"there is another table `{name}`")
        source = None
    table = None
    if source is not None:
        key = ("table", source, name, settings, languages)
        table = files.memo.read_part(key, draft, diagnostics, partial(_read_rows, source, name, settings, languages))
    if table is None:
        draft.unreadable_parts.add("tables")
    else:
        draft.tables[name] = table
        draft.memory_key_locations[name] = table.location


def _read_rows(
    source: SourceFile,
    name: str,
    settings: TableSettings,
    languages: ScenarioLanguages,
    draft: ScenarioDraft,
    diagnostics: Diagnostics,
) -> Table | None:
    return _TableReader(source, name, settings, languages, draft, diagnostics).read()


_ENCODING_REMEDY = (
    'in Excel, save it as `CSV UTF-8`, or write encoding = "cp1252" into tables/{name}.toml if it is Windows-1252'
)


class _TableReader(CsvReader):
    def __init__(
        self,
        source: SourceFile,
        name: str,
        settings: TableSettings,
        languages: ScenarioLanguages,
        draft: ScenarioDraft,
        diagnostics: Diagnostics,
    ) -> None:
        super().__init__(source, diagnostics, settings.separator)
        self.name = name
        self.draft = draft
        self.settings = settings
        self.languages = languages

    def read(self) -> Table | None:
        """Read the table; None after diagnostics."""
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
        translated = self.find_translations(header, columns)
        if self.has_problems():
            return None
        kinds = {name: self.find_type(name, at, rows) for at, name in enumerate(columns) if at not in translated}
        for at, name in enumerate(columns):
            base, _, tag = name.rpartition(".")
            if at not in translated and kinds.get(base) == "text" and (language := meant_language(tag)):
                self.report_other_language(header, at, name, language)
        by_column = {
            name: self.read_column(name, at, rows, kinds[name])
            for at, name in enumerate(columns)
            if at not in translated
        }
        translations: dict[str, dict[str, TranslatedColumn]] = {}
        for at, (base, language) in translated.items():
            values = self.read_column(columns[at], at, rows, kinds[base])
            column = self.compare(TranslatedColumn(values), by_column[base], base, at, [header, *rows])
            translations.setdefault(language, {})[base] = column
        if self.has_problems():
            return None
        found = [list(row) for row in zip(*by_column.values(), strict=True)]
        return Table(self.name, tuple(by_column), found, self.source.location(start), translations)

    def find_translations(self, header: TableRecord, columns: Sequence[str]) -> Mapping[int, tuple[str, str]]:
        """The columns that are translations, each with its original column and its language."""
        known, names = {each.lower(): each for each in self.languages.others}, set(columns)
        found: dict[int, tuple[str, str]] = {}
        for at, name in enumerate(columns):
            base, _, tag = name.rpartition(".")
            language, is_beside = known.get(tag.lower(), ""), base in names
            if language and not is_beside and base:
                near = (
                    did_you_mean(base, [each for each in columns if each != name])
                    or "; give it the name of the column that it translates"
                )
                message = f"`{name}` is in the language `{language}`, but there is no column `{base}`{near}"
                self.report(self.value_at(header, at), message)
            elif language and is_beside and (base, language) in found.values():
                self.report(self.value_at(header, at), f"another column has `{base}` in the language `{language}`")
            elif language and is_beside:
                found[at] = (base, language)
        return found

    def report_other_language(self, header: TableRecord, at: int, name: str, language: str) -> None:
        """Warn of a column that is named like a translation into an unknown language."""
        location = self.source.location(self.value_at(header, at))
        base, _, tag = name.rpartition(".")
        if language.lower() == self.languages.own.lower():
            message = f"the column `{base}` is in `{language}` itself; `{name}` is read as a column of its own"
        elif tag.lower() == language.lower():
            message = f"the study has no language `{language}`, so `{name}` is read as a column of its own; if it "
            message += f'translates `{base}`, add "{language}" to `also` under [languages] in scenario.toml'
        else:
            message = f"`{name}` is read as a column of its own; if it translates `{base}`, call it `{base}.{language}`"
        self.draft.memory_key_locations[f"{self.name}.{name}"] = location
        self.diagnostics.warning("language-column", location, message)

    def compare(
        self, found: TranslatedColumn, texts: Sequence[Json], base: str, at: int, records: Sequence[TableRecord]
    ) -> TranslatedColumn:
        """Add the place of a column, and report values that translate nothing."""
        header, *rows = records
        missing = self.value_at(header, at)
        for row, text, value in reversed([*zip(rows, texts, found.values, strict=True)]):
            if text is None and value is not None:
                self.report_value(self.value_at(row, at), f"this row has nothing in `{base}` that this could translate")
            missing = self.value_at(row, at) if value is None and text is not None else missing
        return TranslatedColumn(found.values, self.source.location(missing))

    def read_header(self, header: TableRecord, rows: Sequence[TableRecord]) -> list[str]:
        """The names of the used columns."""
        names = super().read_header(header, rows)
        if len(names) == 1 and (other := next((each for each in SEPARATORS if each in names[0]), None)):
            message = (
                f"there is one column only; if a {SHOWN[other]} separates the values, write "
                f"separator = {_quote(other)} into tables/{self.name}.toml"
            )
            self.report(header.start, message)
        return names

    def report_value(self, offset: int, message: str) -> None:
        self.problems += 1
        self.diagnostics.error("table-value", self.source.location(offset), message)

    def find_type(self, name: str, at: int, rows: Sequence[TableRecord]) -> ColumnType:
        """The type of a column: from the settings, or else from its values."""
        settings = self.settings
        texts = [row.values[at] for row in rows]
        kind = settings.types.get(name)
        if kind is None:
            kind = guess_type(texts, settings.decimal)
            if kind == "text" and settings.decimal == "." and has_comma_numbers(texts):
                self.warn_of_commas(name, at, rows)
        return kind

    def read_column(self, name: str, at: int, rows: Sequence[TableRecord], kind: ColumnType) -> list[Json]:
        """The values of one column, all of one type; null for an empty one."""
        settings = self.settings
        texts = [row.values[at] for row in rows]
        values: list[Json] = []
        for row, text in zip(rows, texts, strict=True):
            if len(text) > MAX_CHARACTERS:
                self.report(self.value_at(row, at), TOO_LONG)
            value = convert_value(text, kind, settings.decimal)
            if value is None and text:
                message = f"`{name}` is {_KINDS[kind]}, and this is not: `{text[:40]}`"
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
