"""The types of a table's columns, and the settings in `tables/NAME.toml`."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

from rise_engine.base.json_codec import is_64_bit
from rise_engine.base.nearest_name import suggest
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import MAX_TOML_BYTES, FileReader, SourceFile
from rise_engine.scenario.files.toml_files import TomlFile, TomlTable, read_toml
from rise_engine.scenario.model import Json

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
    """The type of a column: number or bool if all values that are not empty are; else text."""
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
        """The separator of values; empty: the one that the header shows."""
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
        """Report types for columns that the table does not have."""
        types = TomlTable(self._table.file, (), self._table.values, diagnostics).section("types")
        for column in types.values:
            if column not in columns:
                message, near = f"the table has no column `{column}`", suggest(column, columns)
                types.report_key("unknown-key", message, column, suggestion=near)


def read_table_settings(path: Path, files: FileReader, diagnostics: Diagnostics) -> TableSettings:
    """Read the settings in a file, or the defaults if there is none; on errors, as far as they are valid."""
    name = files.display_name(path)
    source = files.read(path, MAX_TOML_BYTES) if files.tree.exists(path) else None
    return files.memo.read(("table settings", name, source), diagnostics, partial(_make, name, source))


def _make(name: str, source: SourceFile | None, diagnostics: Diagnostics) -> TableSettings:
    file = read_toml(source, diagnostics) if source is not None else None
    file = file or TomlFile(SourceFile(name, b"", ""), {})
    return TableSettings(TomlTable(file, (), file.values, diagnostics))
