"""What a table is: its columns, each with its description and what its value is taken from, and its rows. What
datapackage.json says of it (Data Package and Table Schema, version 1: https://specs.frictionlessdata.io)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, TypeAlias

import msgspec
from msgspec import Struct

from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.outages import seconds_without_engine

ColumnType: TypeAlias = Literal["string", "number", "integer", "boolean", "datetime", "object", "any"]


class Row(Struct, frozen=True):
    """What the columns of a table take the values of one row from."""

    data: SessionData
    number: int
    """In the table of this session, from 1."""
    of: Any
    """What the row is about: an act, a cue, a phase."""
    beside: Any = None
    """What belongs to it: an action's act, the file of a recording."""


Value: TypeAlias = Callable[[Any], Any]
"""Takes a value from a row."""


class Column(Struct, frozen=True):
    """One column."""

    name: str
    about: str
    """What it holds, and what an empty cell means."""
    value: Value | None = None
    """What stands in a row; None: what the row is about has an attribute of the column's name."""
    type: ColumnType = "string"
    unit: str = ""
    """`s`: seconds; `bytes`; empty: none."""
    levels: Mapping[str, str] = {}
    """Every value that it can have, and what each means; empty: any."""
    pattern: str = ""
    """A regular expression that every value fits."""
    required: bool = False
    minimum: float | None = None

    def of(self, row: Any) -> Any:
        """Its value in a row, which is a Row where `value` does not take something else. None or an empty text: there
        is none."""
        return getattr(row.of, self.name) if self.value is None else self.value(row)

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
    rows: Callable[[SessionData], Iterator[Row]]
    """Those of one session."""
    references: tuple[Reference, ...] = ()

    @property
    def file(self) -> str:
        """Its file's name."""
        return f"{self.name}.csv"


def rows_of(attribute: str) -> Callable[[SessionData], Iterator[Row]]:
    """A row for each of what a session has several of, such as `acts`."""
    return lambda data: (Row(data, number, of) for number, of in enumerate(getattr(data, attribute), 1))


def moment(name: str, about: str, value: Value | None = None, *, required: bool = False) -> Column:
    """A column with a session time."""
    return Column(
        name, f"Session seconds; the session's clock begins at 0. {about}", value, "number", "s", {}, "", required
    )


def seconds(name: str, about: str, value: Value | None = None, minimum: float | None = 0) -> Column:
    """A column with a duration."""
    return Column(name, about, value, "number", "s", minimum=minimum)


def count(name: str, about: str, value: Value | None = None) -> Column:
    """A column that counts."""
    return Column(name, about, value, "integer", minimum=0, required=True)


def numbering(name: str) -> Column:
    """The part of a key that is not the session."""
    about = "Its number in the session, from 1; the key together with session."
    return Column(name, about, lambda row: row.number, "integer", required=True, minimum=1)


def span(start: str, end: str) -> Value:
    """The seconds from one attribute of what the row is about to another."""
    return lambda row: between(getattr(row.of, start), getattr(row.of, end))


def outage(start: str, end: str) -> Value:
    """The seconds without an engine between two attributes of what the row is about; None: there are none."""
    return lambda row: seconds_without_engine(row.data.outages, getattr(row.of, start), getattr(row.of, end))


def outage_columns(what: str, start: str, end: str) -> tuple[Column, Column]:
    """Of a duration, from one attribute to another: how long there was no engine in it, and how long it really was."""
    lasted, away = span(start, end), outage(start, end)

    def by_wall_clock(row: Row) -> float | None:
        seconds, missing = lasted(row), away(row)
        return None if seconds is None or missing is None else round(seconds + missing, 6)

    return (
        seconds("outage_s", f"Seconds without an engine in {what}; empty: none. Session time stopped meanwhile.", away),
        seconds("wall_s", f"{what} by the wall clock, with outage_s; empty: as in session time.", by_wall_clock),
    )


def between(earlier: float | None, later: float | None) -> float | None:
    """Seconds from one time to another; None: one of them is not known."""
    return None if earlier is None or later is None else round(later - earlier, 6)


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


def data_package(
    name: str, title: str, about: str, resources: Iterable[Mapping[str, Any]], facts: Mapping[str, Any] | None = None
) -> bytes:
    """datapackage.json.

    :param name: of the data, in small letters, digits, `-`, `_` and `.`.
    :param title: for people.
    :param about: what is in it.
    :param resources: as `resource` gives them.
    :param facts: what else it says, as `rise_engine.study.publishing.package_facts` gives it.
    """
    package = {
        "profile": "tabular-data-package",
        "name": name,
        "title": title,
        "description": about,
        **(facts or {}),
        "resources": [*resources],
    }
    return msgspec.json.format(msgspec.json.encode(package), indent=2) + b"\n"


SAFE = "Each cell that a spreadsheet would run as a formula begins with an apostrophe, which is not part of the data."
UNSAFE = (
    "Cells of tables are as people wrote them. A spreadsheet carries out those that begin with =, +, - or @: open the "
    "tables with another program, or export them with --format tables --spreadsheet-safe."
)
"""What an export says of cells that a spreadsheet would carry out."""
_FORMULA = re.compile(r"[=+\-@\t\r]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z", re.ASCII)


def safe_cell(text: str) -> str:
    """A cell that no spreadsheet carries out: with an apostrophe before what would be a formula.

    >>> [safe_cell(each) for each in ("=1+1", "-2.5", "-x", "@SUM(A1)", "plain")]
    ["'=1+1", '-2.5', "'-x", "'@SUM(A1)", 'plain']
    """
    return f"'{text}" if _FORMULA.match(text) and not _NUMBER.match(text) else text


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
    if isinstance(value, dict | list):
        return msgspec.json.encode(value).decode()
    return str(value)
