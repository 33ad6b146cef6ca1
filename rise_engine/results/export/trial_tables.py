"""The tables of participants: trials, answers to questionnaires, and the wide table with a row for each person."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from statistics import fmean
from typing import Any, TypeAlias

from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.base.text import name_some
from rise_engine.privacy.levels import ExportLevel, LevelFilter, cut_age
from rise_engine.results.analysis.model import SessionData, SessionFacts
from rise_engine.results.analysis.statistics import median
from rise_engine.results.analysis.trials import trials_of
from rise_engine.results.export.format import ExportContext, ExportError
from rise_engine.results.export.session_tables import SESSION_REFERENCES, factor_column
from rise_engine.results.export.table_schema import (
    TRIAL_ENDS,
    Column,
    Row,
    TableSchema,
    count,
    ends,
    interrupted,
    moment,
    numbering,
    outage_columns,
    seconds,
    wall_column,
)
from rise_engine.scenario.explore_settings import PARTICIPANT, SPEECH
from rise_engine.study.model import Participant, QuestionnaireSettings, Study
from rise_engine.study.participants import load_participants
from rise_engine.study.questionnaires import Answers, Questionnaire, load_questionnaire

_UNKNOWN_PARTICIPANT = "unknown-participant"
"""The diagnostic for a row of an unknown participant, which is omitted without any other effect."""


class AnswersAtLevel(Struct, frozen=True):
    """A questionnaire at an export level."""

    settings: QuestionnaireSettings
    columns: tuple[Column, ...]
    """One column for each item."""
    rows: tuple[tuple[tuple[SessionFacts, ...], Answers], ...]
    """Each row with its sessions: that of its run, or one of each run of the participant."""
    omitted: tuple[str, ...] = ()
    """Sentences on omitted rows."""

    @property
    def name(self) -> str:
        return self.settings.name

    @property
    def about(self) -> str:
        """A description of one row."""
        about = self.settings.about.rstrip(".")
        of_run = "a participant after a run" if self.settings.run else "a participant"
        return f"One row is what {of_run} answered in the questionnaire {self.name}{f' ({about})' if about else ''}."


def answers_at_level(
    study: Study | None, level: ExportLevel, sessions: Iterable[SessionFacts], warnings: list[str]
) -> list[AnswersAtLevel]:
    """Return the questionnaires of a study, for the participants in an export.

    :param study: the study; None: the sessions belong to none, or to several.
    :param level: the export level.
    :param sessions: the sessions of the export.
    :param warnings: gets sentences for the person who exports.
    :raises ExportError: a file has errors, so it cannot be exported.
    """
    if study is None or not study.questionnaires:
        return []
    people = load_participants(study).participants
    known = list(sessions)
    found = []
    for settings in study.questionnaires:
        read = load_questionnaire(study, settings, people)
        omitted = _report(read, warnings)
        if read.items:
            shown = _at_level(read, level, known, warnings)
            omitted += shown.omitted
            found.append(replace(shown, omitted=tuple(omitted)))
        warnings += omitted
    return found


def _report(read: Questionnaire, warnings: list[str]) -> list[str]:
    """Refuse a file with errors, and warn of omitted rows of unknown participants."""
    name = read.settings.name
    if wrong := [str(each) for each in read.errors if each.code != _UNKNOWN_PARTICIPANT]:
        raise ExportError(f"the questionnaire {name} cannot be exported; nothing was written", *wrong)
    if any(each.code == "no-questionnaire" for each in read.diagnostics):
        warnings.append(f"the questionnaire {name} is not in it: there is no file {read.settings.file} yet")
    lines = [each.location.line for each in read.errors]
    why = "participants.csv does not have the participant; `rise-engine study check` says more"
    return _omission_notes(read.settings, lines, why)


def _omission_notes(settings: QuestionnaireSettings, lines: Sequence[int], why: str) -> list[str]:
    return [f"{settings.file}, line {name_some(lines)}: left out, because {why}"] if lines else []


def _at_level(
    read: Questionnaire, level: ExportLevel, known: Sequence[SessionFacts], warnings: list[str]
) -> AnswersAtLevel:
    """Apply the level to typed answers, that is, to text items without levels."""
    settings, count = read.settings, LevelFilter(level, None).count_typed_words
    typed = [item.name for item in read.items if item.type == "string" and not item.levels]
    rows, nowhere = [], []
    for answers in read.rows:
        theirs = [each for each in known if each.participant == answers.participant]
        runs = dict.fromkeys(each.run for each in theirs if answers.run in (None, each.run))
        about = [_choose_attempt([each for each in theirs if each.run == run]) for run in runs]
        if about:
            values = {name: count(value) if name in typed else value for name, value in answers.values.items()}
            rows.append((tuple(about), replace(answers, values=values)))
        else:
            nowhere.append(answers.line)
    there = {(answers.participant, answers.run) for _, answers in rows}
    wanted = {(each.participant, each.run if settings.run else None) for each in known if each.participant}
    if missing := sorted({name for name, _ in wanted - there}):
        what = "every run of " if settings.run else ""
        warnings.append(f"the questionnaire {settings.name} has no row for {what}{', '.join(missing)}")
    columns = tuple(
        Column(
            item.name,
            item.about or f"The answer to {item.name}, from {settings.file}; empty: none.",
            lambda answers, name=item.name: answers.values[name],  # type: ignore[misc]
            item.type,
            levels=item.levels,
        )
        for item in read.items
    )
    omitted = _omission_notes(settings, nowhere, "there is no session of this participant and run in it")
    return AnswersAtLevel(settings, columns, tuple(rows), tuple(omitted))


def _choose_attempt(sessions: list[SessionFacts]) -> SessionFacts:
    """Choose the complete attempt among several; otherwise the last one."""
    complete = [each for each in sessions if each.outcome == "complete"]
    return (complete or sessions)[-1]


def answers_text(answered: AnswersAtLevel) -> str:
    """Write the file of a questionnaire at an export level. Reading it again gives the same."""
    settings = answered.settings
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    keys = [settings.key, *([settings.run] if settings.run else [])]
    rows.writerow([*keys, *(column.name for column in answered.columns)])
    for _, answers in answered.rows:
        run = [str(answers.run)] if settings.run else []
        rows.writerow([answers.participant, *run, *answers.values.values()])
    return text.getvalue()


def _trial_rows(data: SessionData) -> Iterator[Row]:
    return (Row(data, number, trial) for number, trial in enumerate(trials_of(data), 1))


TRIALS = TableSchema(
    "trials",
    "One row is one trial. [trials] in the scenario says where each begins.",
    (
        numbering("trial"),
        moment("start", "it began.", required=True),
        moment("end", "it ended.", required=True),
        seconds("duration_s", "From start to end."),
        Column("ended_by", "What ended it.", levels=TRIAL_ENDS, required=True),
        Column(
            "robot_said",
            "What the robot said first in the trial. If it said nothing, this column and the next three are empty.",
        ),
        Column(
            "asked_task",
            "The number of that act's task in the session's record.",
            lambda row: row.of.task,
            type="integer",
            minimum=1,
        ),
        moment("asked_at", "the robot confirmed its first action that uses the voice. The first sound comes later."),
        moment("asked_end", "its last action that uses the voice ended; empty: not said to its end, or unknown."),
        moment("cue_at", "the first cue from asked_at on was marked. Cues that were taken back do not count."),
        seconds(
            PARTICIPANT, "From asked_end to cue_at. Negative: the robot was still speaking at the cue.", minimum=None
        ),
        moment(
            "speech_at",
            "the participant first spoke from asked_at on, as annotated or else as an event said.",
        ),
        seconds(SPEECH, "From asked_end to speech_at. Negative: the robot was still speaking.", minimum=None),
        moment("key_at", "the wizard pressed the first key from cue_at on; without a cue, from asked_at on."),
        Column("wizard_key", "The key, if the scenario declares it. Empty: no key, or a key of the console."),
        Column("wizard_asked", "What the key requested: a function and its argument."),
        seconds("wizard_s", "From cue_at to key_at."),
        seconds("key_s", "From asked_end to key_at. Negative: the robot was still speaking at the key.", minimum=None),
        moment(
            "robot_next_at",
            "the robot acted next, from cue_at (without a cue: key_at) on, even after the trial: it confirmed an act's "
            "voice or, if the act does not speak, its first action.",
        ),
        count(
            "prompts",
            "Further acts that spoke from asked_end (if empty: asked_at) to cue_at; without a cue to key_at, without "
            "a key to the end.",
        ),
        count("repairs", "Corrections in the trial, counted as in sessions.csv."),
        Column(
            "events",
            "Events that wizards raised in the trial, directly or by a key whose rule raises them at once.",
            lambda row: " ; ".join(row.of.events),
        ),
        Column("marks", "Marks of the trial's tasks: wrong, late, early, double.", lambda row: " ".join(row.of.marks)),
        count("failures", "Acts, rules and expressions that failed in the trial."),
        count("stops", "How often everything was stopped in the trial."),
        *outage_columns("duration_s", "start", "end"),
        interrupted("participant_interrupted", "the time from asked_end to cue_at (without a cue: to key_at)"),
        interrupted("wizard_interrupted", "the time from cue_at to key_at"),
        wall_column(PARTICIPANT, ends("asked_end", "cue_at")),
        wall_column("wizard_s", ends("cue_at", "key_at")),
        wall_column("key_s", ends("asked_end", "key_at")),
        interrupted("speech_interrupted", "the time from asked_end to speech_at"),
        wall_column(SPEECH, ends("asked_end", "speech_at")),
    ),
    ("session", "trial"),
    _trial_rows,
    SESSION_REFERENCES,
)


def declared_column(name: str) -> Column:
    """Return a column that `[trials]` of a scenario declares.

    :param name: the memory key, or a part of its value.
    """
    taken = name in {column.name for column in TRIALS.columns}
    about = f"{name} in memory just before the trial ended; empty: it was not set."
    return Column(f"memory_{name}" if taken else name, about, lambda row: row.of.values.get(name), "any")


# --- one row for each participant -------------------------------------------------------------------------------------

ALL_CONDITIONS = "all"
"""The condition of sessions without one."""


class _WideRow(Struct):
    """A participant's trials so far."""

    sessions: int = 0
    between: dict[str, Any] = field(default_factory=dict)
    trials: dict[str, dict[str, list[float | None]]] = field(default_factory=dict)
    """For each condition and each measure, its value in each trial."""


_Person: TypeAlias = tuple[str, str]
"""Their study and pseudonym: different studies may have equal pseudonyms."""
_WideRowRow: TypeAlias = tuple[_Person, _WideRow]


class WideTable:
    """A table with a row for each participant, collected session by session."""

    def __init__(self, context: ExportContext) -> None:
        self._context = context
        self._study = context.study
        self._people: dict[_Person, _WideRow] = {}

    def add(self, data: SessionData) -> None:
        """Add a session if it counts and was not aborted."""
        facts = data.facts
        if facts.outcome not in ("complete", None) or facts.purpose not in ("counted", ""):
            return
        if facts.purpose == "counted" and facts.outcome is None:
            return
        between = self._between()
        within = [str(level) for name, level in facts.factors.items() if name not in between]
        condition = "+".join(within) if facts.factors else facts.condition
        person = self._people.setdefault((facts.study, facts.participant), _WideRow())
        person.sessions += 1
        person.between |= {name: level for name, level in facts.factors.items() if name in between}
        by_measure = person.trials.setdefault(condition or ALL_CONDITIONS, {})
        if data.scenario is not None and data.scenario.trials is not None:
            measure = data.scenario.trials.measure
            by_measure.setdefault(measure, []).extend(trial.number(measure) for trial in trials_of(data))

    def _between(self) -> set[str]:
        factors = self._study.factors if self._study is not None else ()
        return {each.name for each in factors if each.kind == "between"}

    def schema(self, answered: Iterable[AnswersAtLevel] = ()) -> TableSchema:
        """Return its columns. Each takes its value from a participant's name and trials.

        :param answered: the questionnaires of the export.
        """
        everybody = self._people.values()
        conditions = sorted({name for person in everybody for name in person.trials})
        named = Column(
            "participant", "The participant's pseudonym; empty: no participant was named.", lambda row: row[0][1]
        )
        several = len({study for study, _ in self._people}) > 1
        study = Column("study", "The study's id; empty: none.", lambda row: row[0][0])
        columns = [
            *([study] if several else []),
            named,
            *self._columns_of_people(),
            *(self._between_column(name) for name in sorted(self._between())),
            count("sessions", "Sessions that are complete, or belong to no study.", lambda row: row[1].sessions),
        ]
        for condition in conditions:
            columns.append(_count_of_trials(condition))
            for measure in dict.fromkeys(name for person in everybody for name in person.trials.get(condition, ())):
                columns += self._columns_of(condition, measure)
        for answers in answered:
            columns += _columns_of_answers(answers)
        key = (*(["study"] if several else []), "participant")
        if not all(study and name if several else name for study, name in self._people):
            key = ()  # several people without a name cannot be distinguished
        about = "One row is one participant: their trials in sessions that are complete, or belong to no study."
        return TableSchema("wide", about, tuple(columns), key, lambda data: iter(()))

    def rows(self) -> list[_WideRowRow]:
        """Return the source of its columns' values, one for each row."""
        return sorted(self._people.items(), key=lambda item: item[0])

    def _columns_of_people(self) -> Iterator[Column]:
        if self._study is None:
            return
        known: Mapping[str, Participant] = {
            each.participant: each for each in load_participants(self._study).participants
        }
        is_full = self._context.level == "full"
        for name in dict.fromkeys([*self._study.strata, *self._study.columns]):

            def value(row: _WideRowRow, name: str = name) -> str:
                person = known.get(row[0][1])
                text = (person.strata.get(name) or person.columns.get(name, "")) if person is not None else ""
                return text if is_full else cut_age(name, text)

            yield Column(name, f"{name}, from participants.csv.", value, "any")

    def _between_column(self, name: str) -> Column:
        described = factor_column(name, self._study)
        return Column(described.name, described.about, lambda row: row[1].between.get(name), levels=described.levels)

    def _columns_of(self, condition: str, measure: str) -> Iterator[Column]:
        def all_of(row: _WideRowRow) -> Sequence[float | None]:
            values: Sequence[float | None] = row[1].trials.get(condition, {}).get(measure, ())
            return values

        def known(row: _WideRowRow) -> list[float]:
            return [each for each in all_of(row) if each is not None]

        def measured(row: _WideRowRow) -> int | None:
            return len(known(row)) if measure in row[1].trials.get(condition, {}) else None

        where, block = f"in the condition {condition}", f"{measure}.{condition}"
        unit = "s" if measure.endswith("_s") else ""
        about = f"Trials {where} whose {measure} is a number; empty: no session that measures it."
        yield Column(f"{block}.measured", about, measured, "integer", minimum=0)
        about = f"of {measure} over the trials {where} that have one; empty: there are none."
        yield Column(f"{block}.median", f"Median {about}", lambda row: median(known(row)), "number", unit)
        yield Column(
            f"{block}.mean", f"Mean {about}", lambda row: fmean(known(row)) if known(row) else None, "number", unit
        )
        people = self._people.values()
        most = max((len(person.trials.get(condition, {}).get(measure, ())) for person in people), default=0)
        for at in range(most):

            def one(row: _WideRowRow, at: int = at) -> float | None:
                found = all_of(row)
                return found[at] if at < len(found) else None

            description = f"{measure} of trial {at + 1} {where}, in their order over the participant's sessions."
            yield Column(f"{block}.t{at + 1:02}", description, one, "number", unit)


def _count_of_trials(condition: str) -> Column:
    def number(row: _WideRowRow) -> int | None:
        theirs = row[1].trials.get(condition)
        return sum(map(len, theirs.values())) if theirs is not None else None

    about = f"Trials in the condition {condition}; empty: no such session."
    return Column(f"trials.{condition}", about, number, "integer", minimum=0)


def _columns_of_answers(answers: AnswersAtLevel) -> Iterator[Column]:
    """Give the columns of a questionnaire: `NAME.ITEM`, or `NAME.ITEM.run1`, ... if it is asked after each run."""
    rows = {(row.participant, row.run): row for _, row in answers.rows}
    for run in sorted({row.run for _, row in answers.rows}, key=lambda run: run or 0):
        of_run, after = (f".run{run}", f" After run {run}.") if run is not None else ("", "")
        for column in answers.columns:

            def value(row: _WideRowRow, column: Column = column, run: int | None = run) -> Any:
                found = rows.get((row[0][1], run))
                return column.of(found) if found is not None else None

            name, about = f"{answers.name}.{column.name}{of_run}", f"{column.about.rstrip('.')}.{after}"
            yield Column(name, about, value, column.type, levels=column.levels)
