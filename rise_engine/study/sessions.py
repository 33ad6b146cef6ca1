"""The session folders of a study, and entries that a killed program did not write to the log (`study.jsonl`).

The folder has the truth about a session: its `session.toml`, and its journal with the start, the end and the outcome.
`missing_entries` compares this with the log. The next program that opens the study writes the missing entries under the
log's lock, so that no kill loses anything.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, Literal, NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.base.files import is_locked
from rise_engine.kernel.inputs import CheckReport, OutcomeReport
from rise_engine.scenario.model import Json
from rise_engine.session.folder import JOURNAL, SessionInfo, has_begun, has_ended, is_abandoned, read_info
from rise_engine.session.lock import JournalLock
from rise_engine.session.recovery import read_clock
from rise_engine.study.labels import SESSIONS as SESSIONS
from rise_engine.study.labels import Reassignment, copied_sessions, reassignments, session_differences, session_folders
from rise_engine.study.model import Purpose, SessionEntry
from rise_engine.study.study_log import EntryKind, LogEntry
from rise_engine.study.traces import is_withdrawn, returned_sessions
from rise_engine.study.verdict import read_checks, read_verdict

GIVEN_UP = "its engine had gone, and it was given up"
"""The reason for the outcome of a session that was not continued."""


NOT_IN_SESSIONS = "is not in the study's sessions any more"
NO_JOURNAL = "has no readable journal: its record is lost, unless a backup has it. Restore the journal from there"


class StudySession(Struct, frozen=True):
    entry: SessionEntry
    path: Path
    info: SessionInfo | None
    """None: its record is not readable (`missing`)."""
    missing: str = ""
    """Why only the log or session.toml has it: `NOT_IN_SESSIONS`, `NO_JOURNAL`, or `cannot be read: ...`."""
    abandoned: bool = False
    """Whether a person decided not to continue it."""
    left_open: bool = False
    """Whether its engine has gone without ending it, also if it was judged later."""
    reassigned: Reassignment | None = None
    """Its new participant, if the log has reassigned it."""
    differences: tuple[str, ...] = ()
    """Sentences on contradictions between its journal, which counts, and session.toml or the log."""

    @property
    def without_end(self) -> str:
        """A remark that it counts as complete although its record has no end. Empty: this is not so."""
        if self.entry.outcome != "complete" or self.entry.purpose != "counted" or not self.left_open:
            return ""
        return "counts as complete, and its record has no end: its engine had gone, or the end of its journal is lost"

    @property
    def name(self) -> str:
        """The name of its folder."""
        return self.entry.folder


class MissingEntry(NamedTuple):
    """An entry to append to the log."""

    kind: EntryKind
    fields: dict[str, Json]


def read_sessions(folder: Path, study_id: str, log: Sequence[LogEntry]) -> list[StudySession]:
    """Return all sessions of the study in the order of their starts. Some may only be in the log.

    Not included are folders without any input (their engine was killed immediately), copies, and sessions of
    participants who have withdrawn. A session whose journal was lost later is included, as `missing`.

    :param folder: the study's folder.
    :param study_id: folders of other studies are omitted, unless the log names them.
    :param log: the study's log; its outcomes count.
    """
    outcomes: dict[str, list[LogEntry]] = {}
    moved = reassignments(log)
    about: dict[str, list[LogEntry]] = {}
    for each in log:
        if each.kind == "outcome":
            outcomes.setdefault(_text(each, "session"), []).append(each)
        about.setdefault(_text(each, "folder") or _text(each, "session"), []).append(each)
    logged = {_text(each, "folder") for each in log if each.kind == "session"}
    found: dict[str, StudySession] = {}
    passed_over = {*copied_sessions(folder, log), *returned_sessions(folder, log)}
    unreadable: dict[str, str] = {}
    for path in session_folders(folder):
        if path.name in passed_over:
            continue
        try:
            info = read_info(path, compare=False)
        except SessionError as error:  # then only the log can describe it
            unreadable[path.name] = f"cannot be read: {error}"
            continue
        entries = about.get(path.name, ())
        is_running = is_locked(path / JOURNAL)
        if info.study != study_id and path.name not in logged:
            passed_over.add(path.name)
        elif is_running or has_begun(path):
            session = _from_folder(path, info, outcomes.get(path.name, ()), running=is_running)
            session = replace(session, differences=tuple(session_differences(path, entries)))
            found[path.name] = _reassign(session, moved.get(path.name))
        elif _is_without_input(path, entries):
            passed_over.add(path.name)
        elif path.name in logged:
            unreadable[path.name] = NO_JOURNAL
        else:
            found[path.name] = StudySession(_entry_of(path, info, "ended"), path, None, NO_JOURNAL)
    for each in log:
        name = _text(each, "folder")
        if each.kind == "session" and name not in found and name not in passed_over:
            session = _from_log(folder, each, outcomes.get(name, ()), unreadable.get(name, NOT_IN_SESSIONS))
            session = _reassign(session, moved.get(name))
            if not is_withdrawn(session.entry.participant, log):
                found[name] = session
    begun = [_text(each, "folder") for each in log if each.kind == "session"]
    places = {name: place for place, name in enumerate(begun)}  # the only known order if dates are removed
    return sorted(
        found.values(),
        key=lambda each: (_timestamp(each.entry.started), places.get(each.name, len(places)), each.name),
    )


def _reassign(session: StudySession, moved: Reassignment | None) -> StudySession:
    if moved is None:
        return session
    entry = replace(session.entry, **moved.labels, run_as=moved.run_as, reassigned=moved.reason)
    return replace(session, entry=entry, reassigned=moved)


def _timestamp(started: str) -> float:
    """Return seconds since 1970. ISO texts with different offsets do not sort by time."""
    try:
        return datetime.fromisoformat(started).timestamp()
    except ValueError:
        return 0.0


def _is_without_input(path: Path, entries: Iterable[LogEntry]) -> bool:
    """Whether the engine was killed before any input. Then no time was noted, and the log has at most the session's
    start.

    :param entries: the log's entries about the session.
    """
    kinds = {each.kind for each in entries}
    return kinds <= {"session"} and (not kinds or (path / JOURNAL).is_file()) and read_clock(path) < 1


def _from_folder(path: Path, info: SessionInfo, outcomes: Sequence[LogEntry], *, running: bool) -> StudySession:
    entry = _entry_of(path, info, "ended" if has_ended(path) else "running" if running else "unfinished")
    left_open = entry.status == "unfinished"
    return StudySession(_with_outcome(entry, outcomes), path, info, abandoned=is_abandoned(path), left_open=left_open)


def _entry_of(path: Path, info: SessionInfo, status: Literal["running", "unfinished", "ended"]) -> SessionEntry:
    return SessionEntry(
        participant=info.participant,
        run=info.run,
        attempt=info.attempt,
        purpose=info.purpose or "debug",
        folder=path.name,
        started=info.started,
        status=status,
        condition=info.condition,
        slot=info.slot or None,
    )


def _from_log(folder: Path, session: LogEntry, outcomes: Sequence[LogEntry], missing: str) -> StudySession:
    slot = session.get("slot")
    entry = SessionEntry(
        participant=_text(session, "participant"),
        run=int(session.get("run") or 0),
        attempt=int(session.get("attempt") or 0),
        purpose=session.get("purpose") or "debug",
        folder=_text(session, "folder"),
        started=_text(session, "started") or session.at,
        status="ended",
        condition=_text(session, "condition"),
        slot=slot if isinstance(slot, int) else None,
    )
    return StudySession(_with_outcome(entry, outcomes), folder / SESSIONS / entry.folder, None, missing)


def _with_outcome(entry: SessionEntry, outcomes: Sequence[LogEntry]) -> SessionEntry:
    """Return the entry with its outcome from the log. A judged session is over, even if its engine never ended it.

    :param outcomes: the log's outcomes of this session in their order; the last one counts.
    """
    if not outcomes or entry.status == "running":
        return entry
    last = outcomes[-1]
    *earlier, status = (each.get("status") for each in outcomes)
    return replace(
        entry,
        status="ended",
        outcome=status,
        earlier_outcomes=tuple(earlier),
        reason=_text(last, "reason"),
        seconds=float(last.get("seconds") or 0.0),
    )


def missing_entries(
    sessions: Iterable[StudySession], log: Sequence[LogEntry], after: Collection[str] = ()
) -> list[MissingEntry]:
    """List the entries that the log lacks according to the folders, in order: starts of sessions, taken slots, checks
    after sessions, and outcomes. A session that was judged before its engine died is over.

    :param sessions: from `read_sessions`.
    :param log: all entries.
    :param after: ids of the study's checks after sessions.
    """
    known = {_text(each, "folder") for each in log if each.kind == "session"}
    judged = {_text(each, "session") for each in log if each.kind == "outcome"}
    held = {(_text(each, "participant"), each.get("slot")) for each in log if each.kind == "taken"}
    missing: list[MissingEntry] = []
    for session in sessions:
        entry, info = session.entry, session.info
        if info is None:
            continue
        if entry.slot is not None and (entry.participant, entry.slot) not in held:
            held.add((entry.participant, entry.slot))
            moved = {"instead_of": session.reassigned.was} if session.reassigned is not None else {}
            fields = {"slot": entry.slot, "participant": entry.participant, **moved}
            missing.append(MissingEntry("taken", fields))
        if session.name not in known:
            labels = session.reassigned.labels if session.reassigned is not None else {}
            missing.append(MissingEntry("session", {**session_fields(session.name, info), **labels}))
        if session.name in judged or entry.status == "running" or entry.purpose != "counted":
            continue
        verdict = read_verdict(session.path)
        report = verdict.report
        checks = read_checks(session.path, after) if after else {}
        made = {_text(each, "id") for each in log if each.kind == "checked" and each.get("session") == session.name}
        missing += [
            MissingEntry(
                "checked",
                {
                    **checked_fields(checks[id], "after", entry.purpose),
                    "participant": entry.participant,
                    "run": entry.run,
                    "session": entry.folder,
                },
            )
            for id in after
            if id in checks.keys() - made
        ]
        if report is None and session.abandoned and entry.status == "unfinished":
            report = OutcomeReport(status="aborted", reason=GIVEN_UP)
        if report is not None:
            missing.append(MissingEntry("outcome", outcome_fields(entry, report, verdict.seconds)))
    return missing


def session_fields(name: str, info: SessionInfo) -> dict[str, Json]:
    """Return the fields of the log's entry of a session that began.

    :param name: the name of its folder.
    :param info: its session.toml.
    """
    return {
        "participant": info.participant,
        "slot": info.slot or None,
        "run": info.run,
        "attempt": info.attempt,
        "purpose": info.purpose,
        "condition": info.condition,
        "mode": info.mode,
        "folder": name,
        "started": info.started,
        "scenario_hash": info.scenario_hash,
    }


def checked_fields(report: CheckReport, when: str, purpose: Purpose) -> dict[str, Json]:
    """Return the fields of the log's entry of a check. The caller appends the participant and the session."""
    return {
        "id": report.id,
        "when": when,
        "text": report.text,
        "result": report.result,
        "value": report.value,
        "reason": report.reason,
        "source": report.source,
        "purpose": purpose,
    }


def outcome_fields(entry: SessionEntry, report: OutcomeReport, seconds: float) -> dict[str, Json]:
    """Return the fields of the log's entry of an outcome."""
    return {
        "session": entry.folder,
        "participant": entry.participant,
        "slot": entry.slot,
        "run": entry.run,
        "attempt": entry.attempt,
        "status": report.status,
        "reason": report.reason,
        "source": report.source,
        "seconds": round(seconds, 3),
    }


def refuse_running_elsewhere(session: StudySession, *, here: bool = False) -> None:
    """Make sure that no engine, also on another computer, has a session that is to be given up or judged. Locks of
    other computers may be invisible here.

    :param session: a session that did not end.
    :param here: a person has confirmed that it no longer runs on the other computer.
    :raises SessionError: an engine has it, or may have it.
    """
    if session.left_open:
        JournalLock(session.path / JOURNAL, here=here).release()


def given_up_fields(session: StudySession) -> dict[str, Json]:
    """Return the log's fields for a session that was given up: its journal's outcome, or else aborted."""
    verdict = read_verdict(session.path)
    report = verdict.report or OutcomeReport(status="aborted", reason=GIVEN_UP)
    return outcome_fields(session.entry, report, verdict.seconds)


def _text(entry: LogEntry, name: str) -> str:
    value: Any = entry.get(name)
    return value if isinstance(value, str) else ""
