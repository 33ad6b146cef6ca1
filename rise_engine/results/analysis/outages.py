"""Interruptions: when a session had no engine, its computer was suspended, its engine stood still, or everything was
stopped, and which durations this affects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from rise_engine.kernel.records import ENGINE, AnyRecord, NoteRecord, SessionRecord, StopRecord
from rise_engine.results.analysis.model import Interruption, InterruptionKind, Outage, SessionData
from rise_engine.session.labels import downtime_by_clock

_KINDS: tuple[InterruptionKind, ...] = ("outage", "standstill", "stop")
"""The worst first."""
PARTLY_WITH = {"standstill": "the engine at a standstill", "stop": "everything stopped"}
"""What a duration says that was interrupted. That of an outage says its seconds."""


class OutageCollector:
    """A collector of interruptions. Give it a session's records in their order."""

    def __init__(self, speed: float = 1.0) -> None:
        """`speed`: session seconds per second of the wall clock."""
        self._speed = speed
        self.outages: list[Outage] = []
        """Those whose length is known."""
        self._before: AnyRecord | None = None
        self._found: list[Interruption] = []
        """All interruptions but the stop in force."""
        self._stopped_at: float | None = None
        """When everything was stopped. None: it is not."""

    def add(self, record: AnyRecord) -> float | None:
        """Take the next record. Returns the length of the outage that it ended, in seconds; None: it ended none, or the
        length is not known."""
        before, self._before = self._before, record
        if isinstance(record, StopRecord):
            self._add_stop(record)
        elif isinstance(record, NoteRecord) and record.stood is not None:
            if record.suspended:
                self._found.append(Interruption(kind="outage", at=record.t, until=record.t))
                self.outages.append(Outage(at=record.t, seconds=record.stood))
                return record.stood
            since = record.t - record.stood * self._speed
            self._found.append(Interruption(kind="standstill", at=since, until=record.t, seconds=record.stood))
        if not isinstance(record, SessionRecord) or record.status != "recovered":
            return None
        self._found.append(Interruption(kind="outage", at=record.t, until=record.t))
        if before is None:
            return None
        # The wall clock is hidden at some levels, and the number is the same at all.
        away = downtime_by_clock(before, record, self._speed) if record.downtime is None else record.downtime
        if away is None or away < -1.0:  # the computer's clock was set back meanwhile
            return None
        self.outages.append(Outage(at=record.t, seconds=max(0.0, round(away, 6))))
        return self.outages[-1].seconds

    def _add_stop(self, record: StopRecord) -> None:
        if record.status == "released":
            if self._stopped_at is not None:
                self._found.append(Interruption(kind="stop", at=self._stopped_at, until=record.t))
            self._stopped_at = None
        elif self._stopped_at is None and record.source != ENGINE:  # its own stop ends the session
            self._stopped_at = record.t

    @property
    def downtime(self) -> float | None:
        """Wall-clock seconds of all outages. None: the length of one is not known."""
        if len(self.outages) < sum(each.kind == "outage" for each in self._found):
            return None
        return round(sum((each.seconds for each in self.outages), 0.0), 6)

    def interruptions(self) -> tuple[Interruption, ...]:
        """Return all outages, standstills and stops."""
        if self._stopped_at is None:
            return tuple(self._found)
        return (*self._found, Interruption(kind="stop", at=self._stopped_at, until=float("inf")))


def interruption_between(
    interruptions: Iterable[Interruption], start: float | None, end: float | None
) -> InterruptionKind | None:
    """Return what interrupted the time from `start` to `end`, of several the worst. None: nothing, or one of the two is
    not known.

    >>> stop = Interruption(kind="stop", at=2.0, until=3.0)
    >>> interruption_between([stop], 1.0, 2.5), interruption_between([stop], 3.0, 4.0)
    ('stop', None)
    """
    if start is None or end is None:
        return None
    kinds = {
        each.kind
        for each in interruptions
        if (start < each.at <= end if each.at == each.until else each.at < end and start < each.until)
    }
    return worst(kinds)


def worst(kinds: Iterable[InterruptionKind | None]) -> InterruptionKind | None:
    """Return the worst of several interruptions. None: there is none."""
    found = set(kinds)
    return next((kind for kind in _KINDS if kind in found), None)


def seconds_without_engine(outages: Iterable[Outage], start: float | None, end: float | None) -> float | None:
    """Return how much more wall-clock than session time passed between `start` and `end`. None: no more."""
    if start is None or end is None:
        return None
    return round(sum(each.seconds for each in outages if start < each.at <= end), 6) or None


def wall_seconds(lasted: float | None, away: float | None, speed: float) -> float | None:
    """Return a duration by the wall clock. None: it is as in session time, or not known.

    :param lasted: session seconds.
    :param away: wall-clock seconds without an engine meanwhile.
    :param speed: session seconds per second of the wall clock.

    >>> wall_seconds(3.0, None, 1.0), wall_seconds(3.0, 5.0, 1.0), wall_seconds(3.0, 5.0, 4.0)
    (None, 8.0, 5.75)
    """
    if lasted is None:
        return None
    found = round(lasted / speed + (away or 0.0), 6)
    return None if found == lasted else found


def records_by_wall_clock(data: SessionData) -> Iterator[tuple[float, AnyRecord]]:
    """Give the records with their wall-clock seconds since the session began (at speed 1)."""
    outages, away = OutageCollector(data.facts.speed), 0.0
    for record in data.records:
        away += outages.add(record) or 0.0
        yield record.t + away, record


def seconds_away(outages: Iterable[Outage], at: float) -> float:
    """Return the seconds without an engine until a session time."""
    return sum((each.seconds for each in outages if each.at <= at), 0.0)
