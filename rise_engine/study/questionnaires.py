"""Questionnaires: `[questionnaire.NAME]` of study.toml, and the file from a survey tool (docs/reference/study.md).

The file is only read. Its rows are joined to the sessions by the participant's pseudonym, and by the run if the
questionnaire is asked after each run.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.base.nearest_name import did_you_mean, in_backquotes, limited_comparisons
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.files.study_paths import why_no_name, why_not_read
from rise_engine.scenario.files.toml_files import TomlTable
from rise_engine.scenario.model import SourceLocation
from rise_engine.scenario.settings import names_in
from rise_engine.study.csv_table import WHY, CsvRow, CsvTable, mail_address_in, personal_column, read_csv
from rise_engine.study.model import ItemDescription, Participant, QuestionnaireSettings, Study
from rise_engine.study.settings import STUDY_TABLES

SUFFIXES = (".csv", ".tsv", ".txt")
COLUMNS_OF_TABLES = ("session", "participant", "run", "condition", "mode", "purpose", "outcome")
"""Column names that tables already use. No item may have one."""
FACTOR_PREFIX = "factor_"
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*\Z")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z", re.ASCII)
_KEYS = tuple(names_in(STUDY_TABLES, "questionnaire.*"))
_ITEM_KEYS = ("about", "levels")
_QUALTRICS = '{"ImportId"'
"""The start of every cell in the third line of a Qualtrics file, whose second line has the questions."""


ValueType: TypeAlias = Literal["integer", "number", "string"]


class Item(Struct, frozen=True):
    """An exported column of a questionnaire."""

    name: str
    about: str
    levels: Mapping[str, str]
    type: ValueType
    """From the values in the file."""


class Answers(Struct, frozen=True):
    """One row: the answers of a participant."""

    participant: str
    run: int | None
    """None: the questionnaire is not asked after each run."""
    values: dict[str, str]
    """Values by item. Empty: no answer."""
    line: int


class Questionnaire(Struct, frozen=True):
    settings: QuestionnaireSettings
    items: tuple[Item, ...]
    rows: tuple[Answers, ...]
    """The rows of the study's participants, in the order of the file."""
    diagnostics: list[Diagnostic]

    @property
    def errors(self) -> list[Diagnostic]:
        return [each for each in self.diagnostics if each.severity == "error"]


def read_questionnaires(study: TomlTable, folder: Path) -> tuple[QuestionnaireSettings, ...]:
    """Read the settings of all questionnaires.

    :param study: the whole study.toml.
    :param folder: the study's folder.
    """
    table = study.section("questionnaire")
    return tuple(found for name in table.values if (found := _read_settings(table, name, folder)) is not None)


def _read_settings(all_tables: TomlTable, name: str, folder: Path) -> QuestionnaireSettings | None:
    table = all_tables.subtable(name, f"a questionnaire is a table: [questionnaire.{name}]")
    if table is None:
        return None
    if not _NAME.match(name):
        message = f"a questionnaire has a name of letters, digits and `_`, beginning with a letter, not `{name}`"
        all_tables.report_key("bad-name", message, name)
    table.report_unknown_keys(_KEYS)
    file = table.read("file", str, "", form=f': file = "questionnaires/{name}.csv"').strip()
    if not file:
        table.report_key("missing-value", f'`file` is missing; write file = "questionnaires/{name}.csv"')
    elif problem := why_no_name(file, SUFFIXES):
        table.report_value("bad-name", "file", problem)
    elif problem := why_not_read(folder, file):
        table.report_value("outside-study", "file", problem)
    key = table.read("key", str, "participant", form=': the column that names the participant: key = "participant"')
    return QuestionnaireSettings(
        name=name,
        file=file,
        key=key,
        run=table.read("run", str, "", form=': the column that says which run: run = "session"'),
        columns=_read_columns(table),
        leave_out=table.read_texts("leave_out", ()),
        about=table.read("about", str, "", form=': about = "Godspeed Questionnaire Series"').strip(),
    )


def _read_columns(table: TomlTable) -> dict[str, ItemDescription]:
    columns = table.section("columns")
    found: dict[str, ItemDescription] = {}
    for name, value in columns.values.items():
        if isinstance(value, str):
            found[name] = ItemDescription(value)
            continue
        item = columns.subtable(name, f'`{name}` is a text, or a table: {name} = {{ about = "...", levels = {{ }} }}')
        if item is None:
            continue
        item.report_unknown_keys(_ITEM_KEYS)
        levels = item.section("levels")
        texts = {level: levels.read(level, str, "", form=f': {level} = "not at all"') for level in levels.values}
        found[name] = ItemDescription(item.read("about", str, "", form=': about = "..."'), texts)
    return found


def load_questionnaire(
    study: Study,
    settings: QuestionnaireSettings,
    people: Iterable[Participant],
    *,
    runs: int = 0,
    has_withdrawn: Callable[[str], bool] = lambda name: False,
) -> Questionnaire:
    """Read and check the file of a questionnaire.

    :param study: the study.
    :param settings: the questionnaire.
    :param people: the rows of participants.csv.
    :param runs: the number of runs of a participant; 0: any number.
    :param has_withdrawn: whether a participant who is no longer in participants.csv has withdrawn.
    :return: its rows and all errors; a missing file is a warning.
    """
    diagnostics = Diagnostics()
    folder = Path(study.folder)
    if not settings.file or not (folder / settings.file).exists():
        message = f"there is no such file yet; put what the survey tool gave there: [questionnaire.{settings.name}]"
        diagnostics.warning("no-questionnaire", SourceLocation(settings.file), message)
        return Questionnaire(settings, (), (), diagnostics.sorted())
    with limited_comparisons():
        table = read_csv(folder, settings.file, diagnostics, most_columns=2_000)
        if table is None:
            return Questionnaire(settings, (), (), diagnostics.sorted())
        names = {each.participant for each in people}
        reader = _AnswersReader(settings, table, names, has_withdrawn, runs, study)
        items, rows = reader.read()
    return Questionnaire(settings, items, rows, diagnostics.sorted())


def find_missing(
    questionnaire: Questionnaire, took_part: Iterable[tuple[str, int]], people: Iterable[Participant]
) -> list[Diagnostic]:
    """Warn of participants who took part and have no row, at their line of participants.csv. Also warn of rows of
    participants who did not take part, which no export contains.

    :param questionnaire: the questionnaire.
    :param took_part: participants with their runs.
    :param people: the rows of participants.csv.
    """
    diagnostics = Diagnostics()
    settings = questionnaire.settings
    there = {(each.participant, each.run) for each in questionnaire.rows}
    lines = {each.participant: each.line for each in people}
    wanted = dict.fromkeys((name, run if settings.run else None) for name, run in took_part)
    for name, run in wanted:
        if name in lines and (name, run) not in there:
            of_run = f" for run {run}" if run is not None else ""
            message = f"`{name}` has no row{of_run} in {settings.file} (questionnaire {settings.name})"
            diagnostics.warning("no-answers", SourceLocation("participants.csv", lines[name]), message)
    for each in questionnaire.rows:
        if (each.participant, each.run) not in wanted:
            of_run = f", run {each.run}," if each.run is not None else ""
            message = f"`{each.participant}`{of_run} has no session that counts, so no export has this row"
            diagnostics.warning("no-session", SourceLocation(settings.file, each.line), message)
    return diagnostics.sorted()


class _AnswersReader:
    """Reader of one file."""

    def __init__(
        self,
        settings: QuestionnaireSettings,
        table: CsvTable,
        names: set[str],
        has_withdrawn: Callable[[str], bool],
        runs: int,
        study: Study,
    ) -> None:
        self.settings = settings
        self.table = table
        self.diagnostics = table.diagnostics
        self.names = names
        self.has_withdrawn = has_withdrawn
        self.runs = runs
        self.study_factors = [each.name for each in study.factors]
        self.questions: dict[str, str] = {}
        """The question of each item, if the file has it."""

    def read(self) -> tuple[tuple[Item, ...], tuple[Answers, ...]]:
        rows = self.rows_of_people()
        names = self.item_names()
        is_whole = not self.diagnostics.errors
        answers = tuple(found for row in rows if (found := self.read_row(row, names)) is not None)
        self.report_doubles(answers, rows)
        return (tuple(self.item(name, answers) for name in names), answers) if is_whole else ((), ())

    def rows_of_people(self) -> list[CsvRow]:
        """Return the rows without the two lines in which Qualtrics describes its columns."""
        rows = self.table.rows
        if len(rows) > 1 and any(each.startswith(_QUALTRICS) for each in rows[1].values.values()):
            self.questions = {name: " ".join(text.split()) for name, text in rows[0].values.items()}
            return rows[2:]
        return rows

    def item_names(self) -> list[str]:
        """Return the columns to export, and report errors in columns."""
        settings, table = self.settings, self.table
        here = f"[questionnaire.{settings.name}]"
        wanted = [settings.key, *([settings.run] if settings.run else [])]
        for column in wanted:
            if column not in table.columns:
                near = did_you_mean(column, table.columns, limit=0)
                of = "run" if column == settings.run and column != settings.key else "key"
                message = f"there is no column `{column}`, which {here} {of} names{near}"
                self.diagnostics.error("missing-column", table.column_location(column), message)
        for column in (*settings.leave_out, *settings.columns):
            if column not in table.columns:
                near = did_you_mean(column, table.columns, limit=0)
                if column in settings.leave_out and not near:
                    continue
                message = f"there is no column `{column}`, which {here} names{near}"
                self.diagnostics.warning("unknown-column", table.column_location(column), message)
        items = [each for each in table.columns if each not in wanted and each not in settings.leave_out]
        for column in table.columns:
            if column != settings.key and (kind := personal_column(column)):
                message = f"the column `{column}` seems to hold {kind}: {WHY}. Delete it from the file, or rename it"
                self.diagnostics.error("personal-data", table.column_location(column), message)
        taken = {*COLUMNS_OF_TABLES, *(f"{FACTOR_PREFIX}{name}" for name in self.study_factors)}
        for column in items:
            if column.casefold() in taken:
                message = f"tables have a column `{column.casefold()}` of another meaning: rename it in the file, or "
                message += f'leave it out: {here} leave_out = ["{column}"]'
                self.diagnostics.error("bad-name", table.column_location(column), message)
        return items

    def read_row(self, row: CsvRow, items: Iterable[str]) -> Answers | None:
        """Read a participant's answers. None, with a diagnostic, for a row of an unknown participant."""
        settings, table = self.settings, self.table
        name = row.values.get(settings.key)
        for column, value in row.values.items():
            if mail := mail_address_in(value):
                table.report(row, column, "personal-data", f"`{mail}` looks like a mail address: {WHY}")
        if name is None:  # the column is missing
            self.check_levels(row, items)
            return None
        if name not in self.names or self.has_withdrawn(name):
            self.diagnostics.error("unknown-participant", table.location(row, settings.key), self.unknown(name))
            return None
        self.check_levels(row, items)
        run = self.read_run(row) if settings.run in table.columns else None
        if settings.run and run is None:
            return None
        values = {item: row.values[item] for item in items}
        return Answers(name, run, values, table.location(row, settings.key).line)

    def check_levels(self, row: CsvRow, items: Iterable[str]) -> None:
        for item in items:
            value, described = row.values[item], self.settings.columns.get(item)
            if described is not None and described.levels and value and value not in described.levels:
                levels = in_backquotes(described.levels)
                message = f"`{item}` is one of {levels}, not `{value}`{did_you_mean(value, described.levels, limit=0)}"
                self.table.report(row, item, "wrong-value", message)

    def unknown(self, name: str) -> str:
        if not name:
            return "this row names no participant: delete it, or add the pseudonym"
        if self.has_withdrawn(name):
            return f"`{name}` has withdrawn: delete this row yourself, because nothing but people writes in this file"
        near = did_you_mean(name, sorted(self.names), limit=0)
        return f"participants.csv has no `{name}`, so this row is left out of exports{near}"

    def read_run(self, row: CsvRow) -> int | None:
        text = row.values[self.settings.run]
        most = self.runs or 10_000
        if text.isascii() and text.isdigit() and 1 <= int(text) <= most:
            return int(text)
        limit = f" to {self.runs}" if self.runs else ""
        message = f"`{self.settings.run}` says which run it was, a whole number from 1{limit}, not `{text}`"
        self.table.report(row, self.settings.run, "wrong-value", message)
        return None

    def report_doubles(self, answers: Iterable[Answers], rows: Iterable[CsvRow]) -> None:
        by_line = {self.table.location(row, self.settings.key).line: row for row in rows}
        first: dict[tuple[str, int | None], int] = {}
        for each in answers:
            before = first.setdefault((each.participant, each.run), each.line)
            if before != each.line:
                what = f"`{each.participant}`" + (f", run {each.run}," if each.run is not None else "")
                message = f"{what} is in line {before} already: delete the row that does not count"
                self.table.report(by_line[each.line], self.settings.key, "duplicate-name", message)

    def item(self, name: str, answers: Iterable[Answers]) -> Item:
        described = self.settings.columns.get(name, ItemDescription())
        kind = type_of_values(each.values[name] for each in answers) or "string"
        return Item(name, described.about or self.questions.get(name, ""), described.levels, kind)


def type_of_values(values: Iterable[str], before: ValueType | None = None) -> ValueType | None:
    """Return the type that fits all values of a column except empty ones. None: all are empty.

    :param values: as in a table.
    :param before: the type of values that were already read.

    >>> type_of_values(["1", "", "-2"]), type_of_values(["2.5"], "integer"), type_of_values(["2", "two"])
    ('integer', 'number', 'string')
    """
    found = before
    for each in filter(None, values):
        if found == "string" or not _NUMBER.match(each):
            return "string"
        if found != "number":
            found = "integer" if each.lstrip("+-").isdigit() else "number"
    return found
