"""What is due to be deleted, by `[retention]` of study.toml. Nothing is ever deleted by itself."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from datetime import date, datetime, timedelta
from pathlib import Path

from rise_engine.base.text import pluralize
from rise_engine.study.model import Study
from rise_engine.study.sessions import StudySession
from rise_engine.study.traces import registered_recordings

NAMED = 3
"""So many are named in a sentence; of the others, how many there are."""


def due_retention(study: Study, sessions: Iterable[StudySession], today: date) -> list[str]:
    """What was promised to be deleted by today and is still there, in sentences.

    :param study: the checked design: `retention` has days by `media` and `sessions`.
    :param sessions: as `rise_engine.study.sessions.read_sessions` gives them.
    :param today: the day that counts.
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
            names = _name_some([f"{path} of {day}" for path, day in paths.items()])
            due.append(f"{pluralize(len(paths), 'recording')} kept longer than {days:g} days, delete: {names}")
    days = study.retention.get("sessions")
    if days is not None:
        old = [f"{each.name}" for each, day in kept if day + timedelta(days=days) <= today]
        if old:
            due.append(f"{pluralize(len(old), 'session')} kept longer than {days:g} days, delete: {_name_some(old)}")
    return due


def _day(session: StudySession) -> date | None:
    with suppress(ValueError):
        return datetime.fromisoformat(session.entry.started).date()
    return None


def _name_some(names: list[str]) -> str:
    more = len(names) - NAMED
    return ", ".join(names[:NAMED]) + (f" and {more} more" if more > 0 else "")
