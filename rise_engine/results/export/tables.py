"""Tables for analyses: one for each kind of thing that is counted, with datapackage.json, which says what they hold.

UTF-8, line feeds, commas; an empty cell is nothing; times are session seconds. What R (`frictionless`), Python and
people need to read them stands in datapackage.json.
"""

from __future__ import annotations

import csv
import hashlib
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from rise_engine.results.analysis.model import SessionData, SessionFacts
from rise_engine.results.export.codebook import R_FILE, SPSS_FILE, DescribedTable, r_text, spss_text
from rise_engine.results.export.course_tables import ACTIONS, ACTS, CODED, CUES, EVENTS, PHASES
from rise_engine.results.export.format import ExportContext, ExportError, ExportFormat
from rise_engine.results.export.questionnaire_tables import ToldAnswers, told_answers
from rise_engine.results.export.session_tables import CHECKS, FACTS, OF_SESSION, RECORDINGS, SESSIONS, factor_column
from rise_engine.results.export.table_schema import (
    SAFE,
    UNSAFE,
    Column,
    Row,
    TableSchema,
    cell,
    data_package,
    resource,
    safe_cell,
)
from rise_engine.results.export.trial_tables import TRIALS, declared_column
from rise_engine.results.export.wide_table import WideTable
from rise_engine.study.publishing import package_facts

TABLES = (SESSIONS, ACTS, ACTIONS, CUES, PHASES, EVENTS, TRIALS, CODED, CHECKS, RECORDINGS)

PACKAGE = "datapackage.json"
_ABOUT = (
    "What happened in {sessions}, made by rise-tui. Times are seconds on each session's own clock, which begins at 0; "
    "robot_at and voice_at are confirmations of the robot, and the first sound comes later. An empty cell is nothing. "
    "Level: {level}."
)


class _OpenTable:
    """A table that is being written."""

    def __init__(
        self, folder: Path, schema: TableSchema, facts: Sequence[Column], *, spreadsheet_safe: bool = False
    ) -> None:
        self.schema = schema
        self.columns = [*facts, *schema.columns]
        self._safe = spreadsheet_safe
        self._widths = [0] * len(self.columns)
        self._has_line_ends = False
        self.path = folder / schema.file
        descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
        self.file = os.fdopen(descriptor, "w", encoding="utf-8", errors="backslashreplace", newline="")
        self._rows = csv.writer(self.file, lineterminator="\n")
        self._rows.writerow([column.name for column in self.columns])

    def add(self, rows: Iterable[Any], facts: Iterable[str] = ()) -> None:
        for row in rows:
            self.add_row([*facts, *(cell(column.of(row)) for column in self.schema.columns)])

    def add_row(self, cells: list[str]) -> None:
        """A row with a cell for each column."""
        cells = [safe_cell(each) for each in cells] if self._safe else cells
        for at, each in enumerate(cells):
            if len(each) * 4 > self._widths[at]:
                self._widths[at] = max(self._widths[at], len(each.encode("utf-8", "backslashreplace")))
        self._has_line_ends = self._has_line_ends or any("\n" in each or "\r" in each for each in cells)
        self._rows.writerow(cells)

    def described(self) -> dict[str, object]:
        """What datapackage.json says of it; it is closed."""
        with self.path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return resource(self.schema, self.columns, self.path.stat().st_size, digest)

    def for_codebook(self) -> DescribedTable:
        """What programs that read it must know."""
        schema, columns, widths = self.schema, tuple(self.columns), tuple(self._widths)
        return DescribedTable(schema.name, schema.file, schema.about, columns, widths, self._has_line_ends)


def _write(path: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    path.mkdir(0o700)
    facts = [*FACTS, *(factor_column(name, context.study) for name in context.factors)]
    trials = replace(TRIALS, columns=(*TRIALS.columns, *map(declared_column, context.trial_columns or ())))
    wide = WideTable(context) if context.wide else None
    told: list[tuple[SessionFacts, list[str]]] = []
    with ExitStack() as files:

        def open_table(schema: TableSchema, facts: Sequence[Column]) -> _OpenTable:
            table = _OpenTable(path, schema, facts, spreadsheet_safe=context.spreadsheet_safe)
            files.callback(table.file.close)
            return table

        tables = [open_table(trials if schema is TRIALS else schema, facts) for schema in TABLES]
        for data in sessions:
            if unknown := data.facts.factors.keys() - set(context.factors):
                named = ", ".join(sorted(unknown))
                raise ExportError(f"{data.facts.session} has the factors {named}, which are not those of this export")
            values = [cell(column.of(Row(data, 1, data.facts))) for column in facts]
            told.append((data.facts, values))
            for table in tables:
                table.add(table.schema.rows(data), values)
            if wide is not None:
                wide.add(data)
        cells = {each.session: values for each, values in told}
        answered = told_answers(context.study, context.level, (each for each, _ in told), context.warnings)
        for answers in answered:
            schema, shared = _questionnaire_table(answers, facts)
            table = open_table(schema, shared)
            _add_answers(table, answers, cells, [facts.index(column) for column in shared])
            tables.append(table)
        if wide is not None:
            tables.append(open_table(wide.schema(answered), ()))
            tables[-1].add(wide.rows())
    title = context.study.title if context.study is not None else "Sessions of rise-tui"
    name = re.sub(r"[^a-z0-9]+", "-", context.study.id.lower()).strip("-") if context.study is not None else "sessions"
    about = _ABOUT.format(sessions=f"{len(told)} sessions" if len(told) != 1 else "one session", level=context.level)
    about += f" {SAFE if context.spreadsheet_safe else UNSAFE}"
    published = package_facts(context.study.report) if context.study is not None else None
    package = data_package(name or "sessions", title, about, [table.described() for table in tables], published)
    described = [table.for_codebook() for table in tables]
    context.warnings += [
        f"{each.file} has cells of several lines, which SPSS takes for rows: {SPSS_FILE} leaves it out"
        for each in described
        if each.has_line_ends
    ]
    _write_new(path / PACKAGE, package)
    _write_new(path / SPSS_FILE, spss_text(described).encode())
    _write_new(path / R_FILE, r_text(described).encode())


def _questionnaire_table(answers: ToldAnswers, facts: Sequence[Column]) -> tuple[TableSchema, list[Column]]:
    """The table of a questionnaire, and the facts that stand in it: of the session whose run it is about, or what is
    the same in all sessions of the participant."""
    name = f"questionnaire_{answers.name}"
    if answers.settings.run:
        return TableSchema(name, answers.about, answers.columns, ("session",), _no_rows, OF_SESSION), list(facts)
    shared = [column for column in facts if column.name not in ("session", "run")]
    about = f"{answers.about} What differs between their sessions is empty."
    return TableSchema(name, about, answers.columns, ("participant",), _no_rows), shared


def _no_rows(data: SessionData) -> Iterator[Row]:
    """Its rows are those of participants."""
    return iter(())


def _add_answers(
    table: _OpenTable, answers: ToldAnswers, cells: Mapping[str, list[str]], places: Sequence[int]
) -> None:
    for sessions, row in answers.rows:
        values = [{cells[each.session][place] for each in sessions} for place in places]
        same = [next(iter(each)) if len(each) == 1 else "" for each in values]
        table.add_row([*same, *(cell(column.of(row)) for column in answers.columns)])


def _write_new(path: Path, data: bytes) -> None:
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o600)
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)


FORMAT = ExportFormat(
    name="tables",
    about="acts, cues, phases, events, trials, checks, sessions as CSV, described in datapackage.json",
    shape="folder",
    suffix="",
    write=_write,
    spreadsheet_safe=True,
)
