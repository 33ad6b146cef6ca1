"""What a table says of itself: its columns with units, levels and keys, as datapackage.json has them (Data Package and
Table Schema, version 1: https://specs.frictionlessdata.io)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal, TypeAlias

import msgspec
from msgspec import Struct

ColumnType: TypeAlias = Literal["string", "number", "integer", "boolean", "datetime", "object"]


class Column(Struct, frozen=True):
    """One column."""

    name: str
    about: str
    """What it holds, and what an empty cell means."""
    type: ColumnType = "string"
    unit: str = ""
    """`s`: seconds; `bytes`; empty: none."""
    levels: Mapping[str, str] = {}
    """Every value that it can have, and what each means; empty: any."""
    pattern: str = ""
    """A regular expression that every value fits."""
    required: bool = False
    minimum: float | None = None

    def field(self) -> dict[str, Any]:
        """As Table Schema describes it. `unit` and `levels` are additions, as the standard allows."""
        found: dict[str, Any] = {"name": self.name, "type": self.type, "description": self.about}
        if self.unit:
            found["unit"] = self.unit
        constraints: dict[str, Any] = {}
        if self.required:
            constraints["required"] = True
        if self.levels:
            found["levels"] = dict(self.levels)
            constraints["enum"] = [*self.levels]
        if self.pattern:
            constraints["pattern"] = self.pattern
        if self.minimum is not None:
            constraints["minimum"] = self.minimum
        return {**found, "constraints": constraints} if constraints else found


class Reference(Struct, frozen=True):
    """Columns that name a row of another table, by the columns there that have the same names."""

    columns: tuple[str, ...]
    table: str


class TableSchema(Struct, frozen=True):
    """One table."""

    name: str
    """Of the file, without `.csv`."""
    about: str
    """What one row is."""
    columns: tuple[Column, ...]
    """Its own; the facts of the session stand before them."""
    key: tuple[str, ...]
    """Columns whose values together name one row."""
    references: tuple[Reference, ...] = ()

    @property
    def file(self) -> str:
        """Its file's name."""
        return f"{self.name}.csv"


def resource(table: TableSchema, columns: Sequence[Column], size: int, digest: str) -> dict[str, Any]:
    """What datapackage.json says of one table.

    :param columns: all of them, in the order of the file.
    :param size: of the file, in bytes.
    :param digest: its SHA-256.
    """
    schema: dict[str, Any] = {
        "fields": [column.field() for column in columns],
        "missingValues": [""],
        "primaryKey": [*table.key],
    }
    if table.references:
        schema["foreignKeys"] = [
            {"fields": [*each.columns], "reference": {"resource": each.table, "fields": [*each.columns]}}
            for each in table.references
        ]
    return {
        "name": table.name,
        "description": table.about,
        "path": table.file,
        "profile": "tabular-data-resource",
        "format": "csv",
        "mediatype": "text/csv",
        "encoding": "utf-8",
        "dialect": {"delimiter": ",", "lineTerminator": "\n", "quoteChar": '"', "doubleQuote": True, "header": True},
        "bytes": size,
        "hash": f"sha256:{digest}",
        "schema": schema,
    }


def data_package(name: str, title: str, about: str, resources: Iterable[Mapping[str, Any]]) -> bytes:
    """datapackage.json.

    :param name: of the data, in small letters, digits, `-`, `_` and `.`.
    :param title: for people.
    :param about: what is in it.
    :param resources: as `resource` gives them.
    """
    package = {
        "profile": "tabular-data-package",
        "name": name,
        "title": title,
        "description": about,
        "resources": [*resources],
    }
    return msgspec.json.format(msgspec.json.encode(package), indent=2) + b"\n"


def cell(value: Any) -> str:
    """A value in a table: nothing is empty, numbers have no exponent and at most six places, lists are words.

    >>> [cell(each) for each in (None, True, 2.0, 0.1 + 0.2, -0.0000001, 12, ("speech", "gaze"), {"a": 1})]
    ['', 'true', '2', '0.3', '0', '12', 'speech gaze', '{"a":1}']
    """
    if value is None or value == "":
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        text = f"{value:.6f}".rstrip("0").rstrip(".")
        return "0" if text == "-0" else text
    if isinstance(value, tuple):
        return " ".join(map(str, value))
    if isinstance(value, dict):
        return msgspec.json.encode(value).decode()
    return str(value)
