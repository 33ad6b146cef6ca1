"""The participants of a study under their pseudonyms, and the kinds of session that they can have.

participants.csv (docs/reference/study.md) is only read, never written. A kind of session is a condition in one of the
participants' languages, into which the scenario must have translations.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from contextlib import suppress
from datetime import date, datetime
from itertools import product
from pathlib import Path

from msgspec import Struct

from rise_engine.base.nearest_name import did_you_mean, in_backquotes, limited_comparisons, nearest_name
from rise_engine.base.text import pluralize
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.scenario.diagnostics import Diagnostic, Diagnostics
from rise_engine.scenario.files.study_paths import PARTICIPANTS_FILE as PARTICIPANTS_FILE
from rise_engine.scenario.files.study_paths import STUDY_FILE
from rise_engine.scenario.files.tree import Held
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario, SourceLocation
from rise_engine.study.csv_table import WHY, CsvRow, CsvTable, mail_address_in, personal_column, read_csv
from rise_engine.study.model import LANGUAGE, Participant, PlannedRun, Study
from rise_engine.study.plan import planned_run

STATUSES = ("invited", "excluded")
CONSENT_PREFIX = "consent_"
_PSEUDONYM = re.compile(r"[A-Za-z0-9]+\Z")
_ISO_DATE = re.compile(r"\d{4}-\d{2}-\d{2}\Z", re.ASCII)
_OTHER_DATES = ("%d.%m.%Y", "%d.%m.%y", "%Y/%m/%d", "%Y%m%d", "%d-%m-%Y")


class ParticipantsLoad(Struct, frozen=True):
    """The result of reading participants.csv."""

    participants: tuple[Participant, ...]
    """Participants in the file's order. Rows with errors are included as far as they are readable."""
    diagnostics: list[Diagnostic]

    @property
    def errors(self) -> list[Diagnostic]:
        return [diagnostic for diagnostic in self.diagnostics if diagnostic.severity == "error"]


def load_participants(study: Study, held: Held | None = None) -> ParticipantsLoad:
    """Read and check a study's participants.

    :param study: the study, which defines the columns and their values.
    :param held: contents that are used instead of the files on the disk, by file name.
    :return: the participants and all errors; a missing file is an error too.
    """
    diagnostics = Diagnostics()
    folder = Path(study.folder)
    if not (folder / PARTICIPANTS_FILE).exists() and PARTICIPANTS_FILE not in (held or {}):
        message = f"there is no {PARTICIPANTS_FILE} beside study.toml; its first line is {header_line(study)}"
        diagnostics.error("unreadable", SourceLocation(PARTICIPANTS_FILE), message)
        return ParticipantsLoad((), diagnostics.sorted())
    with limited_comparisons():
        table = read_csv(folder, PARTICIPANTS_FILE, diagnostics, held)
        participants = _ParticipantsReader(study, table).read() if table is not None else ()
    return ParticipantsLoad(participants, diagnostics.sorted())


def columns_of(study: Study) -> list[str]:
    """Return the columns of participants.csv that the study defines."""
    consents = [f"{CONSENT_PREFIX}{name}" for name in study.consent]
    return ["participant", *study.strata, *consents, "status", "comment", *study.columns]


def header_line(study: Study) -> str:
    """Return the first line of participants.csv."""
    return ",".join(columns_of(study))


class _ParticipantsReader:
    def __init__(self, study: Study, table: CsvTable) -> None:
        self.study = study
        self.table = table
        self.diagnostics = table.diagnostics

    def read(self) -> tuple[Participant, ...]:
        self.check_columns()
        seen: dict[str, int] = {}
        return tuple(self.read_row(row, seen) for row in self.table.rows)

    def check_columns(self) -> None:
        study, table = self.study, self.table
        personal = [column for column in table.columns if personal_column(column)]
        for column in personal:
            message = f"the column `{column}` seems to hold {personal_column(column)}: {WHY}"
            self.diagnostics.error("personal-data", table.column_location(column), message)
        needed = ["participant", *study.strata, *(f"{CONSENT_PREFIX}{name}" for name in study.consent)]
        missing = [column for column in needed if column not in table.columns]
        further = [
            column
            for column in table.columns
            if column.startswith(CONSENT_PREFIX) and nearest_name(column, missing) is None  # a further consent
        ]
        remedy = "; write it into study.toml if it is meant: [participants] columns = [...]"
        self.check_recording_consent()
        table.check_columns(needed, ["status", "comment", *study.columns, *further, *personal], remedy)

    def check_recording_consent(self) -> None:
        """Warn if the consent column is missing: then nobody is recorded, perhaps by mistake."""
        recording, table = self.study.recording, self.table
        column = f"{CONSENT_PREFIX}{recording.consent}"
        if not (recording.recorders or recording.sync) or column in table.columns:
            return
        if recording.consent not in self.study.consent:  # otherwise the missing column is an error anyway
            consents = [each for each in table.columns if each.startswith(CONSENT_PREFIX)]
            example = consents[0].removeprefix(CONSENT_PREFIX) if consents else "study"
            near = did_you_mean(column, consents, limit=0) or ";"
            message = f"there is no column `{column}`, so no participant is recorded{near} "
            message += f'add it, or name another one in study.toml: [recording] consent = "{example}"'
            self.diagnostics.warning("no-recording-consent", SourceLocation(PARTICIPANTS_FILE), message)

    def read_row(self, row: CsvRow, seen: dict[str, int]) -> Participant:
        values = row.values
        name = values.get("participant", "")
        line = self.table.location(row, "participant").line
        for column, value in values.items():
            if mail := mail_address_in(value):
                self.table.report(row, column, "personal-data", f"`{mail}` looks like a mail address: {WHY}")
        self.check_name(row, name, line, seen)
        status = values.get("status", "")
        if status not in ("", *STATUSES):
            near = did_you_mean(status, STATUSES, limit=0)
            message = f"`status` is {in_backquotes(STATUSES)} or empty, not `{status}`{near}"
            self.table.report(row, "status", "wrong-value", message)
        return Participant(
            participant=name,
            strata={column: self.read_stratum(row, column, status) for column in self.study.strata},
            consent={
                column.removeprefix(CONSENT_PREFIX): self.read_date(row, column)
                for column in self.table.columns
                if column.startswith(CONSENT_PREFIX)
            },
            status=status,
            columns={column: values[column] for column in self.study.columns if column in values},
            comment=values.get("comment", ""),
            line=line,
        )

    def check_name(self, row: CsvRow, name: str, line: int, seen: dict[str, int]) -> None:
        if "participant" not in self.table.columns:
            return
        if not name:
            message = "this row has no participant: a pseudonym of letters and digits, as P07"
            self.table.report(row, "participant", "missing-value", message)
        elif mail_address_in(name):
            return
        elif not _PSEUDONYM.match(name):
            message = f"a pseudonym has letters and digits only (A-Z, a-z, 0-9), as P07, not `{name}`: {WHY}"
            self.table.report(row, "participant", "bad-name", message)
        elif (before := seen.setdefault(name.casefold(), line)) != line:
            message = f"`{name}` is in line {before} already; upper and lower case make no difference"
            self.table.report(row, "participant", "duplicate-name", message)

    def read_stratum(self, row: CsvRow, column: str, status: str) -> str:
        value = row.values.get(column, "")
        known = self.study.strata[column]
        if column not in self.table.columns or value in known or (not value and status == "excluded"):
            return value
        near = did_you_mean(value, known, limit=0) if value else ""
        what = f"not `{value}`{near}" if value else "and must be there: the plan is balanced in it"
        self.table.report(row, column, "wrong-value", f"`{column}` is one of {in_backquotes(known)}, {what}")
        return value

    def read_date(self, row: CsvRow, column: str) -> str:
        value = row.values.get(column, "")
        if not value:
            return ""
        if _ISO_DATE.match(value):
            with suppress(ValueError):
                return date.fromisoformat(value).isoformat()
        meant = _to_iso_date(value)
        message = f"`{value}` is not a date; write {meant or 'year-month-day, as 2026-11-21'}"
        if meant:
            message = f"dates are written year-month-day: `{meant}`, not `{value}` (Excel changes them; format the "
            message += "column as text)"
        self.table.report(row, column, "wrong-value", message)
        return ""


def _to_iso_date(text: str) -> str:
    """Return the ISO date of a date in another form, or an empty text."""
    for form in _OTHER_DATES:
        with suppress(ValueError):
            return datetime.strptime(text, form).date().isoformat()
    return ""


# --- kinds of session -------------------------------------------------------------------------------------------------


def check_languages(
    study: Study, people: Iterable[Participant], scenarios: Mapping[str, Scenario], diagnostics: Diagnostics
) -> None:
    """Report languages that a scenario lacks, and translations that are incomplete.

    A scenario without translations is not checked if it has no `language`, or if the language comes from
    participants.csv.

    :param people: the rows of participants.csv.
    :param scenarios: by absolute folder.
    """
    wanted = languages_of(study, people)
    for folder, scenario in scenarios.items():
        known = [*filter(None, (scenario.language, *scenario.languages))]
        for language, location in wanted.items():
            if not scenario.languages and (not scenario.language or location.file != STUDY_FILE):
                continue
            if language not in known:
                near = did_you_mean(language, known, limit=0) or f"; it is in {in_backquotes(known)}"
                message = f"the scenario {Path(folder).name} is not in the language `{language}`{near}"
                diagnostics.error("unknown-language", location, message)
                continue
            errors = load(folder, robot=study.robot or None, mode=study.mode, language=language).errors
            if errors:
                more = f", and {pluralize(len(errors) - 1, 'more error')}" if len(errors) > 1 else ""
                message = f"sessions in `{language}` are refused: {errors[0].message}{more}"
                diagnostics.error("not-translated", location, message)


def languages_of(study: Study, people: Iterable[Participant]) -> dict[str, SourceLocation]:
    """Return every value of `language` (a factor, stratum or column of participants) with its first place."""
    found: dict[str, SourceLocation] = {}
    for factor in study.factors:
        if factor.name == LANGUAGE:
            found.update((level.name, SourceLocation(STUDY_FILE)) for level in factor.levels)
    for tag in study.strata.get(LANGUAGE, ()):
        found.setdefault(tag, SourceLocation(STUDY_FILE))
    for participant in people:
        tag = {**participant.columns, **participant.strata}.get(LANGUAGE, "").strip()
        if tag and participant.status != "excluded":
            found.setdefault(tag, SourceLocation(PARTICIPANTS_FILE, participant.line))
    return found


class SessionKind(Struct, frozen=True):
    """A group of sessions that begin in the same way."""

    run: PlannedRun
    language: str = ""
    """Empty: the language of the acts."""

    @property
    def name(self) -> str:
        """A name for people: `polite+AB (de)`. Empty: there is only one kind."""
        if self.run.condition and self.language:
            return f"{self.run.condition} ({self.language})"
        return self.run.condition or self.language

    def first_input(self, study: Study) -> SessionStarted:
        """Return the first input of such a session."""
        return SessionStarted(
            condition=self.run.condition,
            factors=dict(self.run.factors),
            study=study.id,
            memory=dict(self.run.memory),
        )


def session_kinds(
    study: Study, people: Iterable[Participant], scenarios: Mapping[str, Scenario]
) -> tuple[SessionKind, ...]:
    """Return every kind of session, in the order of study.toml.

    :param study: the study.
    :param people: from participants.csv, where a further column can determine the language.
    :param scenarios: the scenarios without errors, by absolute folder; kinds with other scenarios are omitted.
    """
    names = [factor.name for factor in study.factors]
    spoken = list(languages_of(study, people))
    kinds: list[SessionKind] = []
    for levels in product(*([level.name for level in factor.levels] for factor in study.factors)):
        run = planned_run(study, dict(zip(names, levels, strict=True)))
        scenario = scenarios.get(run.scenario)
        if scenario is None:
            continue
        own = [run.factors[LANGUAGE]] if LANGUAGE in run.factors else spoken
        known = [language for language in own if language in (scenario.language, *scenario.languages)]
        kinds += [SessionKind(run, language) for language in known if scenario.languages] or [SessionKind(run)]
    return tuple(kinds)
