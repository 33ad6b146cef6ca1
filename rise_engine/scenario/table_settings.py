"""What `tables/NAME.toml` says about a table: types of its columns, and how its file is written."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, get_args

from rise_engine.base.nearest_name import suggest
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.source_files import MAX_TOML_BYTES, FileReader, SourceFile
from rise_engine.scenario.table_values import ColumnType, DecimalMark
from rise_engine.scenario.toml_files import TomlFile, read_toml
from rise_engine.scenario.toml_tables import TomlTable

_KEYS = ("separator", "decimal", "encoding", "types")
SEPARATORS = (",", ";", "\t", "|")
ENCODINGS = ("utf-8", "cp1252")


class TableSettings:
    """The settings of one table; without a file, the usual ones."""

    def __init__(self, table: TomlTable) -> None:
        table.report_unknown_keys(_KEYS)
        self._table = table
        self.separator: str = self._read_choice("separator", SEPARATORS, "", '`separator` is ",", ";", "\\t" or "|"')
        """What stands between values; empty: what the header shows."""
        self.decimal: DecimalMark = self._read_choice("decimal", (".", ","), ".", '`decimal` is "." or ","')
        self.encoding: str = self._read_choice("encoding", ENCODINGS, "utf-8", '`encoding` is "utf-8" or "cp1252"')
        self.types: dict[str, ColumnType] = {}
        """By column; others are found out."""
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
        """Report types of columns that the table does not have."""
        types = TomlTable(self._table.file, (), self._table.values, diagnostics).section("types")
        for column in types.values:
            if column not in columns:
                message, near = f"the table has no column `{column}`", suggest(column, columns)
                types.report_key("unknown-key", message, column, suggestion=near)


def read_table_settings(path: Path, files: FileReader, diagnostics: Diagnostics) -> TableSettings:
    """The settings in that file, if there is one. On errors, what could be understood."""
    name = files.display_name(path)
    source = files.read(path, MAX_TOML_BYTES) if files.tree.exists(path) else None
    return files.memo.read(("table settings", name, source), diagnostics, partial(_make, name, source))


def _make(name: str, source: SourceFile | None, diagnostics: Diagnostics) -> TableSettings:
    file = read_toml(source, diagnostics) if source is not None else None
    file = file or TomlFile(SourceFile(name, b"", ""), {})
    return TableSettings(TomlTable(file, (), file.values, diagnostics))
