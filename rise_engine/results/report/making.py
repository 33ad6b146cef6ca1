"""Makes the report of a session or a study from its folder, read once at one level.

`analysis.reading` gives the contents. Only replays, and a study's plan and progress, are read separately.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.text import pluralize
from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.reading import read_session, read_sessions
from rise_engine.results.report.document import Document
from rise_engine.results.report.session_report import session_report
from rise_engine.results.report.sheet import sheet_markdown
from rise_engine.results.report.study_facts import study_figures
from rise_engine.results.report.study_report import StudyReportInput, study_report
from rise_engine.session.replay import ReplayComparison, compare_replay
from rise_engine.study.checks import checks_after
from rise_engine.study.sessions import StudySession
from rise_engine.study.state import StudyStatus, read_state
from rise_engine.study.traces import count_withdrawn


class MadeReport(Struct, frozen=True):
    """A report with its sources."""

    document: Document
    folders: tuple[Path, ...]
    """The sessions in it."""
    problems: tuple[str, ...] = ()
    """Sentences about unreadable parts."""
    sheet: str = ""
    """The reporting sheet of a study as Markdown."""


def make_session_report(
    folder: Path,
    level: ExportLevel = "full",
    private: Iterable[str] = (),
    label: Callable[[str], str] | None = None,
) -> MadeReport:
    """Make the report of one session, which may be running, torn or damaged.

    :param folder: the session's folder.
    :param level: the export level.
    :param private: private memory keys in addition to the scenario's.
    :param label: maps a condition to its label, for readers who must stay blinded.
    :raises SessionError: nothing can be read, or the private keys are unknown.
    """
    data = read_session(folder, level=level, private=private)
    if label is not None and (shown := label(data.facts.condition)) != data.facts.condition:
        data = replace(data, facts=replace(data.facts, condition=shown, factors={}))
    return MadeReport(session_report(data, replay_words(folder)), (folder,), data.problems)


def make_study_report(
    folder: Path,
    level: ExportLevel = "full",
    private: Iterable[str] = (),
    *,
    conditions: bool = False,
    omitted: Mapping[str, int] | None = None,
) -> MadeReport:
    """Make the report of a study over all its sessions. It counts the complete ones and lists the others.

    :param folder: the study's folder.
    :param level: the export level.
    :param private: private memory keys in addition to the scenario's.
    :param conditions: show conditions even if the study hides them and is not complete.
    :param omitted: for a bundle: the number of omitted rehearsals, by their purpose.
    :raises rise_engine.base.errors.FileError: the study's files have errors.
    :raises rise_engine.study.study_log.StudyLogError: its log cannot be read.
    """
    state = read_state(folder)
    problems = [
        *state.interrupted,
        *state.damaged,
        *(f"{name}: {sentence}" for name, sentence in state.repeated.items()),
        *(f"{each.name} {each.missing}" for each in _kept(state) if each.info is None),
    ]
    folders = report_folders(state)

    def note_unreadable(path: Path, error: SessionError) -> None:
        problems.append(f"{path.name} cannot be read: {error}")

    sessions = read_sessions(folders, level=level, private=private, on_unreadable=note_unreadable)
    figures = study_figures(sessions, checks_after(state.log))
    problems += [f"{row.facts.session}: {each}" for row in figures.rows for each in row.problems]
    complete = state.standing.complete >= state.standing.wanted
    given = StudyReportInput(
        state.study,
        state.standing,
        figures,
        level,
        shows_conditions=conditions or complete or not state.study.assignment.hidden,
        withdrawn=count_withdrawn(state.log),
        problems=(*problems, *(f"{each.name} {each.without_end}" for each in _kept(state) if each.without_end)),
        omitted=dict(omitted or {}),
    )
    sheet = sheet_markdown(state.study, given.sheet)
    return MadeReport(study_report(given), tuple(folders), tuple(problems), sheet)


def report_folders(state: StudyStatus) -> list[Path]:
    """Return the sessions for a study's report: those that are not running."""
    return [each.path for each in _kept(state) if each.info is not None and each.entry.status != "running"]


def _kept(state: StudyStatus) -> list[StudySession]:
    return [each for each in state.sessions if each.entry.participant not in state.places.withdrawn]


def replay_words(folder: Path) -> str:
    """Return in a few words whether a session replays identically, without any recorded content.

    :param folder: the session's folder.
    """
    try:
        return _verdict(compare_replay(folder))
    except SessionError:
        return "cannot be replayed; rise-engine replay says why"


def _verdict(found: ReplayComparison) -> str:
    if found.identical:
        return f"identical: {pluralize(found.inputs, 'input')}, {pluralize(found.records, 'record')}"
    if found.difference is not None:
        return f"different from record {found.difference.seq} on ({found.difference.kind})"
    return f"identical as far as it can be read: {pluralize(found.records, 'record')}"
