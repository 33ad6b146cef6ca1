"""Tables for analyses: one for each kind of thing that is counted, with datapackage.json, which says what they hold.

UTF-8, line feeds, commas; an empty cell is nothing; times are session seconds. What R (`frictionless`), Python and
people need to read them stands in datapackage.json.
"""

from __future__ import annotations

import csv
import hashlib
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from rise_engine.analysis.model import SessionData
from rise_engine.export.course_tables import ACTIONS, ACTS, CUES, EVENTS, PHASES
from rise_engine.export.format import ExportContext, ExportError, ExportFormat
from rise_engine.export.session_tables import CHECKS, FACTS, RECORDINGS, SESSIONS, factor_column
from rise_engine.export.table_schema import Column, Row, TableSchema, cell, data_package, resource
from rise_engine.export.trial_tables import TRIALS, declared_column
from rise_engine.export.wide_table import WideTable

TABLES = (SESSIONS, ACTS, ACTIONS, CUES, PHASES, EVENTS, TRIALS, CHECKS, RECORDINGS)

PACKAGE = "datapackage.json"
_ABOUT = (
    "What happened in {sessions}, made by rise-tui. Times are seconds on each session's own clock, which begins at 0; "
    "robot_at and voice_at are confirmations of the robot, and the first sound comes later. An empty cell is nothing. "
    "Level: {level}."
)


class _OpenTable:
    """A table that is being written."""

    def __init__(self, folder: Path, schema: TableSchema, facts: Iterable[Column] = ()) -> None:
        self.schema = schema
        self.columns = [*facts, *schema.columns]
        self.path = folder / schema.file
        descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        self.file = os.fdopen(descriptor, "w", encoding="utf-8", errors="backslashreplace", newline="")
        self._rows = csv.writer(self.file, lineterminator="\n")
        self._rows.writerow([column.name for column in self.columns])

    def add(self, rows: Iterable[Any], facts: Iterable[str] = ()) -> None:
        for row in rows:
            self._rows.writerow([*facts, *(cell(column.of(row)) for column in self.schema.columns)])

    def described(self) -> dict[str, object]:
        """What datapackage.json says of it; it is closed."""
        with self.path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return resource(self.schema, self.columns, self.path.stat().st_size, digest)


def _write(path: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    path.mkdir(0o700)
    facts = [*FACTS, *(factor_column(name, context.study) for name in context.factors)]
    trials = replace(TRIALS, columns=(*TRIALS.columns, *map(declared_column, context.trial_columns or ())))
    wide = WideTable(context) if context.wide else None
    tables: list[_OpenTable] = []
    count = 0
    try:
        for schema in TABLES:
            tables.append(_OpenTable(path, trials if schema is TRIALS else schema, facts))
        for data in sessions:
            count += 1
            if unknown := data.facts.factors.keys() - set(context.factors):
                named = ", ".join(sorted(unknown))
                raise ExportError(f"{data.facts.session} has the factors {named}, which are not those of this export")
            values = [cell(column.of(Row(data, 1, data.facts))) for column in facts]
            for table in tables:
                table.add(table.schema.rows(data), values)
            if wide is not None:
                wide.add(data)
        if wide is not None:
            tables.append(_OpenTable(path, wide.schema()))
            tables[-1].add(wide.rows())
    finally:
        for table in tables:
            table.file.close()
    title = context.study.title if context.study is not None else "Sessions of rise-tui"
    name = re.sub(r"[^a-z0-9]+", "-", context.study.id.lower()).strip("-") if context.study is not None else "sessions"
    about = _ABOUT.format(sessions=f"{count} sessions" if count != 1 else "one session", level=context.level)
    package = data_package(name or "sessions", title, about, [table.described() for table in tables])
    descriptor = os.open(path / PACKAGE, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(package)


FORMAT = ExportFormat(
    name="tables",
    about="acts, cues, phases, events, trials, checks, sessions as CSV, described in datapackage.json",
    shape="folder",
    suffix="",
    write=_write,
)
