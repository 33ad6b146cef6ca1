"""Questionnaires in an export: the answers of its participants as the level shows them, with columns described."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.text import name_some
from rise_engine.privacy.levels import ExportLevel, LevelFilter
from rise_engine.results.analysis.model import SessionFacts
from rise_engine.results.export.format import ExportError
from rise_engine.results.export.table_schema import Column
from rise_engine.study.model import QuestionnaireSettings, Study
from rise_engine.study.participants import load_participants
from rise_engine.study.questionnaires import Answers, Questionnaire, load_questionnaire

_NOT_HERE = "unknown-participant"
"""The diagnostic for a row of an unknown participant, which is left out without any other effect."""


class ToldAnswers(Struct, frozen=True):
    """A questionnaire as an export shows it."""

    settings: QuestionnaireSettings
    columns: tuple[Column, ...]
    """One column for each item."""
    rows: tuple[tuple[tuple[SessionFacts, ...], Answers], ...]
    """Each row with its sessions: that of its run, or one of each run of the participant."""
    left_out: tuple[str, ...] = ()
    """Sentences on rows that are not in it."""

    @property
    def name(self) -> str:
        return self.settings.name

    @property
    def about(self) -> str:
        """A description of one row."""
        told = self.settings.about.rstrip(".")
        of_run = "a participant after a run" if self.settings.run else "a participant"
        return f"One row is what {of_run} answered in the questionnaire {self.name}{f' ({told})' if told else ''}."


def told_answers(
    study: Study | None, level: ExportLevel, sessions: Iterable[SessionFacts], warnings: list[str]
) -> list[ToldAnswers]:
    """Return the questionnaires of a study, for the participants in an export.

    :param study: the study; None: the sessions belong to none, or to several.
    :param level: how much is shown.
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
        left_out = _report(read, warnings)
        if read.items:
            told = _told(read, level, known, warnings)
            left_out += told.left_out
            found.append(replace(told, left_out=tuple(left_out)))
        warnings += left_out
    return found


def _report(read: Questionnaire, warnings: list[str]) -> list[str]:
    """Refuse a file with errors, and say whose rows are left out because nobody knows them."""
    name = read.settings.name
    if wrong := [str(each) for each in read.errors if each.code != _NOT_HERE]:
        raise ExportError(f"the questionnaire {name} cannot be exported; nothing was written", *wrong)
    if any(each.code == "no-questionnaire" for each in read.diagnostics):
        warnings.append(f"the questionnaire {name} is not in it: there is no file {read.settings.file} yet")
    lines = [each.location.line for each in read.errors]
    why = "participants.csv does not have the participant; `rise-engine study check` says more"
    return _left_out(read.settings, lines, why)


def _left_out(settings: QuestionnaireSettings, lines: Sequence[int], why: str) -> list[str]:
    return [f"{settings.file}, line {name_some(lines)}: left out, because {why}"] if lines else []


def _told(read: Questionnaire, level: ExportLevel, known: Sequence[SessionFacts], warnings: list[str]) -> ToldAnswers:
    """Apply the level to typed answers, that is, to text items without levels."""
    settings, count = read.settings, LevelFilter(level, None).count_typed_words
    typed = [item.name for item in read.items if item.type == "string" and not item.levels]
    rows, nowhere = [], []
    for answers in read.rows:
        theirs = [each for each in known if each.participant == answers.participant]
        runs = dict.fromkeys(each.run for each in theirs if answers.run in (None, each.run))
        about = [_of_run([each for each in theirs if each.run == run]) for run in runs]
        if about:
            told = {name: count(value) if name in typed else value for name, value in answers.values.items()}
            rows.append((tuple(about), replace(answers, values=told)))
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
    left_out = _left_out(settings, nowhere, "there is no session of this participant and run in it")
    return ToldAnswers(settings, columns, tuple(rows), tuple(left_out))


def _of_run(sessions: list[SessionFacts]) -> SessionFacts:
    """Choose among several attempts the one that counts, or else the last one."""
    complete = [each for each in sessions if each.outcome == "complete"]
    return (complete or sessions)[-1]


def answers_text(told: ToldAnswers) -> str:
    """Write the file of a questionnaire as an export shows it. Reading it again gives the same."""
    settings = told.settings
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    keys = [settings.key, *([settings.run] if settings.run else [])]
    rows.writerow([*keys, *(column.name for column in told.columns)])
    for _, answers in told.rows:
        run = [str(answers.run)] if settings.run else []
        rows.writerow([answers.participant, *run, *answers.values.values()])
    return text.getvalue()
