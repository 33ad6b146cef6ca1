"""Tables for analyses, one for each kind of thing, with a description in datapackage.json.

They are in UTF-8 with line feeds and commas. Empty cells mean that there is no value. Times are session seconds.
datapackage.json has everything that R (`frictionless`), Python and people need to read them.
"""

from __future__ import annotations

import csv
import hashlib
import json
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from io import TextIOWrapper
from pathlib import Path
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.results.analysis.model import SessionData, SessionFacts
from rise_engine.results.export.course_tables import ACTIONS, ACTS, CODED, CUES, EVENTS, PHASES
from rise_engine.results.export.format import ExportContext, ExportError, ExportFormat, new_file
from rise_engine.results.export.session_tables import (
    CHECKS,
    FACTS,
    RECORDINGS,
    SESSION_REFERENCES,
    SESSIONS,
    factor_column,
)
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
from rise_engine.results.export.trial_tables import TRIALS, AnswersAtLevel, WideTable, answers_at_level, declared_column
from rise_engine.study.publishing import package_facts
from rise_engine.study.questionnaires import ValueType, type_of_values

SPSS_FILE, R_FILE = "read_tables.sps", "read_tables.R"
_LONGEST_NAME, _LONGEST_LABEL, _LONGEST_VALUE_LABEL, _LONGEST_TEXT = 64, 230, 110, 32_767
"""Limits in bytes of SPSS and of a line of its syntax."""
_RESERVED = frozenset({"all", "and", "by", "comment", "eq", "ge", "gt", "le", "lt", "ne", "not", "or", "to", "with"})
"""Reserved words of SPSS. `comment` is one in PSPP (1.6.2), which skips the rest of the command."""
_NO_NAME = re.compile(r"[^A-Za-z0-9_]+")
_NUMBERS = ("integer", "number")
_R_TYPES = {"integer": "numeric", "number": "numeric", "boolean": "logical"}
"""R types; all others are texts. Whole numbers can exceed R's integers."""


class DescribedTable(Struct, frozen=True):
    """A table that was written."""

    name: str
    file: str
    about: str
    columns: tuple[Column, ...]
    widths: tuple[int, ...]
    """The bytes of the longest cell of each column."""
    has_line_ends: bool = False
    """Whether a cell has several lines, which SPSS takes for several rows."""


def spss_text(tables: Iterable[DescribedTable]) -> str:
    """Write SPSS syntax that reads each table as a data set of its name."""
    lines = [
        "* Encoding: UTF-8.",
        "* Reads the tables of this folder, each as a data set of its name: acts, cues, sessions, and so on.",
        "* Say first where the folder is. An empty cell is missing; true and false are texts.",
        "CD '.'.",
        "SET DECIMAL=DOT.",
    ]
    for table in tables:
        if table.has_line_ends:
            lines += ["", f"* {table.file} is left out: it has cells of several lines, which SPSS takes for rows."]
        else:
            lines += ["", f"* {table.about.rstrip('.')}.", *_spss_table(table)]
    return "\n".join([*lines, ""])


def _spss_table(table: DescribedTable) -> Iterator[str]:
    names = spss_names([column.name for column in table.columns])
    yield "GET DATA /TYPE=TXT"
    yield f"  /FILE={_spss_quoted(table.file)} /ENCODING='UTF8'"
    yield "  /ARRANGEMENT=DELIMITED /DELCASE=LINE /FIRSTCASE=2 /DELIMITERS=',' /QUALIFIER='\"'"
    yield "  /VARIABLES="
    for name, column, width in zip(names, table.columns, table.widths, strict=True):
        yield f"    {name} {_spss_format(column, width)}"
    yield "  ."
    yield "VARIABLE LABELS"
    for at, (name, column) in enumerate(zip(names, table.columns, strict=True)):
        about = column.about if name == column.name else f"{column.name}: {column.about}"
        yield f"  {'/' * (at > 0)}{name} {_spss_quoted(about, _LONGEST_LABEL)}"
    yield "  ."
    labelled = [(name, column) for name, column in zip(names, table.columns, strict=True) if column.levels]
    if labelled:
        yield "VALUE LABELS"
        for at, (name, column) in enumerate(labelled):
            yield f"  {'/' * (at > 0)}{name}"
            for value, label in column.levels.items():
                written = value if column.type in _NUMBERS else _spss_quoted(value)
                yield f"    {written} {_spss_quoted(label, _LONGEST_VALUE_LABEL)}"
        yield "  ."
    yield f"DATASET COPY {table.name}."  # PSPP keeps no DATASET NAME when the next table replaces it


def _spss_format(column: Column, width: int) -> str:
    if column.type == "integer":
        return "F16.0"
    if column.type == "number":
        return "F16.6"
    longest = max([1, width, *(len(value.encode()) for value in column.levels)])
    return f"A{min(longest, _LONGEST_TEXT)}"


def spss_names(names: Sequence[str]) -> list[str]:
    """Make names for SPSS variables: ASCII letters, digits and `_`, at most 64, not reserved, all different.

    >>> spss_names(["by", "G01[SQ1]", "2nd", "Score", "score"])
    ['by_', 'G01_SQ1', 'v2nd', 'Score', 'score_2']
    """
    taken: set[str] = set()
    found = []
    for name in names:
        plain = _NO_NAME.sub("_", name).strip("_") or "v"
        plain = plain if plain[0].isalpha() else f"v{plain}"
        plain = f"{plain}_" if plain.casefold() in _RESERVED else plain[: _LONGEST_NAME - 4]
        free = (plain if number == 1 else f"{plain}_{number}" for number in range(1, len(names) + 2))
        given = next(each for each in free if each.casefold() not in taken)
        taken.add(given.casefold())
        found.append(given)
    return found


def _spss_quoted(text: str, longest: int = _LONGEST_TEXT) -> str:
    """Quote a text on one line, cut to a number of bytes."""
    text = " ".join(text.split())
    if len(text.encode()) > longest:
        text = text.encode()[: longest - 3].decode(errors="ignore") + "..."
    return "'" + text.replace("'", "''") + "'"


def r_text(tables: Iterable[DescribedTable]) -> str:
    """Write an R script that reads each table as a data frame of its name."""
    lines = [
        "# Reads the tables of this folder, each as a data frame of its name: acts, cues, sessions, and so on.",
        '# In R: setwd("the folder"), then source("read_tables.R", encoding = "UTF-8").',
        '# attr(acts$status, "label") says what a column holds, attr(acts$status, "labels") what its values mean:',
        "# as the packages haven, labelled and sjlabelled have it.",
        "read_table <- function(file, types, about, values) {",
        '  table <- read.csv(file, colClasses = types, na.strings = "", check.names = FALSE, fileEncoding = "UTF-8")',
        '  for (name in names(about)) attr(table[[name]], "label") <- about[[name]]',
        '  for (name in names(values)) attr(table[[name]], "labels") <- values[[name]]',
        "  table",
        "}",
    ]
    for table in tables:
        types = {column.name: _R_TYPES.get(column.type, "character") for column in table.columns}
        lines += ["", f"# {' '.join(table.about.split())}", f"{table.name} <- read_table("]
        lines += [f"  {_r_quoted(table.file)},"]
        lines += ["  c(", *_r_items({name: _r_quoted(each) for name, each in types.items()}), "  ),"]
        about = {column.name: _r_quoted(" ".join(column.about.split())) for column in table.columns}
        lines += ["  list(", *_r_items(about), "  ),"]
        lines += ["  list(", *_r_items({column.name: _r_values(column) for column in table.columns if column.levels})]
        lines += ["  )", ")"]
    return "\n".join([*lines, ""])


def _r_items(items: dict[str, str]) -> list[str]:
    last = len(items) - 1
    return [f"    {_r_quoted(name)} = {value}{',' * (at < last)}" for at, (name, value) in enumerate(items.items())]


def _r_values(column: Column) -> str:
    written = (
        f"{_r_quoted(label)} = {value if column.type in _NUMBERS else _r_quoted(value)}"
        for value, label in column.levels.items()
    )
    return f"c({', '.join(written)})"


def _r_quoted(text: str) -> str:
    """Quote a text for R, which has the same escapes as JSON."""
    return json.dumps(text, ensure_ascii=False)


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
        self._types: dict[int, ValueType | None] = {
            at: None for at, column in enumerate(self.columns) if column.type == "any"
        }
        """For each column whose type depends on its values, the type so far."""
        self._has_line_ends = False
        self.path = folder / schema.file
        self.file = TextIOWrapper(new_file(self.path), encoding="utf-8", errors="backslashreplace", newline="")
        self._rows = csv.writer(self.file, lineterminator="\n")
        self._rows.writerow([column.name for column in self.columns])

    def add(self, rows: Iterable[Any], facts: Iterable[str] = ()) -> None:
        for row in rows:
            self.add_row([*facts, *(cell(column.of(row)) for column in self.schema.columns)])

    def add_row(self, cells: list[str]) -> None:
        """Write a row with a cell for each column."""
        cells = [safe_cell(each) for each in cells] if self._safe else cells
        for at, each in enumerate(cells):
            if len(each) * 4 > self._widths[at]:
                self._widths[at] = max(self._widths[at], len(each.encode("utf-8", "backslashreplace")))
        for at, before in self._types.items():
            self._types[at] = type_of_values((cells[at],), before)
        self._has_line_ends = self._has_line_ends or any("\n" in each or "\r" in each for each in cells)
        self._rows.writerow(cells)

    def described(self) -> dict[str, object]:
        """Describe it for datapackage.json. The table must be closed."""
        with self.path.open("rb") as file:
            digest = hashlib.file_digest(file, "sha256").hexdigest()
        return resource(self.schema, self._typed_columns(), self.path.stat().st_size, digest)

    def for_codebook(self) -> DescribedTable:
        """Describe it for programs that read it."""
        schema, columns, widths = self.schema, tuple(self._typed_columns()), tuple(self._widths)
        return DescribedTable(schema.name, schema.file, schema.about, columns, widths, self._has_line_ends)

    def _typed_columns(self) -> list[Column]:
        return [
            replace(column, type=self._types[at] or "string") if at in self._types else column
            for at, column in enumerate(self.columns)
        ]


def _write(path: Path, sessions: Iterable[SessionData], context: ExportContext) -> None:
    path.mkdir(0o700)
    facts = [*FACTS, *(factor_column(name, context.study) for name in context.factors)]
    trials = replace(TRIALS, columns=(*TRIALS.columns, *map(declared_column, context.trial_columns or ())))
    wide = WideTable(context) if context.wide else None
    exported: list[tuple[SessionFacts, list[str]]] = []
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
            exported.append((data.facts, values))
            for table in tables:
                table.add(table.schema.rows(data), values)
            if wide is not None:
                wide.add(data)
        cells = {each.session: values for each, values in exported}
        answered = answers_at_level(context.study, context.level, (each for each, _ in exported), context.warnings)
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
    about = _ABOUT.format(
        sessions=f"{len(exported)} sessions" if len(exported) != 1 else "one session", level=context.level
    )
    about += f" {SAFE if context.spreadsheet_safe else UNSAFE}"
    published = package_facts(context.study.report) if context.study is not None else None
    package = data_package(name or "sessions", title, about, [table.described() for table in tables], published)
    described = [table.for_codebook() for table in tables]
    context.warnings += [
        f"{each.file} has cells of several lines, which SPSS takes for rows: {SPSS_FILE} leaves it out"
        for each in described
        if each.has_line_ends
    ]
    program_files = {SPSS_FILE: spss_text(described).encode(), R_FILE: r_text(described).encode()}
    for name, content in ({PACKAGE: package} | program_files).items():
        with new_file(path / name) as file:
            file.write(content)


def _questionnaire_table(answers: AnswersAtLevel, facts: Sequence[Column]) -> tuple[TableSchema, list[Column]]:
    """Return the table of a questionnaire and the facts in its rows: those of the session of its run, or those that all
    sessions of the participant share."""
    name = f"questionnaire_{answers.name}"
    if answers.settings.run:
        return TableSchema(name, answers.about, answers.columns, ("session",), _no_rows, SESSION_REFERENCES), list(
            facts
        )
    shared = [column for column in facts if column.name not in ("session", "run")]
    about = f"{answers.about} What differs between their sessions is empty."
    return TableSchema(name, about, answers.columns, ("participant",), _no_rows), shared


def _no_rows(data: SessionData) -> Iterator[Row]:
    """Give no rows, because this table has rows of participants instead."""
    return iter(())


def _add_answers(
    table: _OpenTable, answers: AnswersAtLevel, cells: Mapping[str, list[str]], places: Sequence[int]
) -> None:
    for sessions, row in answers.rows:
        values = [{cells[each.session][place] for each in sessions} for place in places]
        same = [next(iter(each)) if len(each) == 1 else "" for each in values]
        table.add_row([*same, *(cell(column.of(row)) for column in answers.columns)])


FORMAT = ExportFormat(
    name="tables",
    about="acts, cues, phases, events, trials, checks, sessions as CSV, described in datapackage.json",
    shape="folder",
    suffix="",
    write=_write,
    spreadsheet_safe=True,
)
