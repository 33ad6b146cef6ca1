"""Session folders that must not count because another one holds the same session."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

from rise_engine.base.json_codec import encode
from rise_engine.session.journal_format import JOURNAL
from rise_engine.session.labels import read_labels
from rise_engine.study.model import SessionEntry
from rise_engine.study.study_log import LogEntry

SESSIONS = "sessions"
"""The folder of the sessions within a study's folder."""
_AWAY = f"It does not count; move it out of {SESSIONS}/"


def session_folders(folder: Path) -> list[Path]:
    """Return the folders in a study's `sessions`, sorted by name."""
    found: list[Path] = []
    with suppress(OSError):
        found = sorted(Path(entry.path) for entry in os.scandir(folder / SESSIONS) if entry.is_dir())
    return found


def copied_sessions(folder: Path, log: Sequence[LogEntry]) -> dict[str, str]:
    """Find folders that are copies of another session, so that no session counts twice: their journals begin with the
    same record. The log tells which one is the session; without it, the first by name.

    A session of a bundle that is shared has no dates. Among sessions with dates it is a copy.

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
                    f"its journal has no dates, as the copies in bundles, and other sessions have them. {_AWAY}"
                )
            continue
        original = originals.setdefault(encode(labels), name)
        if original != name:
            copies[name] = f"it is a copy of {original}: both journals begin with the same record. {_AWAY}"
    return copies


def repeated_sessions(sessions: Iterable[SessionEntry]) -> dict[str, str]:
    """Find counted sessions of the same participant, run and attempt. The program never makes a second one.

    :param sessions: in the order in which they began.
    :return: a sentence for each session that another one precedes, by the folder's name.
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
