"""Moments of a session and of one of its files, as `--at` of `rise-engine media add` and `coded add` gives them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from msgspec import Struct

from rise_engine.cli.terminal import exit_with_usage
from rise_engine.kernel.records import SessionRecord, SyncRecord
from rise_engine.results.analysis.course import OutageCollector
from rise_engine.results.analysis.model import Outage
from rise_engine.run.recording.alignment import UNKNOWN_WITHIN, SessionMark
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.labels import read_labels
from rise_engine.session.media import FoundMark
from rise_engine.study.labels import refuse_relabelled

_MARK = re.compile(r"mark *(\d+)")
_CLOCK = re.compile(r"(?:(\d+):)?(\d+):(\d+(?:\.\d*)?)")


class MarksAndOutages(Struct):
    """What the journal of a session says about its clock."""

    marks: list[SessionMark]
    interruptions: list[float]
    """When the session continued after an interruption, in session seconds."""
    outages: list[Outage]
    """The interruptions whose length is known."""


def read_marks(folder: Path) -> MarksAndOutages:
    """Read a session's marks and interruptions. Raises SessionError."""
    refuse_relabelled(folder)
    marks: list[SessionMark] = []
    interruptions: list[float] = []
    collector = OutageCollector((read_labels(folder / JOURNAL) or {}).get("speed") or 1.0)
    for record in read_journal(folder / JOURNAL).read_records():
        away = collector.add(record)
        if away is not None or (isinstance(record, SessionRecord) and record.status == "recovered"):
            interruptions.append(record.t)
        elif isinstance(record, SyncRecord):
            within = record.within if record.within is not None else UNKNOWN_WITHIN
            at = record.at if record.at is not None else record.t
            marks.append(SessionMark(record.number, at, within, record.medium, len(interruptions)))
    return MarksAndOutages(marks, interruptions, collector.outages)


def parse_moment(text: str, marks: Sequence[SessionMark]) -> FoundMark:
    """Parse `--at`. Ends the command if it is invalid.

    >>> parse_moment("14.5=12", []), parse_moment("-1.5", []).media_at
    (FoundMark(number=0, session_at=12.0, media_at=14.5, strength=0.0), 0.0)
    """
    in_file, equals, in_session = text.partition("=")
    if not equals:
        return FoundMark(0, _parse_seconds(text, text), 0.0, 0.0)
    media_at = _parse_seconds(in_file, text)
    if found := _MARK.fullmatch(in_session.strip()):
        number = int(found[1])
        named = [each for each in marks if each.number == number]
        if len(named) == 1:
            return FoundMark(number, named[0].at, media_at, 0.0)
        known = ", ".join(str(each.number) for each in marks) or "none"
        why = f"has {len(named)} marks {number}: give the session's second" if named else f"has no mark {number}"
        exit_with_usage(f"--at {text}: the session {why}; its marks are {known}")
    return FoundMark(0, _parse_seconds(in_session, text), media_at, 0.0)


def _parse_seconds(part: str, text: str) -> float:
    """Parse seconds, or h:mm:ss."""
    part = part.strip()
    if found := _CLOCK.fullmatch(part):
        return int(found[1] or 0) * 3600 + int(found[2]) * 60 + float(found[3])
    try:
        seconds = float(part)
    except ValueError:
        seconds = float("nan")
    if not abs(seconds) < 1e7:
        exit_with_usage(f"--at {text}: {part!r} is no time: write seconds (75.2), a clock (1:15.2), or FILE=markN")
    return seconds
