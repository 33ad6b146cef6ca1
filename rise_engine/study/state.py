"""The current state of a study: its files, and its log compared with its session folders.

`read_state` only reads. `OpenStudy` holds the log's lock and writes entries that a killed program missed. Make and
write decisions within it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from datetime import date, datetime, timedelta
from pathlib import Path
from types import TracebackType

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import FileError
from rise_engine.base.text import name_some, pluralize
from rise_engine.scenario.model import Json
from rise_engine.session.folder import mark_abandoned
from rise_engine.study.labels import copied_sessions, repeated_sessions
from rise_engine.study.model import Participant, ParticipantState, Slot, Study, StudyStanding
from rise_engine.study.participants import load_participants
from rise_engine.study.plan import cell_for
from rise_engine.study.plan_file import read_plan
from rise_engine.study.planning import last_planned, plan_problem
from rise_engine.study.sessions import MissingEntry, StudySession, missing_entries, read_sessions
from rise_engine.study.standing import Places, places_of, study_standing
from rise_engine.study.study_log import LockedLog, LogEntry, read_log_and_damage
from rise_engine.study.study_toml import is_study, load_study
from rise_engine.study.traces import interrupted_withdrawals, is_withdrawn, registered_recordings, returned_sessions

NAMED = 3
"""Maximum number of names that a sentence lists; it counts the others."""


def due_retention(study: Study, sessions: Iterable[StudySession], today: date) -> list[str]:
    """List, in sentences, data that should be deleted by today and still exist.

    :param study: the checked design; `retention` has the days for `media` and `sessions`.
    :param sessions: from `rise_engine.study.sessions.read_sessions`.
    :param today: the current day.
    """
    kept = [(each, day) for each in sessions if each.info is not None and (day := _day(each)) is not None]
    due: list[str] = []
    days = study.retention.get("media")
    if days is not None:
        paths: dict[str, date] = {}
        for session, day in kept:
            if day + timedelta(days=days) <= today:
                found = registered_recordings(session.path, inside=True)
                paths.update((path, day) for path in found if Path(path).exists())
        if paths:
            names = name_some([f"{path} of {day}" for path, day in paths.items()], NAMED)
            due.append(f"{pluralize(len(paths), 'recording')} kept longer than {days:g} days, delete: {names}")
    days = study.retention.get("sessions")
    old = [each.name for each, day in kept if days is not None and day + timedelta(days=days) <= today]
    if old:
        names = name_some(old, NAMED)
        due.append(f"{pluralize(len(old), 'session')} kept longer than {days:g} days, delete: {names}")
    return due


def _day(session: StudySession) -> date | None:
    with suppress(ValueError):
        return datetime.fromisoformat(session.entry.started).date()
    return None


class StudyFiles(Struct, frozen=True):
    """The contents of the study's files and its plan."""

    study: Study
    participants: tuple[Participant, ...]
    plan: tuple[Slot, ...]
    """The rows in their order. Empty: there is no plan yet."""
    plan_hash: str


class StudyStatus(StudyFiles, frozen=True, kw_only=True):
    """The state of a study at one moment."""

    log: tuple[LogEntry, ...]
    """All entries, including those derived from the session folders."""
    sessions: tuple[StudySession, ...]
    places: Places
    standing: StudyStanding
    problems: tuple[str, ...] = ()
    """Sentences on what blocks all sessions that count."""
    interrupted: tuple[str, ...] = ()
    """Sentences on withdrawals that have not erased everything (`interrupted_withdrawals`)."""
    damaged: tuple[str, ...] = ()
    """Sentences on unreadable lines of the log, because of which everything here may be wrong."""

    @property
    def returned(self) -> dict[str, str]:
        """Sentences on folders of withdrawn participants that are there again, by folder. `sessions` lacks them."""
        return returned_sessions(Path(self.study.folder), self.log)

    @property
    def repeated(self) -> dict[str, str]:
        """Sentences on repetitions of the same participant, run and attempt, by folder."""
        return repeated_sessions(each.entry for each in self.sessions if not each.missing)

    @property
    def pseudonyms(self) -> tuple[str, ...]:
        """The participants in the log, or with a status in participants.csv, except those who have withdrawn."""
        listed = (each.participant for each in self.participants if each.status)
        logged = (str(each.get("participant") or "") for each in self.log)
        named = dict.fromkeys(filter(None, (*listed, *logged)))
        return tuple(each for each in named if not is_withdrawn(each, self.log))

    def with_outcomes(self, outcomes: Iterable[dict[str, Json]]) -> StudyStatus:
        """Return the state as if these outcomes were in the log."""
        supposed = [_entry_of(MissingEntry("outcome", fields)) for fields in outcomes]
        return _state(self, [*self.log, *supposed]) if supposed else self

    def row_for(self, participant: Participant) -> Slot | None:
        """Return the row that a participant holds or would get. None: there is none."""
        slot = self.places.slots.get(participant.participant)
        if slot is None:
            return self.places.free_row(self.plan, participant.strata)
        return next((row for row in self.plan if row.slot == slot), None)

    def state_of(self, participant: str) -> ParticipantState | None:
        """Return a participant's state. None: the study does not know them."""
        return next((each.state for each in self.standing.participants if each.participant == participant), None)

    def levels_of(self, row: Slot, participant: Participant | None) -> dict[str, str]:
        """Return the between levels of a row: planned, drawn when it was taken, or as this participant would now draw
        them (None: any participant)."""
        if row.levels or self.study.assignment.between != "minimise":
            return dict(row.levels)
        drawn = self.places.levels.get(row.slot)
        if drawn is not None and row.slot in self.places.slots.values():
            return dict(drawn)
        strata = {column: self.study.strata[column][0] for column in self.study.assignment.strata}
        if participant is not None:
            strata = {**strata, **participant.strata}
        return cell_for(self.study, self._cells_so_far(), strata, row)

    def _cells_so_far(self) -> list[tuple[dict[str, str], dict[str, str]]]:
        """Return strata and levels of all participants who hold a row."""
        strata = {each.participant: each.strata for each in self.participants}
        return [
            (strata[name], self.places.levels[slot])
            for name, slot in self.places.slots.items()
            if name in strata and slot in self.places.levels
        ]


def read_state(folder: Path) -> StudyStatus:
    """Read the current state of a study without writing anything.

    :param folder: the study's folder.
    :raises FileError: its files have errors.
    :raises rise_engine.study.study_log.StudyLogError: its log cannot be read.
    """
    files = _read_files(folder)
    log, damaged = read_log_and_damage(folder)
    state = _state(files, log)
    if damaged:
        standing = replace(state.standing, due=(*damaged, *state.standing.due))
        state = replace(state, standing=standing, damaged=tuple(damaged))
    due = due_retention(state.study, state.sessions, datetime.now().astimezone().date())
    doubtful = {**copied_sessions(folder, state.log), **state.repeated, **state.returned}
    due += [f"{name}: {sentence}" for name, sentence in doubtful.items()]
    return replace(state, standing=replace(state.standing, due=(*state.standing.due, *due))) if due else state


class OpenStudy:
    """A study whose log is locked against other programs. Hold it for milliseconds only.

    Within `with OpenStudy(folder) as open:`, `open.state` is the current state, and `open.log` can be written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.log = LockedLog(folder)
        self.state: StudyStatus

    def __enter__(self) -> OpenStudy:
        """
        :raises FileError: the study's files have errors.
        :raises rise_engine.study.study_log.StudyLogError: its log cannot be locked, read or written.
        """
        if not is_study(self.folder):  # do not make a log in a folder that is not a study
            raise FileError(*map(str, load_study(self.folder).errors))
        self.log.__enter__()
        try:
            self._reconcile(_read_files(self.folder))
        except BaseException:
            self.log.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.log.__exit__(kind, error, trace)

    def _reconcile(self, files: StudyFiles) -> None:
        """Write the entries that the log lacks according to the session folders."""
        entries = self.log.entries()
        sessions = read_sessions(self.folder, files.study.id, entries)
        for missing in missing_entries(sessions, entries, _after(files.study)):
            self.log.append(missing.kind, **missing.fields)
        for session in sessions:  # judged while unfinished: do not ask for the outcome again
            if session.left_open and session.entry.outcome is not None and not session.abandoned:
                mark_abandoned(session.path)
        self.state = _state(files, self.log.entries())


def _state(files: StudyFiles, log: Sequence[LogEntry]) -> StudyStatus:
    study, folder = files.study, Path(files.study.folder)
    sessions = read_sessions(folder, study.id, log)
    if missing := missing_entries(sessions, log, _after(study)):
        log = [*log, *(_entry_of(each) for each in missing)]
        sessions = read_sessions(folder, study.id, log)
    problems = _plan_problems(files, log)
    places = places_of(files.participants, log)
    standing = study_standing(study, files.participants, files.plan, log, sessions, problems=problems)
    interrupted = interrupted_withdrawals(folder)
    standing = replace(standing, due=(*interrupted, *standing.due))
    return StudyStatus(
        study=study,
        participants=files.participants,
        plan=files.plan,
        log=tuple(log),
        sessions=tuple(sessions),
        places=places,
        standing=standing,
        plan_hash=files.plan_hash,
        problems=tuple(problems),
        interrupted=tuple(interrupted),
    )


def _after(study: Study) -> tuple[str, ...]:
    """Return the ids of the study's checks after sessions."""
    return tuple(check.id for check in study.checks if check.when == "after")


def _entry_of(missing: MissingEntry) -> LogEntry:
    return LogEntry(missing.kind, datetime.now().astimezone().isoformat(timespec="milliseconds"), missing.fields, 0)


def _read_files(folder: Path) -> StudyFiles:
    loaded = load_study(folder, check_scenarios=False)
    if loaded.study is None:
        raise FileError(*map(str, loaded.errors))
    participants, plan = load_participants(loaded.study), read_plan(loaded.study)
    if errors := [*participants.errors, *plan.errors]:
        raise FileError(*map(str, errors))
    return StudyFiles(loaded.study, participants.participants, plan.slots or (), plan.hash)


def _plan_problems(files: StudyFiles, log: Sequence[LogEntry]) -> list[str]:
    """Return why no session that counts can begin."""
    problems: list[str] = []
    if files.study.mode == "debug":
        problems.append('study.toml says mode = "debug": with a simulated robot no session counts')
    planned = last_planned(log)
    if planned is None:
        problems.append("there is no plan yet: rise-engine study plan makes it")
    elif problem := plan_problem(files.study, planned, files.plan_hash):
        problems.append(problem)
    return problems
