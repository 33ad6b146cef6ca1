"""The description of a table: its columns with their meanings and sources, and its rows. Also its description in
datapackage.json (Data Package and Table Schema, version 1: https://specs.frictionlessdata.io)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, TypeAlias

import msgspec
from msgspec import Struct

from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.outages import interruption_between, seconds_without_engine, wall_seconds
from rise_engine.results.export.table_levels import INTERRUPTIONS

ColumnType: TypeAlias = Literal["string", "number", "integer", "boolean", "datetime", "object", "any"]
"""any: that of its values, `rise_engine.study.questionnaires.type_of_values`."""


class Row(Struct, frozen=True):
    """The source of the values of one row."""

    data: SessionData
    number: int
    """Its number in this session's table, from 1."""
    of: Any
    """The subject of the row: an act, a cue, a phase."""
    beside: Any = None
    """A related object: an action's act, the file of a recording."""


Value: TypeAlias = Callable[[Any], Any]
"""Gets a value from a row."""


class Column(Struct, frozen=True):
    """One column of a table."""

    name: str
    about: str
    """Its meaning, also of an empty cell."""
    value: Value | None = None
    """Gets its value from a row. None: the attribute of the same name of the row's subject."""
    type: ColumnType = "string"
    unit: str = ""
    """`s`: seconds; `bytes`; empty: none."""
    levels: Mapping[str, str] = {}
    """Every possible value with its meaning. Empty: any value."""
    pattern: str = ""
    """A regular expression that every value matches."""
    required: bool = False
    minimum: float | None = None

    def of(self, row: Any) -> Any:
        """Return its value in a row, which is a Row unless `value` accepts something else. None or empty: there is
        none."""
        return getattr(row.of, self.name) if self.value is None else self.value(row)

    def field(self) -> dict[str, Any]:
        """Describe it as in Table Schema. `unit` and `levels` are additions, which the standard allows."""
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
    """Columns that refer to a row of another table by the columns of the same names there."""

    columns: tuple[str, ...]
    table: str


class TableSchema(Struct, frozen=True):
    """The schema of one table."""

    name: str
    """The file's name without `.csv`."""
    about: str
    """The meaning of one row."""
    columns: tuple[Column, ...]
    """Its own columns. The facts of the session come before them."""
    key: tuple[str, ...]
    """The columns whose values identify a row."""
    rows: Callable[[SessionData], Iterator[Row]]
    """Gives the rows of one session."""
    references: tuple[Reference, ...] = ()

    @property
    def file(self) -> str:
        """The file's name."""
        return f"{self.name}.csv"


def rows_of(attribute: str) -> Callable[[SessionData], Iterator[Row]]:
    """Make a row for each item of a session's attribute, such as `acts`."""
    return lambda data: (Row(data, number, of) for number, of in enumerate(getattr(data, attribute), 1))


def moment(name: str, about: str, value: Value | None = None, *, required: bool = False) -> Column:
    """Make a column with a session time."""
    return Column(name, f"Session time when {about}", value, "number", "s", {}, "", required)


def seconds(name: str, about: str, value: Value | None = None, minimum: float | None = 0) -> Column:
    """Make a column with a duration."""
    return Column(name, about, value, "number", "s", minimum=minimum)


def count(name: str, about: str, value: Value | None = None) -> Column:
    """Make a column with a count."""
    return Column(name, about, value, "integer", minimum=0, required=True)


def numbering(name: str) -> Column:
    """Make the column that, with the session, forms the key."""
    about = "Its number in the session, from 1; the key together with session."
    return Column(name, about, lambda row: row.number, "integer", required=True, minimum=1)


def span(start: str, end: str) -> Value:
    """Get the seconds from one attribute of the row's subject to another."""
    return lambda row: between(getattr(row.of, start), getattr(row.of, end))


def outage(start: str, end: str) -> Value:
    """Get the seconds without an engine between two attributes of the row's subject. None: there are none."""
    return lambda row: seconds_without_engine(row.data.outages, getattr(row.of, start), getattr(row.of, end))


def interrupted(name: str, what: str, value: Value | None = None) -> Column:
    """Make the column that says what interrupted a duration."""
    about = f"What interrupted {what}, of several the first here; empty: nothing. Reports leave it out then."
    return Column(name, about, value, levels=INTERRUPTIONS)


def interruption(start: str, end: str) -> Value:
    """Get what interrupted the time between two attributes of the row's subject."""
    return lambda row: interruption_between(row.data.interruptions, getattr(row.of, start), getattr(row.of, end))


def wall_column(name: str, ends: Callable[[Row], tuple[float | None, float | None]]) -> Column:
    """Make the column for a duration by the wall clock, `NAME_wall_s` for `NAME_s`.

    :param name: the duration's column.
    :param ends: gives its start and its end.
    """

    def value(row: Row) -> float | None:
        start, end = ends(row)
        return wall_seconds(
            between(start, end), seconds_without_engine(row.data.outages, start, end), row.data.facts.speed
        )

    about = f"{name} by the wall clock, as wall_s; empty: as in session time."
    return seconds(f"{name.removesuffix('_s')}_wall_s", about, value, None)


def ends(start: str, end: str) -> Callable[[Row], tuple[float | None, float | None]]:
    """Get two attributes of the row's subject."""
    return lambda row: (getattr(row.of, start), getattr(row.of, end))


def outage_columns(what: str, start: str, end: str, away: Value | None = None) -> tuple[Column, Column, Column]:
    """Make columns for the time without an engine between two attributes, for the duration by the wall clock, and for
    what interrupted it.

    :param what: the duration's column.
    :param start: the attribute with its start.
    :param end: the attribute with its end.
    :param away: gives the seconds without an engine; None: those between the two.
    """
    lasted, away = span(start, end), away or outage(start, end)

    return (
        seconds(
            "outage_s", f"Seconds without an engine during {what}; empty: none. Session time stands still then.", away
        ),
        seconds(
            "wall_s",
            f"{what} by the wall clock: divided by speed, and including outage_s; empty: as in session time.",
            lambda row: wall_seconds(lasted(row), away(row), row.data.facts.speed),
        ),
        interrupted("interrupted", what, interruption(start, end)),
    )


def between(earlier: float | None, later: float | None) -> float | None:
    """Return the seconds from one time to another. None: one of them is not known."""
    return None if earlier is None or later is None else round(later - earlier, 6)


def resource(table: TableSchema, columns: Sequence[Column], size: int, digest: str) -> dict[str, Any]:
    """Describe one table for datapackage.json.

    :param columns: all columns in the order of the file.
    :param size: the file's size in bytes.
    :param digest: the file's SHA-256.
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
    """Write datapackage.json.

    :param name: the data's name in lower case letters, digits, `-`, `_` and `.`.
    :param title: a title for people.
    :param about: a description.
    :param resources: from `resource`.
    :param facts: further entries, from `rise_engine.study.publishing.package_facts`.
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
"""The warning of an export about cells that a spreadsheet would execute."""
_FORMULA = re.compile(r"[=+\-@\t\r]")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z", re.ASCII)


def safe_cell(text: str) -> str:
    """Put an apostrophe before a cell that a spreadsheet would execute as a formula.

    >>> [safe_cell(each) for each in ("=1+1", "-2.5", "-x", "@SUM(A1)", "plain")]
    ["'=1+1", '-2.5', "'-x", "'@SUM(A1)", 'plain']
    """
    return f"'{text}" if _FORMULA.match(text) and not _NUMBER.match(text) else text


def cell(value: Any) -> str:
    """Write a value as a cell: None is empty, numbers have no exponent and at most six places, lists are words.

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
