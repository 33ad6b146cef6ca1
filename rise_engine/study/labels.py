"""Whether everything that says what a session is says the same: its journal, its session.toml, its study's log."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rise_engine.session.folder import JOURNAL, info_differences
from rise_engine.session.labels import label_differences, read_labels, refuse_differences
from rise_engine.study.study_log import LOG_FILE, LogEntry, StudyLogError, read_kept_log

_ABOUT_SESSIONS = frozenset({"session", "outcome"})
"""Kinds of entries that say what a session is."""


def session_differences(folder: Path, log: Sequence[LogEntry] | None = None) -> list[str]:
    """What session.toml and the log of its study say of a session otherwise than its journal.

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
    for each in told:
        found += label_differences(labels, each.fields, f"{LOG_FILE}, line {each.line},")
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
