"""Compares a session's labels in its journal, session.toml and its study's log, and finds copies of sessions.

One difference is allowed: the log can reassign, with a reason, a session that was run under the wrong participant. The
journal stays unchanged, and readers who need the participant follow the log (`reassignment_of`). A folder must not
count when another one holds the same session (`copied_sessions`).
"""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any

from msgspec import Struct

from rise_engine.base.json_codec import encode
from rise_engine.scenario.files.study_paths import STUDY_FILE
from rise_engine.session.folder import JOURNAL, info_differences
from rise_engine.session.labels import (
    CLOCK_TOLERANCE,
    label_differences,
    moment_differences,
    pseudonym_problem,
    read_labels,
    refuse_differences,
)
from rise_engine.study.model import SessionEntry
from rise_engine.study.study_log import LOG_FILE, WITHDRAWN_PREFIX, LogEntry, StudyLogError, file_stamp, read_kept_log
from rise_engine.study.verdict import read_recoveries, read_verdict

_FOLDER_NAME = re.compile(r"\d{4}-\d{2}-\d{2}_\d{6}_([A-Za-z0-9]+)_")
"""The start of a folder's name, with the participant."""
_ROUNDED = 0.001
"""Maximum difference in seconds between the log's times and a journal's."""
_ABOUT_SESSIONS = frozenset({"session", "outcome", "reassigned"})
"""Kinds of entries with a session's labels."""


RUN_BY_WITHDRAWN = "withdrawn"
"""The value of `run_as` if the session was run under the pseudonym of a participant who has withdrawn."""


class Reassignment(Struct, frozen=True):
    """The change of a session's participant after it was run."""

    participant: str
    """The right participant."""
    was: str
    """The participant under whom it was run."""
    slot: int | None
    """The row of the plan that went with it. None: the row stayed with its holder."""
    attempt: int
    """The number of the participant's attempt at this run."""
    reason: str

    @property
    def run_as(self) -> str:
        """The participant under whom it was run, or `RUN_BY_WITHDRAWN`. Empty: it was reassigned back to them."""
        if self.participant == self.was:
            return ""
        return RUN_BY_WITHDRAWN if self.was.startswith(WITHDRAWN_PREFIX) else self.was

    @property
    def sentence(self) -> str:
        back = " and back" if self.participant == self.was else f" to {self.participant}"
        was = "somebody who has withdrawn" if self.was.startswith(WITHDRAWN_PREFIX) else self.was
        return f"run as {was}, and reassigned{back}: {self.reason}"

    @property
    def labels(self) -> dict[str, Any]:
        """The labels that differ from the journal's first record."""
        return {"participant": self.participant, "slot": self.slot, "attempt": self.attempt}


def reassignments(log: Sequence[LogEntry]) -> dict[str, Reassignment]:
    """Return the reassigned sessions by the names of their folders. The last reassignment counts.

    :param log: all entries of study.jsonl.
    """
    found: dict[str, Reassignment] = {}
    for each in log:
        if each.kind == "reassigned":
            name, slot = str(each.get("session")), each.get("slot")
            found[name] = Reassignment(
                participant=str(each.get("participant")),
                was=found[name].was if name in found else str(each.get("was")),
                slot=slot if isinstance(slot, int) else None,
                attempt=int(each.get("attempt") or 1),
                reason=str(each.get("reason") or ""),
            )
    return found


def reassignment_of(folder: Path) -> Reassignment | None:
    """Return a session's reassignment in its study's log. None: the journal's participant is right.

    :param folder: the session's folder.
    """
    return reassignments(_log_of(folder)).get(folder.resolve().name)


def session_differences(folder: Path, log: Sequence[LogEntry] | None = None) -> list[str]:
    """List where session.toml, the study's log and the id in study.toml differ from a session's journal.

    After a reassignment, the log may have the journal's labels or the new ones.

    :param folder: the session's folder.
    :param log: the log's entries; None: the log of the study around the folder is read.
    :return: sentences that name both values; empty where all agree.
    """
    name = folder.resolve().name
    entries = [
        each
        for each in (_log_of(folder) if log is None else log)
        if each.kind in _ABOUT_SESSIONS and name in (each.get("folder"), each.get("session"))
    ]
    found = info_differences(folder, moments=any(each.kind == "session" for each in entries))
    labels = read_labels(folder / JOURNAL) if entries else None
    found += _name_differences(name, labels or {})
    if any(each.kind == "session" for each in entries):
        found += _study_differences(folder.resolve().parent.parent / STUDY_FILE, labels or {})
    given: Mapping[str, Any] | None = labels
    accepted: Mapping[str, Any] | None = labels
    moves = [each for each in entries if each.kind == "reassigned"]
    if labels is not None and any(
        str(each.get(who)).startswith(WITHDRAWN_PREFIX) for each in moves for who in ("was", "participant")
    ):
        accepted = {**labels, **reassignments(moves)[name].labels}  # a withdrawal has replaced them in earlier entries
    outcomes = [each for each in entries if each.kind == "outcome"]
    found += _outcome_differences(folder, outcomes)
    found += _end_differences(folder, outcomes) if labels is not None else []
    for each in entries:
        where = f"{LOG_FILE}, line {each.line},"
        if each.kind == "reassigned":
            if not str(each.get("was")).startswith(WITHDRAWN_PREFIX):
                found += label_differences(given, {"participant": each.get("was")}, where)
            if labels is not None:
                given = {**labels, **reassignments([each])[name].labels}
            continue
        found += moment_differences(labels, each.fields, where)
        differences = label_differences(labels, each.fields, where)
        is_other = all(label_differences(other, each.fields, where) for other in (given, accepted))
        found += differences if is_other else []
    return found


def _name_differences(name: str, labels: Mapping[str, Any]) -> Iterator[str]:
    """Report a folder's name with another participant than the journal. Other forms of names are allowed."""
    named, participant = _FOLDER_NAME.match(name), str(labels.get("participant") or "")
    if named is not None and not pseudonym_problem(participant) and participant not in ("", named[1]):
        yield f'the folder\'s name says "{named[1]}", but {JOURNAL} says participant = "{participant}"'


def _study_differences(study: Path, labels: Mapping[str, Any]) -> Iterator[str]:
    """Report that the study's id has changed since the session ran."""
    id, recorded = read_study_id(study), labels.get("study")
    if id and recorded and id != recorded:
        yield f'{STUDY_FILE} says id = "{id}", but {JOURNAL} says study = "{recorded}"'


def read_study_id(study: Path) -> str:
    """Return the id in study.toml, even if other parts have errors. Empty: unknown.

    :param study: the path of study.toml.
    """
    return _read_study_id(study, file_stamp(study))


@lru_cache(maxsize=4)
def _read_study_id(study: Path, changed: tuple[int, int]) -> str:
    try:
        return str(tomllib.loads(study.read_text("utf-8")).get("id") or "")
    except (OSError, ValueError):
        return ""


def _outcome_differences(folder: Path, found: Sequence[LogEntry]) -> Iterator[str]:
    """Report outcomes in the log that do not follow from the session's journal.

    The log begins with the journal's last outcome, if there is one. Each later entry is a correction with a reason.

    :param found: the session's outcomes in the log.
    """
    if not found:
        return
    judged = read_verdict(folder).report
    if judged is not None and found[0].get("status") != judged.status:
        yield (
            f'{LOG_FILE}, line {found[0].line}, says status = "{found[0].get("status")}", but {JOURNAL} says '
            f'status = "{judged.status}"'
        )
    reason = str(found[0].get("reason") or "")
    if judged is not None and reason != judged.reason and WITHDRAWN_PREFIX not in reason:
        yield (
            f'{LOG_FILE}, line {found[0].line}, says reason = "{reason}", but {JOURNAL} says reason = "{judged.reason}"'
        )
    for each in found[1:]:
        if not str(each.get("reason") or "").strip():
            yield f"{LOG_FILE}, line {each.line}, corrects the outcome and gives no reason"


def _end_differences(folder: Path, ends: Sequence[LogEntry]) -> Iterator[str]:
    """Report a journal that ends earlier than the log's first outcome, which has the session time of its end."""
    logged = ends[0].get("seconds") if ends else None
    if not isinstance(logged, float | int):
        return
    end = read_verdict(folder).seconds
    if end < logged - _ROUNDED:
        yield (
            f"{LOG_FILE}, line {ends[0].line}, says {logged:.3f} s, {JOURNAL} ends at {end:.3f} s: its end is missing"
        )


def outage_differences(folder: Path) -> list[str]:
    """List recoveries whose recorded downtime differs from the wall-clock times before and after it.

    Unlike `session_differences`, this reads the whole journal. A repaired journal is not compared, because lost records
    got the times of their neighbours.
    """
    labels = read_labels(folder / JOURNAL)
    if labels is None or not labels.get("wall") or any(folder.glob("journal.damaged-*")):
        return []
    return [
        f"{JOURNAL} says downtime = {each.downtime:.3f} at {each.t:.3f} s, but its times of day say {each.by_clock:.3f}"
        for each in reversed(read_recoveries(folder, labels.get("speed") or 1.0))
        if abs(each.downtime - each.by_clock) > CLOCK_TOLERANCE
    ]


def refuse_relabelled(folder: Path) -> None:
    """Refuse to read a session if two files, or the times in its journal, disagree about it.

    :param folder: the session's folder.
    :raises rise_engine.session.labels.RelabelledError: they disagree.
    """
    refuse_differences(folder, [*session_differences(folder), *outage_differences(folder)])


def _log_of(folder: Path) -> Sequence[LogEntry]:
    """Read the log of the study around the folder. Empty if there is none."""
    try:
        return read_kept_log(folder.resolve().parent.parent)
    except StudyLogError:
        return ()


# --- copies -----------------------------------------------------------------------------------------------------------


SESSIONS = "sessions"
"""The folder of the sessions within a study's folder."""
_MOVE_ADVICE = f"It does not count; move it out of {SESSIONS}/"


def session_folders(folder: Path) -> list[Path]:
    """Return the folders in a study's `sessions`, sorted by name."""
    found: list[Path] = []
    with suppress(OSError):
        found = sorted(Path(entry.path) for entry in os.scandir(folder / SESSIONS) if entry.is_dir())
    return found


def copied_sessions(folder: Path, log: Sequence[LogEntry]) -> dict[str, str]:
    """Find folders that are copies of another session: their journals begin with the same record. The original is the
    one in the log; otherwise the first by name.

    A session without dates (from a shared bundle) counts as a copy of one with dates.

    :param folder: the study's folder.
    :param log: the study's log.
    :return: a sentence for each copy, by the folder's name.
    """
    logged = {str(name): number for number, each in enumerate(log) if (name := each.get("folder"))}
    paths = sorted(session_folders(folder), key=lambda path: logged.get(path.name, len(log)))
    known = {path.name: labels for path in paths if (labels := read_labels(path / JOURNAL)) is not None}
    originals: dict[bytes, str] = {}
    copies: dict[str, str] = {}
    has_dates = any(labels.get("wall") for labels in known.values())
    for name, labels in known.items():
        if not labels.get("wall"):
            if has_dates:
                copies[name] = (
                    f"its journal has no dates, as the copies in bundles, and other sessions have them. {_MOVE_ADVICE}"
                )
            continue
        original = originals.setdefault(encode(labels), name)
        if original != name:
            copies[name] = f"it is a copy of {original}: both journals begin with the same record. {_MOVE_ADVICE}"
    return copies


def repeated_sessions(sessions: Iterable[SessionEntry]) -> dict[str, str]:
    """Find counted sessions of the same participant, run and attempt. The program never makes a second one.

    :param sessions: in the order in which they began.
    :return: a sentence for each repetition, by the folder's name.
    """
    found: dict[str, str] = {}
    first: dict[tuple[str, int, int], str] = {}
    for each in (session for session in sessions if session.purpose == "counted"):
        other = first.setdefault((each.participant, each.run, each.attempt), each.folder)
        if other != each.folder:
            found[each.folder] = (
                f"it is run {each.run}, attempt {each.attempt} of {each.participant}, and so is {other}: only one of "
                f"them can be, and both count. Find out which, and move the other one out of {SESSIONS}/"
            )
    return found
