"""Times when a session had no engine: how long session time stood still, and which durations this affects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from datetime import datetime

from rise_engine.kernel.records import AnyRecord, SessionRecord
from rise_engine.results.analysis.model import Outage, SessionData


class OutageCollector:
    """A collector of outages. Give it a session's records in their order."""

    def __init__(self, speed: float = 1.0) -> None:
        """`speed`: session seconds per second of the wall clock."""
        self._speed = speed
        self.outages: list[Outage] = []
        self._before: AnyRecord | None = None

    def add(self, record: AnyRecord) -> float | None:
        """Take the next record. Returns the length of the outage that it ended, in seconds; None: it ended none."""
        before, self._before = self._before, record
        if before is None or not isinstance(record, SessionRecord) or record.status != "recovered":
            return None
        # Use the wall clock if the level shows it: old journals counted from the last record instead.
        passed = _seconds_between(before.wall, record.wall)
        away = record.downtime if passed is None else passed - (record.t - before.t) / self._speed
        if away is None or away <= 0:
            return None
        self.outages.append(Outage(at=record.t, seconds=round(away, 6)))
        return self.outages[-1].seconds


def seconds_without_engine(outages: Iterable[Outage], start: float | None, end: float | None) -> float | None:
    """Return how much more wall-clock than session time passed between `start` and `end`. None: no more."""
    if start is None or end is None:
        return None
    return round(sum(each.seconds for each in outages if start < each.at <= end), 6) or None


def records_by_wall_clock(data: SessionData) -> Iterator[tuple[float, AnyRecord]]:
    """Give the records with their wall-clock seconds since the session began (at speed 1)."""
    outages, away = OutageCollector(data.facts.speed), 0.0
    for record in data.records:
        away += outages.add(record) or 0.0
        yield record.t + away, record


def seconds_away(outages: Iterable[Outage], at: float) -> float:
    """Return the seconds without an engine until a session time."""
    return sum((each.seconds for each in outages if each.at <= at), 0.0)


def _seconds_between(earlier: str, later: str) -> float | None:
    try:
        return (datetime.fromisoformat(later) - datetime.fromisoformat(earlier)).total_seconds()
    except (ValueError, TypeError):  # a text is empty, or one of them has no zone
        return None
