"""Tables of TOML files, read key by key: what is wrong with a value is a finding, and the usual value is taken."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rise_engine.base.nearest_name import Correction, suggest
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import SourceLocation
from rise_engine.scenario.toml_files import TomlFile
from rise_engine.syntax.toml import KeyPath

_KINDS: dict[type, str] = {str: "a text", bool: "true or false", dict: "a table"}


class TomlTable:
    """A table of a TOML file, or the file itself."""

    def __init__(self, file: TomlFile, path: KeyPath, values: dict[str, Any], diagnostics: Diagnostics) -> None:
        self.file = file
        self.path = path
        self.values = values
        self.diagnostics = diagnostics

    @property
    def name(self) -> str:
        """Its own key."""
        return self.path[-1]

    def key_location(self, *keys: str) -> SourceLocation:
        return self.file.key_location(*self.path, *keys)

    def value_location(self, *keys: str) -> SourceLocation:
        return self.file.value_location(*self.path, *keys)

    def report_key(self, code: str, message: str, *keys: str, suggestion: Correction | None = None) -> None:
        """An error at a key; without one, at the table."""
        self.diagnostics.error(code, self.key_location(*keys), message, suggestion)

    def report_value(self, code: str, key: str, message: str, suggestion: Correction | None = None) -> None:
        """An error at the value of a key."""
        self.diagnostics.error(code, self.value_location(key), message, suggestion)

    def report_unknown_keys(self, known: Iterable[str]) -> None:
        """An error for each key that nobody reads."""
        names = tuple(known)
        for key in self.values:
            if key not in names:
                self.report_key("unknown-key", f"unknown key `{key}`", key, suggestion=suggest(key, names))

    def subtable(self, key: str, form: str = "") -> TomlTable | None:
        """The table at a key, an empty one when there is none; None, after a finding, for another value."""
        if isinstance(values := self.values.get(key, {}), dict):
            return TomlTable(self.file, (*self.path, key), values, self.diagnostics)
        self.report_key("wrong-type", form or f"`{key}` is a table: [{key}]", key)
        return None

    def section(self, key: str, known: Iterable[str] | None = None) -> TomlTable:
        """The table `[key]`, with `known` keys and no other; an empty one for anything else."""
        table = self.subtable(key) or TomlTable(self.file, (*self.path, key), {}, self.diagnostics)
        if known is not None:
            table.report_unknown_keys(known)
        return table

    def read(self, key: str, type_: type, usual: Any, form: str = "") -> Any:
        """The value of a key: a str, bool or dict. `form` ends the message about another one."""
        if key not in self.values or isinstance(self.values[key], type_):
            return self.values.get(key, usual)
        self.report_value("wrong-type", key, f"`{key}` is {_KINDS[type_]}{form}")
        return usual

    def read_texts(self, key: str, usual: tuple[str, ...]) -> tuple[str, ...]:
        """A list of texts that are not empty."""
        value = self.values.get(key, list(usual))
        if isinstance(value, list) and all(isinstance(item, str) and item for item in value):
            return tuple(value)
        self.report_value("wrong-type", key, f'`{key}` is a list of texts: ["...", "..."]')
        return usual

    def read_number(self, key: str, usual: float | None, of: str = "") -> float | None:
        """A number, or nothing; `of` says of what: ` of seconds`."""
        value = self.values.get(key, usual)
        if value is None or (isinstance(value, int | float) and not isinstance(value, bool)):
            return value
        self.report_value("wrong-type", key, f"`{key}` is a number{of}")
        return usual


def is_integer(value: Any) -> bool:
    """Whether a TOML value is a whole number; for Python, a boolean is one too."""
    return isinstance(value, int) and not isinstance(value, bool)


def read_seconds(table: TomlTable, key: str, usual: float | None, least: float, most: float) -> float | None:
    """The value of a key, in seconds within these limits."""
    value = table.read_number(key, usual, " of seconds")
    if value is None or least <= value <= most:
        return value if value is None else float(value)
    table.report_value("out-of-range", key, f"`{key}` is from {least:g} to {most:g} seconds")
    return usual
