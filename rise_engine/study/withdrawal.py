"""Withdrawal: what is about one participant leaves a study, for ever; what stays is a salted hash and a free slot.

The order makes it safe to be killed at any moment, and to be run again: under the log's lock a list of what is to go is
written, their session folders are moved out of `sessions` (so nobody finds them there and writes them into the log
again), and the log is written anew without them. Then what was moved and listed is erased, which can take long, and at
last the list. Whatever is left of an earlier run is finished by the next one.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

from msgspec.structs import replace

from rise_engine.base.errors import StudyError
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.session.disk import Disk, error_message
from rise_engine.session.folder import JOURNAL, sessions_folder
from rise_engine.session.lock import is_journal_locked, read_holder, running_message
from rise_engine.study.labels import reassignments
from rise_engine.study.sessions import SESSIONS
from rise_engine.study.study_log import LOG_FILE, SET_ASIDE_FILE, LockedLog, LogEntry, read_log
from rise_engine.study.traces import (
    PARTICIPANTS_FILE,
    WORK_FOLDER,
    find_names,
    folders_in,
    has_name,
    lines_naming,
    name_pattern,
    owner_of,
    recording_facts,
    registered_recordings,
    why_media_unknown,
)
from rise_engine.study.withdrawal_work import (
    Erasing,
    KnownBy,
    WithdrawalPlan,
    WithdrawalReport,
    erase_leftovers,
    erase_unlisted,
    join_plans,
    left_work,
    new_work,
    read_list,
    why_not_export,
    why_not_recording,
    write_list,
)
from rise_engine.study.withdrawn import PREFIX, hash_pseudonym, is_withdrawn, new_salt

_NAMING = frozenset({"participant", "was", "instead_of"})
"""Fields of the log's entries that name one."""


def plan_withdrawal(study: Path, participant: str) -> WithdrawalPlan:
    """What withdrawing a participant would erase. Nothing is changed.

    :param study: the study's folder.
    :param participant: their pseudonym.
    :raises StudyError: the study knows no such participant, or one of their sessions runs.
    :raises rise_engine.study.study_log.StudyLogError: the log cannot be read.
    """
    log = read_log(study)
    try:
        plan = _make_plan(study, participant, log)
        left = left_work(study, participant)
    except OSError as error:
        raise StudyError(f"{error.filename or study} cannot be read: {error_message(error)}") from None
    if plan.sessions or left or is_withdrawn(participant, log):
        return plan
    if any(_concerns(each, participant, set()) for each in log) or lines_naming(study / PARTICIPANTS_FILE, participant):
        return plan
    known = {str(each.get("participant")) for each in log if each.get("participant")}
    near = did_you_mean(participant, sorted(name for name in known if not name.startswith(PREFIX)), limit=0)
    raise StudyError(f"the study in {study} knows no participant {participant!r}{near}; nothing was done")


def withdraw(
    study: Path, participant: str, disk: Disk | None = None, *, keep: Sequence[dict[str, str]] = ()
) -> WithdrawalReport:
    """Erase everything about a participant that can be reached; run again after an interruption, it finishes.

    :param study: the study's folder.
    :param participant: their pseudonym.
    :param keep: rows that stay (`rise_engine.study.withdrawn`), where they have agreed to it.
    :param disk: what writes, for tests that let it fail.
    :raises StudyError: as `plan_withdrawal`, or something cannot be erased; what was not stays listed for the next
        time.
    :raises rise_engine.study.study_log.StudyLogError: the log cannot be read or written.
    """
    disk = disk or Disk()
    plan_withdrawal(study, participant)
    try:
        with LockedLog(study, disk=disk) as log:
            work = _take_out(study, participant, log, disk, keep)
        report = Erasing(study, work, disk).run() if work is not None else WithdrawalReport()
        erase_leftovers(study, report)
    except OSError as error:
        raise StudyError(
            f"not everything could be erased: {error.filename or study}: {error_message(error)}. Fix that and "
            "repeat the command: it continues where it stopped"
        ) from None
    report.remains = find_names(study, participant)
    report.beyond += _beyond(study, participant)
    return report


# --- under the log's lock -------------------------------------------------------------------------------------------


def _take_out(
    study: Path, participant: str, log: LockedLog, disk: Disk, keep: Sequence[dict[str, str]] = ()
) -> Path | None:
    """Make the list, move the folders out of the study's sessions, write the log anew. The folder of what is to be
    erased; None: there is nothing."""
    erase_unlisted(study)
    log.path.with_name(f"{LOG_FILE}.new").unlink(missing_ok=True)  # somebody was killed who wrote the log anew
    entries = _by_owner(log.entries(), participant)
    plan = _make_plan(study, participant, entries)
    plan.kept = list(keep)
    work = left_work(study, participant)
    if work is not None:
        plan = join_plans(read_list(work), plan)
    own = set(plan.sessions)
    _clear_set_aside(study / SET_ASIDE_FILE, participant, own)
    known = any(_concerns(each, participant, own) for each in entries)
    if work is None and not plan.sessions and not known and is_withdrawn(participant, entries):
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
    """Nobody finds the session any more. Raises StudyError when somebody has gone on with it just now."""
    if not folder.exists():
        return
    folder.rename(target)
    if is_journal_locked(target / JOURNAL):
        target.rename(folder)
        _refuse_running(folder)


def _rewrite_log(log: LockedLog, entries: list[LogEntry], participant: str, own: set[str]) -> None:
    """The log without them, and the entry that they have withdrawn, in one step.

    Of what was about them, only that their slot was taken stays, by the hash.
    """
    salt = new_salt()
    digest = hash_pseudonym(participant, salt)
    slots = [each.get("slot") for each in entries if each.kind == "taken" and each.get("participant") == participant]
    kept: list[LogEntry] = []
    for entry in entries:
        if not _concerns(entry, participant, own):
            kept.append(entry)
        elif entry.kind == "taken" or not _is_about(entry, participant, own):
            kept.append(replace(entry, fields=_without_name(entry, participant, PREFIX + digest)))
    withdrawn = {"slot": slots[-1] if slots else None, "salt": salt, "hash": digest}
    log.rewrite([*kept, LogEntry("withdrawn", log.now_text(), withdrawn, 0)])
    _clear_set_aside(log.path.with_name(SET_ASIDE_FILE), participant, own)


def _by_owner(entries: Sequence[LogEntry], participant: str) -> list[LogEntry]:
    """The log, in which sessions that were run as this participant and are another one's are that one's."""
    owners = {name: each for name, each in reassignments(entries).items() if each.participant != participant}
    found: list[LogEntry] = []
    for entry in entries:
        moved = owners.get(str(entry.get("folder") or entry.get("session")))
        if moved is not None and entry.kind in ("session", "outcome") and entry.get("participant") == participant:
            entry = replace(entry, fields={**entry.fields, **moved.labels})
        found.append(entry)
    return found


def _is_about(entry: LogEntry, participant: str, own: set[str]) -> bool:
    """Whether an entry is about them; an export that holds them is erased, so it need not be known any more."""
    sessions = {str(entry.get("session")), str(entry.get("folder")), *Path(str(entry.get("path"))).parts}
    return entry.get("participant") == participant or participant in _named(entry) or bool(sessions & own)


def _named(entry: LogEntry) -> list[str]:
    """Whom an export tells of."""
    named = entry.get("participants")
    return [each for each in named if isinstance(each, str)] if isinstance(named, list) else []


def _concerns(entry: LogEntry, participant: str, own: set[str]) -> bool:
    """Whether an entry is about them, or names them in what somebody wrote."""
    return _is_about(entry, participant, own) or _without_name(entry, participant, "") != entry.fields


def _without_name(entry: LogEntry, participant: str, name: str) -> dict[str, Any]:
    """An entry's fields with another name in the place of theirs. A pseudonym of digits is no word that can be found
    in what somebody wrote."""
    if not participant.isdigit():
        entry = entry.with_written(partial(name_pattern(participant).sub, name))
    return {
        field: name if field in _NAMING and value == participant else value for field, value in entry.fields.items()
    }


def _clear_set_aside(path: Path, participant: str, own: set[str]) -> None:
    """Half lines of the log that name them. What they said is in the folders, or nowhere."""
    if path.exists() and any(has_name(path.read_text("utf-8", "replace"), each) for each in (participant, *own)):
        path.unlink()


# --- what is theirs -------------------------------------------------------------------------------------------------


def _make_plan(study: Path, participant: str, log: Sequence[LogEntry]) -> WithdrawalPlan:
    plan = WithdrawalPlan(participant)
    others: dict[str, list[str]] = {}
    recorded: dict[str, list[Path]] = {}
    for folder in folders_in(study / SESSIONS):
        owner = owner_of(folder)
        if owner == participant:
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
        facts = _recording_facts(folders, path)
        if path in others:
            plan.unreachable.append(f"{path} records {', '.join(sorted(set(others[path])))}, too: cut them out of it")
        elif sentence := why_not_recording(study, folders[0], Path(path), facts):
            plan.unreachable.append(sentence)
        else:
            plan.recordings.append(path)
            if facts.hashes:
                plan.hashes[path] = facts.hashes
    _plan_exports(plan, study, log)
    _note_missing(plan, study, log)
    return plan


def _recording_facts(folders: Sequence[Path], path: str) -> KnownBy:
    found = [recording_facts(folder, path) for folder in folders]
    return KnownBy([size for sizes, _ in found for size in sizes], [each for _, hashes in found for each in hashes])


def _plan_exports(plan: WithdrawalPlan, study: Path, log: Sequence[LogEntry]) -> None:
    """What of their exports is to be erased; whether each is still what was written is looked at later."""
    for entry in log:
        path, names = entry.get("path"), _named(entry)
        if not isinstance(path, str) or plan.participant not in names:
            continue
        if entry.kind == "exported":
            if sentence := why_not_export(study, path):
                plan.unreachable += [sentence] if sentence not in plan.unreachable else []
                continue
            others = [each for each in names if each != plan.participant]
            plan.exports[path] = list(dict.fromkeys([*plan.exports.get(path, []), *others]))
            if entry.get("folder") is True and path not in plan.export_folders:
                plan.export_folders.append(path)
        elif entry.kind == "written":
            plan.hashes.setdefault(path, []).append(str(entry.get("sha256")))
    for path in list(plan.exports):
        if not os.path.lexists(study / path):
            del plan.exports[path]  # it was never finished, unless its hash is known
            if path in plan.hashes:
                plan.unreachable.append(
                    f"{study / path} was exported with their data and is not there: erase it where it is now"
                )


def _note_missing(plan: WithdrawalPlan, study: Path, log: Sequence[LogEntry]) -> None:
    """Sessions of theirs that are not where they were."""
    names = [
        str(each.get("folder"))
        for each in log
        if each.kind == "session" and each.get("participant") == plan.participant
    ]
    for name in dict.fromkeys(names):
        if name in plan.sessions:
            continue
        folder = study / SESSIONS / name
        if folder.is_symlink():
            plan.unreachable.append(f"{folder} is a link to {folder.resolve()}: erase their data there")
        elif not folder.exists():
            plan.unreachable.append(f"session {name} is not in {SESSIONS} any more: erase it where it is now")


def _refuse_running(folder: Path) -> None:
    if is_journal_locked(folder / JOURNAL):
        raise StudyError(f"{running_message(folder, read_holder(folder))}. Nothing was erased: end it first")


# --- what is left ---------------------------------------------------------------------------------------------------


def _beyond(study: Path, participant: str) -> list[str]:
    """What no program can reach from here."""
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
