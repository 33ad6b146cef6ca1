"""The description of a table: its columns with their meanings and sources, and its rows. Also its description in
datapackage.json (Data Package and Table Schema, version 1: https://specs.frictionlessdata.io)."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, Literal, TypeAlias

import msgspec
from msgspec import Struct

from rise_engine.results.analysis.course import interruption_between, seconds_without_engine, wall_seconds
from rise_engine.results.analysis.model import SessionData, seconds_between

STATUS = {
    "PENDING": "still waiting: the record ends before its turn",
    "ACTIVE": "still running: the record ends before it does",
    "SUCCEEDED": "completed",
    "ABORTED": "failed",
    "CANCELED": "stopped, interrupted, or taken out of the queue",
    "REJECTED": "refused at once, with a reason",
}
ACTION_STATUS = {
    "started": "sent to the robot; the record ends before the confirmation",
    "accepted": "confirmed by the robot; the record ends before the action",
    "succeeded": "completed",
    "failed": "the robot could not do it",
    "canceled": "stopped before it was complete",
    "timed-out": "the robot reported no end in time",
    "lost": "its outcome is unknown",
    "skipped": "never begun",
}
ACTORS = {
    "wizard": "a person at a console",
    "rule": "an interaction rule by itself, for example after a time",
    "program": "a node, a client, the command line",
    "engine": "the engine by itself, for example a filler",
}
EVENT_ACTORS = {
    **ACTORS,
    "rule": "an interaction rule; an act: by itself; anything else: perhaps because of a person's key",
    "program": "a node, a client, the command line, a file of the study",
}
MARKS = {
    "wrong": "it was the wrong one",
    "late": "it came too late",
    "early": "it came too early",
    "double": "it was requested twice",
}
OUTCOMES = {
    "complete": "the run counts",
    "aborted": "it was broken off",
    "excluded": "the participant does not count",
}
PURPOSES = {
    "counted": "data of the study",
    "pilot": "a trial run with a person; does not count",
    "training": "of a wizard; does not count",
    "debug": "with a simulated robot; does not count",
}
MODES = {
    "real": "a robot was meant; `driver` says whether there was one",
    "debug": "the robot was simulated: not a participant's data",
}
CUE_STATES = {
    "answered": "an act answered it",
    "unheard": "an act began to answer it, and ended before the robot confirmed the answer",
    "undone": "it was taken back",
    "open": "nothing answered it",
}
TRIAL_ENDS = {
    "trial": "the next one began",
    "rule": "the rule whose state began it ended",
    "key": "the memory key that began it was deleted or became null",
    "record": "the record ended",
}
PHASE_ENDS = {
    "ended": "the rule ended by itself",
    "stopped": "the rule was stopped",
    "faulted": "a fault stopped the rule",
}
INTERRUPTIONS = {
    "outage": "the session had no engine for a while, or its computer was suspended",
    "standstill": "the engine stood still or could record nothing for a while: what happened then is recorded late",
    "stop": "everything was stopped for a while",
}
CHECK_RESULTS = {
    "passed": "as it should be",
    "failed": "not as it should be",
    "skipped": "not done, with a reason",
}
RECORDING_STATES = {
    "started": "asked to record",
    "running": "it records",
    "stalled": "the recorder reports that it records, but its file does not grow",
    "stopped": "ended as it should",
    "failed": "it did not record, or not until the end",
}
MEDIA_KINDS = {
    "video": "video, perhaps with sound",
    "audio": "sound",
    "bag": "a bag of ROS 2",
    "streams": "streams of LSL",
    "other": "something else",
}
ALIGNMENTS = {
    "marks": "by marks in the recording",
    "given": "somebody entered it",
    "start": "by the start of its recorder, which is not the time of the first frame",
}
EVENT_KINDS = {
    "act": "an act from its turn to its end; name: the act; value: how it ended",
    "phase": "a rule in a state; name: the rule; value: the state",
    "cue": "the participant's turn ended; value: what the wizard said about it",
    "note": "a note; value: its text",
    "mistake": "a wizard marked an act as a mistake; name: the mark; value: the act",
    "stop": "stop-all; name: requested, latched, let-go or released",
    "sync": "a mark for recordings; name: its number; value: sound or flash",
    "event": "an event; name: its topic; value: the rule that took it",
    "memory": "a memory value was set; name: the key; value: the new value",
    "control": "control changed; name: what happened; value: who has control now",
    "robot": "the link to the robot; name: its state",
    "fault": "an act, a rule or an expression failed; name: which; value: why",
    "check": "a check; name: its id; value: the result",
    "scenario": "the session went on with changed files of its scenario; value: what changed",
    "recovery": "another engine continued the session; outage_s: how long there was none",
}


ColumnType: TypeAlias = Literal["string", "number", "integer", "boolean", "datetime", "object", "any"]
"""any: the type of its values, `rise_engine.study.questionnaires.type_of_values`."""


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
    """Its meaning, including that of an empty cell."""
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
        """Return its value in a row, which is a Row unless `value` accepts another type. None or empty: no value."""
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
    return lambda row: seconds_between(getattr(row.of, start), getattr(row.of, end))


def outage(start: str, end: str) -> Value:
    """Get the seconds without an engine between two attributes of the row's subject. None: there are none."""
    return lambda row: seconds_without_engine(row.data.outages, getattr(row.of, start), getattr(row.of, end))


def interrupted(name: str, what: str, value: Value | None = None) -> Column:
    """Make the column with the interruption of a duration."""
    about = f"What interrupted {what}, of several the first here; empty: nothing. Reports leave it out then."
    return Column(name, about, value, levels=INTERRUPTIONS)


def interruption(start: str, end: str) -> Value:
    """Get the interruption between two attributes of the row's subject."""
    return lambda row: interruption_between(row.data.interruptions, getattr(row.of, start), getattr(row.of, end))


def wall_column(name: str, ends: Callable[[Row], tuple[float | None, float | None]]) -> Column:
    """Make the column for a duration by the wall clock, `NAME_wall_s` for `NAME_s`.

    :param name: the duration's column.
    :param ends: gives its start and its end.
    """

    def value(row: Row) -> float | None:
        start, end = ends(row)
        return wall_seconds(
            seconds_between(start, end), seconds_without_engine(row.data.outages, start, end), row.data.facts.speed
        )

    about = f"{name} by the wall clock, as wall_s; empty: as in session time."
    return seconds(f"{name.removesuffix('_s')}_wall_s", about, value, None)


def ends(start: str, end: str) -> Callable[[Row], tuple[float | None, float | None]]:
    """Get two attributes of the row's subject."""
    return lambda row: (getattr(row.of, start), getattr(row.of, end))


def outage_columns(what: str, start: str, end: str, away: Value | None = None) -> tuple[Column, Column, Column]:
    """Make columns for the time without an engine between two attributes, for the duration by the wall clock, and for
    the interruption.

    :param what: the duration's column.
    :param start: the attribute with its start.
    :param end: the attribute with its end.
    :param away: gives the seconds without an engine; None: those between the two attributes.
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
    """Write a value as a cell: None is empty, numbers have no exponent and at most six places, lists become words.

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
