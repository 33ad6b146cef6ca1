"""From a folder to its report: a session's or a study's, read once, at one level.

What reports tell comes from `analysis.reading` alone; beside it only whether a session replays is looked
at, and of a study its plan and how it stands.
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
from rise_engine.study.checked import checks_after
from rise_engine.study.sessions import StudySession
from rise_engine.study.state import StudyStatus, read_state
from rise_engine.study.withdrawn import withdrawn_of


class MadeReport(Struct, frozen=True):
    """A report, and what it was made of."""

    document: Document
    folders: tuple[Path, ...]
    """The sessions that it tells of."""
    problems: tuple[str, ...] = ()
    """What could not be read, in sentences."""
    sheet: str = ""
    """Of a study: its reporting sheet as Markdown."""


def make_session_report(
    folder: Path,
    level: ExportLevel = "full",
    private: Iterable[str] = (),
    label: Callable[[str], str] | None = None,
) -> MadeReport:
    """The report of one session; also of one that runs, is torn or damaged.

    :param folder: the session's.
    :param level: how much is told.
    :param private: further private memory keys.
    :param label: how the condition is called for whoever must not know what it stands for.
    :raises SessionError: nothing can be read, or nobody can say what is private.
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
    left_out: Mapping[str, int] | None = None,
) -> MadeReport:
    """The report of a study, over all its sessions: complete ones are counted, the others are named.

    :param folder: the study's.
    :param level: how much is told.
    :param private: further private memory keys.
    :param conditions: tell them also while the study hides them and is not complete.
    :param left_out: of a bundle: how many sessions that do not count are not in it, by their purpose.
    :raises rise_engine.base.errors.FileError: its files are not right.
    :raises rise_engine.study.study_log.StudyLogError: its log cannot be read.
    """
    state = read_state(folder)
    problems = [f"{each.name} {each.missing}" for each in _kept(state) if each.info is None]
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
        withdrawn=withdrawn_of(state.log),
        problems=tuple(problems),
        left_out=dict(left_out or {}),
    )
    sheet = sheet_markdown(state.study, given.sheet)
    return MadeReport(study_report(given), tuple(folders), tuple(problems), sheet)


def report_folders(state: StudyStatus) -> list[Path]:
    """The sessions that the report of a study tells of: those that do not run."""
    return [each.path for each in _kept(state) if each.info is not None and each.entry.status != "running"]


def _kept(state: StudyStatus) -> list[StudySession]:
    return [each for each in state.sessions if each.entry.participant not in state.places.withdrawn]


def replay_words(folder: Path) -> str:
    """Whether a session replays identically, in a few words; never what was recorded.

    :param folder: the session's.
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
