"""Whether everything that says what a session is says the same: its journal, its session.toml, its study's log.

One difference is meant: a session that was run under the wrong participant is *reassigned* in the log, with a reason.
The journal stays as it is, and whoever asks whose session it is follows the log (`reassignment_of`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from msgspec import Struct

from rise_engine.session.folder import JOURNAL, info_differences
from rise_engine.session.labels import label_differences, read_labels, refuse_differences
from rise_engine.study.study_log import LOG_FILE, LogEntry, StudyLogError, read_kept_log
from rise_engine.study.withdrawn import PREFIX

_ABOUT_SESSIONS = frozenset({"session", "outcome", "reassigned"})
"""Kinds of entries that say what a session is."""


class Reassignment(Struct, frozen=True):
    """A session belongs to another participant than its journal says."""

    participant: str
    """Whose it is."""
    was: str
    """Under whom it was run."""
    slot: int | None
    """The row of the plan that went with it; None: it stayed with whoever held it."""
    attempt: int
    """Which attempt of theirs at this run it is."""
    reason: str

    @property
    def sentence(self) -> str:
        return f"run as {self.was}, and reassigned to {self.participant}: {self.reason}"

    @property
    def labels(self) -> dict[str, Any]:
        """What differs from the journal's first record."""
        return {"participant": self.participant, "slot": self.slot, "attempt": self.attempt}


def reassignments(log: Sequence[LogEntry]) -> dict[str, Reassignment]:
    """By the names of their folders, the sessions that were reassigned; the last word counts.

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
    """Whose session it is, when the log of its study says something else than its journal; None: what that says.

    :param folder: the session's.
    """
    return reassignments(_log_of(folder)).get(folder.resolve().name)


def session_differences(folder: Path, log: Sequence[LogEntry] | None = None) -> list[str]:
    """What session.toml and the log of its study say of a session otherwise than its journal.

    What the log says of a session that it has reassigned may be what the journal says, or what it is since.

    :param folder: the session's.
    :param log: the log's entries; None: they are read, of the study in whose folder it lies.
    :return: sentences that name both; none where all say the same.
    """
    found = info_differences(folder)
    name = folder.resolve().name
    told = [
        each
        for each in (_log_of(folder) if log is None else log)
        if each.kind in _ABOUT_SESSIONS and name in (each.get("folder"), each.get("session"))
    ]
    labels = read_labels(folder / JOURNAL) if told else None
    given: Mapping[str, Any] | None = labels
    for each in told:
        where = f"{LOG_FILE}, line {each.line},"
        if each.kind == "reassigned":
            if not str(each.get("was")).startswith(PREFIX):
                found += label_differences(given, {"participant": each.get("was")}, where)
            if labels is not None:
                given = {**labels, **reassignments([each])[name].labels}
            continue
        differences = label_differences(labels, each.fields, where)
        found += differences if label_differences(given, each.fields, where) else []
    return found


def refuse_relabelled(folder: Path) -> None:
    """Nothing is told of a session of which two files say different things.

    :param folder: the session's.
    :raises rise_engine.session.labels.RelabelledError: they do.
    """
    refuse_differences(folder, session_differences(folder))


def _log_of(folder: Path) -> Sequence[LogEntry]:
    """Of the study in whose folder it lies; none, where it lies in no study's."""
    try:
        return read_kept_log(folder.resolve().parent.parent)
    except StudyLogError:
        return ()
