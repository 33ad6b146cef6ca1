"""The course of a session: interruptions, the states of its rules, and single events.

A session is interrupted while it has no engine, its computer is suspended, its engine stands still, or everything is
stopped. Durations across an interruption are marked.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from sys import intern
from typing import Any

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.kernel.behaviors import started_rule
from rise_engine.kernel.records import (
    ENGINE,
    AnyRecord,
    CheckRecord,
    ConditionRecord,
    ControlRecord,
    CountdownRecord,
    CueRecord,
    EventRecord,
    FailureRecord,
    MemoryRecord,
    MistakeRecord,
    NoteRecord,
    RobotRecord,
    RuleRecord,
    ScenarioRecord,
    SessionRecord,
    StopRecord,
    SyncRecord,
    TaskRecord,
)
from rise_engine.kernel.view import SET_AT_START, condition_change
from rise_engine.results.analysis.model import (
    Interruption,
    InterruptionKind,
    Outage,
    Phase,
    PlayedAct,
    Point,
    PointKind,
    Repairs,
    SessionData,
    actor_of,
)
from rise_engine.scenario.speech.template import spoken_text
from rise_engine.session.labels import downtime_by_clock

_KINDS: tuple[InterruptionKind, ...] = ("outage", "standstill", "stop")
"""The worst first."""
PARTLY_WITH = {"standstill": "the engine at a standstill", "stop": "everything stopped"}
"""How a duration names an interruption. For an outage, it gives the seconds instead."""


class OutageCollector:
    """Collects interruptions. Give it a session's records in their order."""

    def __init__(self, speed: float = 1.0) -> None:
        """`speed`: session seconds per second of the wall clock."""
        self._speed = speed
        self.outages: list[Outage] = []
        """Outages of known length."""
        self._before: AnyRecord | None = None
        self._found: list[Interruption] = []
        """All interruptions except the current stop."""
        self._stopped_at: float | None = None
        """When everything was stopped. None: it is not stopped."""

    def add(self, record: AnyRecord) -> float | None:
        """Add the next record. Returns the seconds of the outage that it ended; None: none, or of unknown length."""
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
        # Some levels hide the wall clock; the result must be the same at all levels.
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
        elif self._stopped_at is None and record.source != ENGINE:  # the engine's own stop ends the session
            self._stopped_at = record.t

    @property
    def downtime(self) -> float | None:
        """Wall-clock seconds of all outages. None: the length of one is unknown."""
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
    """Return the worst interruption between `start` and `end`. None: there is none, or one of the two times is unknown.

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
    """Return a duration by the wall clock. None: it equals session time, or is unknown.

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


# --- states and events ------------------------------------------------------------------------------------------------


STEPPED_BACK = "stepped back"
_INTERRUPTED = "interrupted by "
_BY_WIZARD = re.compile(r"^(?!stop-all ).*\bby (wizard:[^,]*)")
"""Does not match stops of everything, which do not repair an act."""


class _Open(Struct):
    """The current state of a rule."""

    state: str
    start: float
    trigger: str
    source: str
    stepped_back: bool


class PhaseCollector:
    """Collects the states of rules. Give it a session's records in their order."""

    def __init__(self) -> None:
        self._open: dict[str, _Open] = {}
        self._phases: list[Phase] = []
        self._sources: dict[str, str] = {}
        """The source that last started each rule."""
        self._begun: set[str] = set()
        """Rules that have started but not entered their first state."""
        self.stepped_back = 0

    def add(self, record: AnyRecord) -> None:
        if isinstance(record, TaskRecord):
            if record.function == "startInteractionRule" and record.status == "ACTIVE":
                self._sources[started_rule(record.behavior)] = record.source
        elif isinstance(record, RuleRecord):
            self._add_rule(record)

    def phases(self, end: float) -> tuple[Phase, ...]:
        """Return every phase in the order of their starts.

        :param end: the end of the record, which ends the rules' last states.
        """
        left = [self._phase(rule, each, end, "") for rule, each in self._open.items()]
        return tuple(sorted((*self._phases, *left), key=lambda each: each.start))

    def _add_rule(self, record: RuleRecord) -> None:
        rule = record.name
        if record.status == "started":
            self._close(rule, record.t, "")
            self._begun.add(rule)
        elif record.status == "entered":
            self._close(rule, record.t, "")
            back = (record.trigger or "").startswith(STEPPED_BACK)
            self.stepped_back += back
            source = self._sources.get(rule, "") if rule in self._begun else ""
            self._begun.discard(rule)
            self._open[rule] = _Open(record.state or "", record.t, record.trigger or "", source, back)
        elif record.status in ("ended", "stopped", "faulted"):
            self._close(rule, record.t, record.status)

    def _close(self, rule: str, t: float, ended_by: str) -> None:
        if (found := self._open.pop(rule, None)) is not None:
            self._phases.append(self._phase(rule, found, t, ended_by))

    @staticmethod
    def _phase(rule: str, found: _Open, end: float, ended_by: str) -> Phase:
        return Phase(
            rule=intern(rule),
            state=intern(found.state),
            start=found.start,
            end=end,
            trigger=intern(found.trigger),
            source=found.source,
            ended_by=ended_by,
            stepped_back=found.stepped_back,
        )


class PointCollector:
    """Collects single events. Give it a session's records in their order."""

    def __init__(self) -> None:
        self._points: list[Point] = []
        self._marks: dict[int, int] = {}
        """For each task, the index of the point with its mark. The last mark counts; `none` removes it."""
        self._ending = False
        """Whether the last stop was the engine's own at the session's end, not a person's."""

    def add(self, record: AnyRecord, outage: float | None = None) -> None:
        """Add the next record. `outage`: the seconds without an engine that it ended."""
        if isinstance(record, MistakeRecord):
            if (before := self._marks.pop(record.task, None)) is not None:
                self._points[before] = replace(self._points[before], name="")
            if record.mark == "none":
                return
            self._marks[record.task] = len(self._points)
        point = _point_of(record)
        if isinstance(record, StopRecord):
            if record.status == "requested":
                self._ending = record.source == ENGINE
            if self._ending and not record.unconfirmed:
                return
        if point is not None:
            self._points.append(point if outage is None else replace(point, outage_s=outage))

    def points(self) -> tuple[Point, ...]:
        """Return all points in the order of the record, without removed and replaced marks. A sync mark has the time of
        its start, which is before its record."""
        return tuple(point for point in self._points if point.kind != "mistake" or point.name)


class ConditionCollector:
    """Collects the memory keys of a condition that a wizard changed. Give it a session's records in their order."""

    def __init__(self) -> None:
        self._given: dict[str, Any] = {}
        self._changed: dict[str, float] = {}

    def add(self, record: AnyRecord) -> None:
        if not isinstance(record, MemoryRecord):
            return
        if record.source in SET_AT_START:
            self._given[record.key] = record.value
        elif actor_of(record.source) == "wizard" and (change := condition_change(record, self._given)) is not None:
            key, is_other = change
            if is_other:
                self._changed.setdefault(key, record.t)

    def keys(self) -> dict[str, float]:
        """Return the keys with the session times of their first changes."""
        return dict(self._changed)


def _point_of(record: AnyRecord) -> Point | None:
    def point(kind: PointKind, name: str, value: str = "", source: str = "", task: int | None = None) -> Point:
        # Share equal texts: a long session has hundreds of thousands of copies of a few.
        return Point(at=record.t, kind=kind, name=intern(name), value=value, source=intern(source), task=task)

    match record:
        case NoteRecord():
            return point("note", "note", record.text, record.source)
        case MistakeRecord():
            return point("mistake", record.mark, record.act, record.source, record.task)
        case StopRecord():
            unconfirmed = record.unconfirmed if record.status == "latched" else ()
            return point(
                "stop", record.status, f"not confirmed: {', '.join(unconfirmed)}" if unconfirmed else "", record.source
            )
        case SyncRecord():
            began = record.at if record.at is not None else record.t
            return Point(at=began, kind="sync", name=str(record.number), value=record.medium, source=record.source)
        case EventRecord():
            return point("event", record.topic, record.taken_by or "", record.source)
        case MemoryRecord():
            value = "" if record.deleted else "null" if record.value is None else spoken_text(record.value)
            return point("memory", record.key, value, record.source)
        case ControlRecord():
            return point("control", record.status, record.holder or "", record.by)
        case RobotRecord():
            return point("robot", record.status, record.detail)
        case SessionRecord(status="recovered"):
            return point("recovery", "recovered", record.reason)
        case ScenarioRecord():
            return point("scenario", "changed files", "; ".join(record.changes), record.source)
        case CheckRecord():
            return point("check", record.id, record.result, record.source)
        case RuleRecord() if record.status == "faulted":
            return point("fault", record.name, record.reason, f"rule:{record.name}")
        case TaskRecord() if record.status == "ABORTED" and record.function != "startInteractionRule":
            name = record.behavior if record.function == "startCommunicationRobotAct" else record.function
            return point("fault", name, record.reason, record.source, record.id)
        case ConditionRecord() if record.error:
            return point("fault", record.rule, record.error, f"rule:{record.rule}")
        case CountdownRecord() if record.status == "failed":
            return point("fault", record.rule, record.reason, f"rule:{record.rule}")
        case _:
            return None


def count_repairs(
    records: Iterable[AnyRecord], acts: Iterable[PlayedAct], stepped_back: int, fillers: Collection[str]
) -> Repairs:
    """Count the repairs during a session.

    :param records: the session's records.
    :param acts: its acts.
    :param stepped_back: how often a rule was moved back to an earlier state.
    :param fillers: the scenario's filler acts.
    """
    counts = Counter(
        (type(each), each.status) for each in records if isinstance(each, FailureRecord | CueRecord | StopRecord)
    )
    by_task = {act.task: act for act in acts}
    return Repairs(
        repeated=counts[FailureRecord, "repeated"],
        stepped_back=stepped_back,
        cues_undone=counts[CueRecord, "undone"],
        canceled=sum(was_stopped_by_wizard(act, by_task, fillers) for act in by_task.values()),
        released=counts[StopRecord, "released"],
    )


def was_stopped_by_wizard(act: PlayedAct, acts: Mapping[int, PlayedAct], fillers: Collection[str]) -> bool:
    """Whether a wizard stopped an act after its start, or replaced it. An answer may replace a filler."""
    if act.status != "CANCELED" or act.started_at is None:
        return False
    if (found := _BY_WIZARD.search(act.reason)) is not None:
        return actor_of(found[1]) == "wizard"
    if not act.reason.startswith(_INTERRUPTED) or act.filler or act.act in fillers:
        return False
    name, ended = act.reason.removeprefix(_INTERRUPTED), act.ended_at or act.started_at
    before = [each for each in acts.values() if each.act == name and each.accepted_at <= ended and each.task > act.task]
    return bool(before) and max(before, key=lambda each: each.task).actor == "wizard"
