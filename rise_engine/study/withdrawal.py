"""Withdrawal: erases one participant's data from a study permanently. Only a salted hash and a free slot remain.

It can be killed at any moment and run again. Under the log's lock, it writes a list of what to erase. It moves the
session folders out of `sessions`, so that no program logs them again, and rewrites the log without the participant.
Then it erases everything on the list, which can take long, and finally the list.
"""

from __future__ import annotations

import os
from collections.abc import Collection, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from rise_engine.base.errors import StudyError
from rise_engine.base.files import Disk, error_message, is_locked
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.session.folder import JOURNAL, sessions_folder
from rise_engine.session.lock import read_holder, running_message
from rise_engine.study.labels import SESSIONS, reassignments, session_folders
from rise_engine.study.study_log import LOG_FILE, SET_ASIDE_FILE, WITHDRAWN_PREFIX, LockedLog, LogEntry, read_log
from rise_engine.study.traces import (
    PARTICIPANTS_FILE,
    WORK_FOLDER,
    find_names,
    folders_in,
    has_name,
    hash_pseudonym,
    interrupted_withdrawals,
    is_withdrawn,
    lines_naming,
    name_pattern,
    new_salt,
    other_study_of,
    owner_of,
    recording_hashes,
    registered_recordings,
    why_media_unknown,
)
from rise_engine.study.withdrawal_work import (
    EXPORTED,
    Erasing,
    WithdrawalPlan,
    WithdrawalReport,
    erase_leftovers,
    erase_unlisted,
    find_earlier_work,
    is_there,
    join_plans,
    new_work,
    read_list,
    why_not_export,
    why_not_recording,
    write_list,
)

_NAMING = frozenset({"participant", "was", "instead_of"})
"""Fields of log entries with a participant."""
_DAY = len("2026-11-29")
"""The length of a date in an ISO 8601 time."""


def plan_withdrawal(study: Path, participant: str) -> WithdrawalPlan:
    """List the data that the withdrawal of a participant would erase. Nothing is changed.

    :param study: the study's folder.
    :param participant: their pseudonym.
    :raises StudyError: the study does not know the participant, or one of their sessions runs.
    :raises rise_engine.study.study_log.StudyLogError: the log cannot be read.
    """
    log = read_log(study)
    try:
        plan = _make_plan(study, participant, log)
        left = find_earlier_work(study, participant)
    except OSError as error:
        raise StudyError(f"{error.filename or study} cannot be read: {error_message(error)}") from None
    if plan.sessions or left or is_withdrawn(participant, log):
        return plan
    if any(_concerns(each, participant, set()) for each in log) or lines_naming(study / PARTICIPANTS_FILE, participant):
        return plan
    known = {str(each.get("participant")) for each in log if each.get("participant")}
    near = did_you_mean(participant, sorted(name for name in known if not name.startswith(WITHDRAWN_PREFIX)), limit=0)
    raise StudyError(f"the study in {study} knows no participant {participant!r}{near}; nothing was done")


def withdraw(
    study: Path, participant: str, disk: Disk | None = None, *, keep: Sequence[dict[str, str]] = ()
) -> WithdrawalReport:
    """Erase all reachable data of a participant. A call after an interruption completes the erasure.

    :param study: the study's folder.
    :param participant: their pseudonym.
    :param keep: rows that stay with the participant's consent (`rise_engine.study.traces`).
    :param disk: for tests that let it fail.
    :raises StudyError: as `plan_withdrawal`, or data cannot be erased; they stay listed for the next call.
    :raises rise_engine.study.study_log.StudyLogError: the log cannot be read or written.
    """
    disk = disk or Disk()
    plan = plan_withdrawal(study, participant)
    try:
        with LockedLog(study, disk=disk) as log:
            work = _detach_sessions(study, participant, log, disk, keep)
        nothing = WithdrawalReport(unreached=plan.unreachable)
        report = Erasing(study, work, disk).run() if work is not None else nothing
        erase_leftovers(study, report)
    except OSError as error:
        raise StudyError(
            f"not everything could be erased: {error.filename or study}: {error_message(error)}. Fix that and "
            "repeat the command: it continues where it stopped"
        ) from None
    report.unreached += interrupted_withdrawals(study, work)
    report.remains = find_names(study, participant)
    report.beyond += _beyond(study, participant)
    return report


# --- under the log's lock -------------------------------------------------------------------------------------------


def _detach_sessions(
    study: Path, participant: str, log: LockedLog, disk: Disk, keep: Sequence[dict[str, str]] = ()
) -> Path | None:
    """Write the list, move the folders out of `sessions`, and rewrite the log. Returns the folder to erase; None:
    nothing."""
    erase_unlisted(study)
    log.path.with_name(f"{LOG_FILE}.new").unlink(missing_ok=True)  # from a rewrite that was killed
    entries = _by_owner(log.entries(), participant)
    plan = _make_plan(study, participant, entries)
    plan.kept = list(keep)
    work = find_earlier_work(study, participant)
    if work is not None:
        plan = join_plans(read_list(work), plan)
    own = set(plan.sessions)
    _clear_set_aside(study / SET_ASIDE_FILE, participant, own)
    known = any(_concerns(each, participant, own) for each in entries)
    nothing = not (plan.sessions or plan.exports or known)
    if work is None and nothing and is_withdrawn(participant, entries):
        with suppress(OSError):
            (study / WORK_FOLDER).rmdir()
        return None
    work = work or new_work(study)
    write_list(work, plan, disk)
    for name in plan.sessions:
        _move_out(study / SESSIONS / name, work / name)
    if (study / SESSIONS).is_dir():
        disk.sync_folder(study / SESSIONS)
    disk.sync_folder(work)
    if known or not is_withdrawn(participant, entries):
        _rewrite_log(log, entries, participant, own)
    return work


def _move_out(folder: Path, target: Path) -> None:
    """Move a session out of `sessions`. Raises StudyError if an engine has just continued it."""
    if not folder.exists():
        return
    folder.rename(target)
    if is_locked(target / JOURNAL):
        target.rename(folder)
        _refuse_running(folder)


def _rewrite_log(log: LockedLog, entries: list[LogEntry], participant: str, own: set[str]) -> None:
    """Rewrite the log without the participant and with the entry of the withdrawal, in one step.

    Their entries are removed. In two kinds, the hash replaces the pseudonym: `taken` (with the day instead of the
    moment), and exports, which may contain others. `Erasing` removes the exports that it erases.
    """
    salt = new_salt()
    digest = hash_pseudonym(participant, salt)
    slots = [each.get("slot") for each in entries if each.kind == "taken" and each.get("participant") == participant]
    kept: list[LogEntry] = []
    moved = reassignments(entries).keys() - own
    moved_to_them: dict[str, Any] = {}
    for entry in entries:
        session = str(entry.get("session"))
        if entry.kind == "reassigned" and entry.get("participant") == participant:
            moved_to_them[session] = moved_to_them.get(session, entry.get("was"))
        elif entry.kind == "reassigned" and entry.get("was") == participant and session in moved_to_them:
            entry = replace(entry, fields={**entry.fields, "was": moved_to_them.pop(session)})
        if not _concerns(entry, participant, own):
            kept.append(entry)
        elif entry.kind in EXPORTED:
            kept += _export_without(entry, participant, own, WITHDRAWN_PREFIX + digest, moved)
        elif entry.kind == "taken" or not _is_about(entry, participant, own):
            named = participant in (entry.get(field) for field in _NAMING)
            at = entry.at[:_DAY] if named else entry.at  # a calendar would reveal the participant of a time of day
            kept.append(replace(entry, at=at, fields=_without_name(entry, participant, WITHDRAWN_PREFIX + digest)))
    withdrawn = {"slot": slots[-1] if slots else None, "salt": salt, "hash": digest}
    log.rewrite([*kept, LogEntry("withdrawn", log.now_text(), withdrawn, 0)])
    _clear_set_aside(log.path.with_name(SET_ASIDE_FILE), participant, own)


def _export_without(
    entry: LogEntry, participant: str, own: set[str], name: str, moved: Collection[str]
) -> list[LogEntry]:
    """Return the entry of an export with another name instead of theirs, and without their sessions. Empty: its path
    names them.

    :param moved: sessions of others that may have been run under their pseudonym.
    """
    path = str(entry.get("path"))
    if own & {*Path(path).parts} or has_name(path, participant):
        return []
    sessions = [str(each) for each in entry.get("sessions") or ()]
    theirs = own | {each for each in sessions if has_name(each, participant) and each not in moved}
    people = [name if each == participant else each for each in _exported_participants(entry)]
    fields = {"participants": people, "sessions": [each for each in sessions if each not in theirs]}
    return [replace(entry, fields={**entry.fields, **fields})]


def _by_owner(entries: Sequence[LogEntry], participant: str) -> list[LogEntry]:
    """Relabel sessions that were run as this participant and belong to another."""
    owners = {name: each for name, each in reassignments(entries).items() if each.participant != participant}
    found: list[LogEntry] = []
    for entry in entries:
        moved = owners.get(str(entry.get("folder") or entry.get("session")))
        if moved is not None and entry.kind in ("session", "outcome") and entry.get("participant") == participant:
            entry = replace(entry, fields={**entry.fields, **moved.labels})
        found.append(entry)
    return found


def _is_about(entry: LogEntry, participant: str, own: set[str]) -> bool:
    """Whether an entry is about them, including exports of their data, which are erased."""
    sessions = {str(entry.get("session")), str(entry.get("folder")), *Path(str(entry.get("path"))).parts}
    return (
        entry.get("participant") == participant or participant in _exported_participants(entry) or bool(sessions & own)
    )


def _exported_participants(entry: LogEntry) -> list[str]:
    """Return the participants in an export."""
    named = entry.get("participants")
    return [each for each in named if isinstance(each, str)] if isinstance(named, list) else []


def _concerns(entry: LogEntry, participant: str, own: set[str]) -> bool:
    """Whether an entry is about them, or names them in a text."""
    return _is_about(entry, participant, own) or _without_name(entry, participant, "") != entry.fields


def _without_name(entry: LogEntry, participant: str, name: str) -> dict[str, Any]:
    """Return an entry's fields with another name instead of theirs. Pseudonyms of digits are not replaced in texts,
    where they may be ordinary numbers."""
    if not participant.isdigit():
        entry = entry.with_written(partial(name_pattern(participant).sub, name))
    return {
        field: name if field in _NAMING and value == participant else value for field, value in entry.fields.items()
    }


def _clear_set_aside(path: Path, participant: str, own: set[str]) -> None:
    """Delete incomplete lines of the log that name them. Their contents are in the folders, or lost."""
    if path.exists() and any(has_name(path.read_text("utf-8", "replace"), each) for each in (participant, *own)):
        path.unlink()


# --- what is theirs -------------------------------------------------------------------------------------------------


def _make_plan(study: Path, participant: str, log: Sequence[LogEntry]) -> WithdrawalPlan:
    plan = WithdrawalPlan(participant)
    others: dict[str, list[str]] = {}
    recorded: dict[str, list[Path]] = {}
    for folder in folders_in(study / SESSIONS):
        owner = owner_of(folder)
        if owner == participant and (other := other_study_of(study, folder, log)):
            plan.unreachable.append(
                f"session {folder.name} is of the study {other}, where this pseudonym may be somebody else: put it "
                "where it belongs, or erase it yourself"
            )
        elif owner == participant:
            _refuse_running(folder)
            plan.sessions.append(folder.name)
            if problem := why_media_unknown(folder):
                plan.unreachable.append(f"the recordings that media.json of {folder.name} named: {problem}")
            for path in registered_recordings(folder):
                recorded.setdefault(path, []).append(folder)
        else:
            for path in registered_recordings(folder, inside=True):
                others.setdefault(path, []).append(owner or folder.name)
    for path, folders in recorded.items():
        hashes = [text for folder in folders for text in recording_hashes(folder, path)]
        if path in others:
            plan.unreachable.append(f"{path} records {', '.join(sorted(set(others[path])))}, too: cut them out of it")
        elif sentence := why_not_recording(study, Path(path), hashes):
            plan.unreachable.append(sentence)
        else:
            plan.recordings.append(path)
            plan.hashes[path] = hashes
    _plan_exports(plan, study, log)
    _note_missing(plan, study, log)
    return plan


def _plan_exports(plan: WithdrawalPlan, study: Path, log: Sequence[LogEntry]) -> None:
    """Plan which of their exports to erase. `Erasing` checks later whether each is unchanged."""
    withdrawn = [each for each in log if each.kind == "withdrawn"]
    again = is_withdrawn(plan.participant, withdrawn)
    own = {
        plan.participant,
        *(WITHDRAWN_PREFIX + hash_pseudonym(plan.participant, str(each.get("salt"))) for each in withdrawn),
    }
    for entry in log:
        path, names = entry.get("path"), _exported_participants(entry)
        if not isinstance(path, str) or own.isdisjoint(names):
            continue
        if entry.kind == "exported":
            if again and not is_there(study, path):
                continue  # an earlier withdrawal already asked people to erase it
            if sentence := why_not_export(study, path):
                plan.unreachable += [sentence] if sentence not in plan.unreachable else []
                continue
            others = [each for each in names if each not in own and not each.startswith(WITHDRAWN_PREFIX)]
            plan.exports[path] = list(dict.fromkeys([*plan.exports.get(path, []), *others]))
            if entry.get("folder") is True and path not in plan.export_folders:
                plan.export_folders.append(path)
        elif entry.kind == "written":
            plan.hashes.setdefault(path, []).append(str(entry.get("sha256")))
    for path in list(plan.exports):
        if not os.path.lexists(study / path):
            del plan.exports[path]  # the export was never completed, unless its hash is known
            if path in plan.hashes:
                plan.unreachable.append(
                    f"{study / path} was exported with their data and is not there: erase it where it is now"
                )


def _note_missing(plan: WithdrawalPlan, study: Path, log: Sequence[LogEntry]) -> None:
    """List their sessions that are no longer in their places."""
    names = [
        str(each.get("folder"))
        for each in log
        if each.kind == "session" and each.get("participant") == plan.participant
    ]
    links = (each for each in session_folders(study) if each.is_symlink())
    names += [each.name for each in links if owner_of(each) == plan.participant]
    for name in dict.fromkeys(names):
        if name in plan.sessions:
            continue
        folder = study / SESSIONS / name
        if folder.is_symlink():
            plan.unreachable.append(f"{folder} is a link to {folder.resolve()}: erase their data there, and the link")
        elif not folder.exists():
            plan.unreachable.append(f"session {name} is not in {SESSIONS} any more: erase it where it is now")


def _refuse_running(folder: Path) -> None:
    if is_locked(folder / JOURNAL):
        raise StudyError(f"{running_message(folder, read_holder(folder))}. Nothing was erased: end it first")


# --- what is left ---------------------------------------------------------------------------------------------------


def _beyond(study: Path, participant: str) -> list[str]:
    """List data that no program can reach from here."""
    found = []
    elsewhere = sessions_folder()
    if elsewhere.resolve() != (study / SESSIONS).resolve():
        for folder in folders_in(elsewhere):
            if owner_of(folder) == participant:
                found.append(f"{folder} is a session of somebody with this pseudonym: look whose it is")
    return [
        *found,
        "backups, snapshots and synchronised copies of the study's folder, and whatever was copied out of it",
        "recordings that no session has registered: cameras, bags, LabRecorder, the folder of OBS",
        "bundles and exports that were given to others, or that were not written with `export -o`",
        "the list that says which person the pseudonym is, and the consent form",
        "what was saved from a console, and what consoles and engines keep (their state folder, engine.log)",
        "the history of the shell, if the pseudonym was typed there",
    ]
