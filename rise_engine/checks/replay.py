"""The last session of the study: whether it replays identically, so that what is recorded today can be trusted too."""

from __future__ import annotations

from contextlib import suppress
from datetime import datetime
from pathlib import Path

from rise_engine.base.errors import SessionError
from rise_engine.base.files import is_locked
from rise_engine.base.text import pluralize
from rise_engine.checks.outcome import Finding
from rise_engine.session.folder import JOURNAL, has_begun, read_info
from rise_engine.session.replay import compare_replay
from rise_engine.study.labels import refuse_relabelled


def look_at_last_session(sessions: Path) -> Finding:
    """What came of its replay (blocking, and long for a long session); a study without any session has passed.

    :param sessions: the study's folder of sessions.
    """
    folder = last_session(sessions)
    if folder is None:
        return Finding(True, "there is no earlier session")
    try:
        refuse_relabelled(folder)
        compared = compare_replay(folder)
    except SessionError as error:
        return Finding(False, folder.name, f"the last session cannot be replayed: {error}")
    if compared.identical:
        return Finding(True, f"{folder.name}: identical, {pluralize(compared.records, 'record')}")
    why = str(compared.difference) if compared.difference is not None else "something in its journal cannot be read"
    return Finding(False, folder.name, f"the last session does not replay identically: {why}")


def last_session(sessions: Path) -> Path | None:
    """The session that began last and does not run; None: there is none."""
    found: list[tuple[datetime, Path]] = []
    with suppress(OSError):
        for folder in sessions.iterdir():
            if has_begun(folder) and not is_locked(folder / JOURNAL):
                with suppress(SessionError, ValueError):
                    found.append((datetime.fromisoformat(read_info(folder, compare=False).started), folder))
    return max(found)[1] if found else None
