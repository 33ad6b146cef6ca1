"""Proves a study's sessions: each replays identically, and all files agree about it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

from msgspec import Struct

from rise_engine.base.errors import SessionError
from rise_engine.session.folder import INFO, JOURNAL, SCENARIO_COPY, has_begun, load_copy
from rise_engine.session.replay import ReplayComparison, compare_replay
from rise_engine.study.labels import copied_sessions, outage_differences, session_folders
from rise_engine.study.plan import runs_of
from rise_engine.study.plan_file import PLAN_FILE
from rise_engine.study.sessions import NOT_IN_SESSIONS, StudySession
from rise_engine.study.state import StudyStatus
from rise_engine.study.study_log import LOG_FILE, StudyLogError, read_log
from rise_engine.study.study_scenarios import scenario_of
from rise_engine.study.study_toml import STUDY_FILE
from rise_engine.study.traces import returned_sessions


class ProvedSession(Struct, frozen=True):
    """A session with the result of its proof."""

    name: str
    comparison: ReplayComparison | None
    """The result of its replay. None: it cannot be replayed."""
    problems: tuple[str, ...] = ()
    """Sentences on why it cannot be replayed, and on contradictions to its journal."""
    note: str = ""
    """The remark that the log has reassigned it, which is not a problem."""

    @property
    def identical(self) -> bool:
        """Whether it replays record for record."""
        return self.comparison is not None and self.comparison.identical

    @property
    def proved(self) -> bool:
        """Whether it replays record for record, and nothing contradicts its journal."""
        return self.identical and not self.problems


def prove_sessions(
    folder: Path, state: StudyStatus | None, *, absent: Mapping[str, str] | None = None
) -> Iterator[ProvedSession]:
    """Replay each session that is not running, and compare it with study.jsonl, session.toml and plan.csv.

    A missing session counts as not proved if study.jsonl has its outcome.

    :param folder: the folder of a study or a bundle.
    :param state: the study's state; None: its files have errors, so that sessions are only replayed.
    :param absent: the logged sessions that a bundle omits on purpose; all others must be there.
    """
    known = {each.name: each for each in state.sessions} if state is not None else {}
    log = state.log if state is not None else ()
    doubtful = {**copied_sessions(folder, log), **returned_sessions(folder, log)}
    there = {path.name: path for path in session_folders(folder) if has_begun(path)}
    named = _named_in_log(folder)
    repeated = state.repeated if state is not None else {}
    for name in sorted({*known, *there, *(named if absent is not None else ())}):
        session = known.get(name)
        if name in doubtful:
            yield ProvedSession(name, None, (doubtful[name],))
            continue
        if session is not None and session.entry.status == "running":
            continue
        if session is not None and session.info is None and session.missing != NOT_IN_SESSIONS:
            yield ProvedSession(name, None, (f"it {session.missing}",))
            continue
        if name not in there:
            judged = session is not None and session.entry.purpose == "counted" and session.entry.outcome is not None
            if judged if absent is None else name not in absent:
                yield ProvedSession(name, None, (f"{LOG_FILE} names this session, and its folder is not there",))
            continue
        problems = list(session.differences) if session is not None else []
        problems += outage_differences(there[name])
        if state is not None and session is None:
            problems.append("it is not a session of this study")
        elif state is not None and session is not None:
            problems += [] if name in named else [f"{LOG_FILE} does not name this session"]
            problems += [repeated[name]] if name in repeated else []
            problems += _plan_differences(state, session)
            problems += _scenario_differences(state, session)
            problems += [f"{LOG_FILE} cannot be read whole, so what it says of it is not certain"] * bool(state.damaged)
        moved = session.reassigned if session is not None else None
        note = moved.sentence if moved is not None else ""
        try:
            comparison = compare_replay(there[name])
        except SessionError as error:
            yield ProvedSession(name, None, tuple(problems) or (str(error),), note)
        else:
            problems += filter(None, [comparison.other_scenario])
            yield ProvedSession(name, comparison, tuple(problems), note)


def compared_files(state: StudyStatus | None) -> tuple[str, ...]:
    """Return the files with which `prove_sessions` compares each session's journal.

    :param state: as for `prove_sessions`.
    """
    if state is None:
        return (INFO,)
    return (INFO, LOG_FILE, PLAN_FILE) if state.plan else (INFO, LOG_FILE)


def _named_in_log(folder: Path) -> set[str]:
    """Return every session that the log names."""
    try:
        entries = [each for each in read_log(folder) if each.kind in ("session", "outcome")]
        return {str(each.get("folder") or each.get("session")) for each in entries}
    except StudyLogError:
        return set()


def _scenario_differences(state: StudyStatus, session: StudySession) -> list[str]:
    """Report a counted session that ran the scenario of another level, for example after folders were exchanged.
    Changes of its own scenario are not reported."""
    study, info = state.study, session.info
    planned: dict[str, set[str]] = {}
    for each in state.log:
        for name, digest in (each.get("scenarios") or {}).items() if each.kind == "planned" else ():
            planned.setdefault(name, set()).add(digest)
    if info is None or session.entry.purpose != "counted" or len(planned) < 2:
        return []
    own = scenario_of(study, info.factors)
    ran = load_copy(session.path / SCENARIO_COPY, robot=study.robot or None, mode=study.mode).scenario
    if ran is None or ran.hash in planned.get(own, ()):
        return []
    return [
        f'{STUDY_FILE} gives the condition "{session.entry.condition}" the scenario {own}, but the session ran {name}, '
        f"as {LOG_FILE} says in `planned`"
        for name, hashes in planned.items()
        if ran.hash in hashes
    ]


def _plan_differences(state: StudyStatus, session: StudySession) -> list[str]:
    """Report differences between a counted session and its row of the plan."""
    entry = session.entry
    row = next((each for each in state.plan if each.slot == entry.slot), None)
    if row is None or entry.purpose != "counted":
        return []
    try:
        planned = runs_of(state.study, row, state.levels_of(row, None))
    except (KeyError, ValueError):
        return []
    condition = next((each.condition for each in planned if each.run == entry.run), None)
    if condition in (None, entry.condition):
        return []
    return [
        f'{PLAN_FILE} gives row {row.slot} the condition "{condition}" in run {entry.run}, but {JOURNAL} says '
        f'condition = "{entry.condition}"'
    ]
