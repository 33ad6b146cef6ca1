"""The records of sessions themselves, for analyses, as JSON lines or as a table.

Everything readable is exported, also from a running, torn or damaged session. Unreadable parts are reported, and
nothing is invented.
"""

from __future__ import annotations

import csv
from codecs import getwriter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, Literal, TypeAlias

import msgspec

from rise_engine.kernel.records import AnyRecord, identity_of
from rise_engine.results.analysis.model import SessionData, SessionFacts
from rise_engine.results.analysis.session_records import SessionRecords
from rise_engine.results.export.format import ExportContext, ExportFormat, new_file
from rise_engine.results.export.table_schema import safe_cell
from rise_engine.session.journal_format import encode_record

RecordFormat: TypeAlias = Literal["jsonl", "csv"]

COLUMNS = (
    *("session", "mode", "seq", "t", "wall", "kind"),
    *("status", "reason", "source"),  # several kinds
    *("id", "function", "behavior", "calling_type", "position", "ref"),  # task
    *("task", "act", "action", "type", "parameters", "sent_as"),  # action
    *("name", "state", "previous", "trigger", "transition", "priority"),  # rule
    *("topic", "taken_by"),  # event
    *("rule", "expression", "values", "result", "error", "missing"),  # condition; state too
    *("key", "value", "old", "created", "deleted"),  # memory
    "detail",  # robot
    *("confirmed", "unconfirmed"),  # stop
    *("by", "holder"),  # control
    "text",  # note
    *("scenario", "scenario_hash", "robot", "seed", "versions"),  # session
    *("participant", "condition"),  # session
    "since",  # cue
    "mark",  # mistake
    *("cue_at", "key_at", "accepted_at", "started_at", "robot_at", "ended_at"),  # timing
    "seconds",  # countdown, failure, kept; transition, topic and rule too
    *("study", "study_hash", "slot", "run", "attempt", "purpose", "factors"),  # session
    "language",  # session
    *("path", "bytes"),  # recording
    *("number", "medium"),  # sync
    *("filler", "voice_at"),  # timing; source too
    "downtime",  # session
    *("at", "within"),  # sync
    *("hash", "was", "changes"),  # scenario; source too
    *("unstoppable", "held_by"),  # stop
    "open",  # robot, session
    *("cause", "via"),  # task
    *("driver", "injected_faults", "speed"),  # session
    *("stood", "suspended"),  # note
    "waits_for_wizard",  # session
)
"""The table's columns. All are always there, in this order; new ones may only be added at the end."""


def write_records(
    source: SessionRecords, format: RecordFormat, out: BinaryIO, *, spreadsheet_safe: bool = False
) -> None:
    """Write the readable records of one session, one at a time, so that it can have any length.

    :param source: the session.
    :param format: `jsonl`, one record a line as in the journal but without checksums, or `csv`, a table with COLUMNS
        (RFC 4180, UTF-8; times in seconds).
    :param out: a binary file open for writing, which is flushed but not closed.
    :param spreadsheet_safe: as in `ExportContext`.
    :raises OSError: writing fails.
    """
    if format == "csv":
        table = _Table(out, spreadsheet_safe=spreadsheet_safe)
        table.add(source.read(), {"session": source.name, "mode": source.mode})
    else:
        _write_lines(source.read(), out)
    out.flush()


class _Table:
    """A table of records."""

    def __init__(self, out: BinaryIO, *, spreadsheet_safe: bool) -> None:
        self._safe = spreadsheet_safe
        self._rows = csv.writer(getwriter("utf-8")(out))  # as in RFC 4180: commas, CR LF, quotes doubled
        self._rows.writerow(COLUMNS)

    def add(self, records: Iterable[AnyRecord], facts: Mapping[str, Any]) -> None:
        """Add a session's records. `facts`: values for every row."""
        for record in records:
            values: dict[str, Any] = msgspec.json.decode(encode_record(record))
            values.update(facts)
            cells = [table_cell(values.get(column)) for column in COLUMNS]
            self._rows.writerow([safe_cell(each) for each in cells] if self._safe else cells)


def _write_lines(records: Iterable[AnyRecord], out: BinaryIO) -> None:
    for record in records:
        out.write(encode_record(record) + b"\n")


def table_cell(value: Any) -> str:
    """Write a JSON value as a cell: texts unchanged, null and missing values empty, all others as JSON."""
    if value is None:
        return ""
    return value if isinstance(value, str) else msgspec.json.encode(value).decode()


def _facts_in_rows(facts: SessionFacts) -> dict[str, Any]:
    """Return the values that distinguish the rows of several sessions."""
    return {
        "session": facts.session,
        "mode": facts.mode,
        **identity_of(facts),
    }


def _write_csv(path: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    with new_file(path) as out:
        table = _Table(out, spreadsheet_safe=context.spreadsheet_safe)
        for data in sessions:
            table.add(data.records, _facts_in_rows(data.facts))


def _write_jsonl(path: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    with new_file(path) as out:
        for data in sessions:
            _write_lines(data.records, out)


CSV = ExportFormat(
    name="csv",
    about="all records as one table; one row is one record",
    shape="file",
    suffix=".csv",
    write=_write_csv,
    spreadsheet_safe=True,
)
JSONL = ExportFormat(
    name="jsonl",
    about="all records as JSON lines",
    shape="file-per-session",
    suffix=".jsonl",
    write=_write_jsonl,
)
