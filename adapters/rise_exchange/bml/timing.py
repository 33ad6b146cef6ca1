"""Converts the starts of a block's behaviours to what an act's actions wait for.

An action begins when all awaited actions have ended, and its duration is its own. So the block's start, the end of
behaviours and the start of another behaviour can be kept exactly, also plus a number of seconds. All other times are
refused with the reason (docs/reference/bml.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from decimal import Decimal

from msgspec import Struct

from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.model import SourceLocation
from rise_exchange.bml.block_file import BmlElement
from rise_exchange.bml.core_behavior import SyncTime, parse_sync
from rise_exchange.bml.names import TIME, ConversionFindings
from rise_exchange.bml.vocabulary import END, INNER_POINTS, MARKS, START

_ACT_LIMITS = "an act can wait for the end of an action, and then some seconds; it knows no point within one"
_LONGEST_CIRCLE = 20
"""Maximum number of behaviours in a sentence."""


class Beginning(Struct, frozen=True):
    """Seconds after the end of the last of some behaviours; without any, after the block's start."""

    behind: tuple[str, ...] = ()
    seconds: Decimal = Decimal(0)


class PlannedBehavior(Struct):
    """A behaviour, and the block's statements about its times."""

    id: str
    element: BmlElement
    start: str | None
    end: str | None
    after: list[tuple[SyncTime, SourceLocation]]
    """From constraints: times that must be over."""
    start_location: SourceLocation
    end_location: SourceLocation


class BlockTimes:
    """Determines the start of each behaviour."""

    def __init__(self, behaviors: Mapping[str, PlannedBehavior], block: str, findings: ConversionFindings) -> None:
        """
        :param behaviors: the behaviours by id.
        :param block: the block's id, which may precede those of its behaviours.
        """
        self._behaviors = behaviors
        self._block = block
        self._findings = findings
        self._known: dict[str, tuple[Beginning, ...] | None] = {}

    def beginnings(self, id: str) -> tuple[Beginning, ...] | None:
        """Return what a behaviour waits for: all of these; None, after a diagnostic: its start cannot be kept."""
        open_ids = [id]
        while open_ids:  # first, what it waits for
            behavior = self._behaviors[open_ids[-1]]
            wanted = next((each for each in self._waited_for(behavior) if each not in self._known), None)
            if behavior.id in self._known:
                open_ids.pop()
            elif wanted is None:
                self._known[behavior.id] = self._work_out(behavior)
                open_ids.pop()
            elif wanted in open_ids:
                circle = [*open_ids[open_ids.index(wanted) :], wanted]
                shown = " -> ".join(circle if len(circle) <= _LONGEST_CIRCLE else [*circle[:5], "...", *circle[-5:]])
                self._refuse(behavior.start_location, f"these behaviours wait for each other: {shown}")
                self._known[behavior.id] = None
            else:
                open_ids.append(wanted)
        return self._known[id]

    def _waited_for(self, behavior: PlannedBehavior) -> list[str]:
        """The behaviours that a start depends on."""
        start = parse_sync(behavior.start) if behavior.start is not None else None
        times = [time for time, _ in behavior.after] + ([start] if start is not None else [])
        return [time.behavior for time in times if time.behavior in self._behaviors]

    def duration(self, behavior: PlannedBehavior) -> Decimal | None:
        """The seconds from its start to its `end`, if that length does not depend on others.

        None without an `end`, and, after a diagnostic, for an `end` that depends on something else.
        """
        if behavior.end is None:
            return None
        end = self._read(behavior.end, behavior.end_location)
        if end is None:
            return None
        if (end.behavior, end.point) == (behavior.id, START):
            return self._positive(end.offset, behavior)
        start = parse_sync(behavior.start) if behavior.start is not None and not behavior.after else None
        if start is not None and (start.behavior, start.point) == (end.behavior, end.point):
            return self._positive(end.offset - start.offset, behavior)
        message = f"`end` cannot be {behavior.end}: an action ends when it has done what it does"
        if start is None and not end.behavior:
            message += "; with a `start` in seconds, `end` would be its length"
        self._refuse(behavior.end_location, message)
        return None

    def _positive(self, seconds: Decimal, behavior: PlannedBehavior) -> Decimal | None:
        if seconds >= 0:
            return seconds
        self._refuse(behavior.end_location, f"`{behavior.id}` would end before it has begun")
        return None

    def _work_out(self, behavior: PlannedBehavior) -> tuple[Beginning, ...] | None:
        found: list[Beginning] = []
        times = list(behavior.after)
        if behavior.start is not None:
            start = self._read(behavior.start, behavior.start_location)
            if start is None:
                return None
            if times:
                message = (
                    f"`start` says when exactly `{behavior.id}` begins, and <after> in line {times[0][1].line} says "
                    "that it may be later; an act cannot hold both"
                )
                self._refuse(behavior.start_location, message)
                return None
            times = [(start, behavior.start_location)]
        for time, location in times:
            beginnings = self._beginnings_of(time, location)
            if beginnings is None:
                return None
            found += (each for each in beginnings if each not in found and each != Beginning())
        return tuple(found)

    def _beginnings_of(self, time: SyncTime, location: SourceLocation) -> tuple[Beginning, ...] | None:
        if not time.behavior:
            return (Beginning((), time.offset),)
        if not self._is_of_block(time, location):
            return None
        if time.behavior not in self._behaviors:
            near = did_you_mean(time.behavior, self._behaviors)
            self._refuse(location, f"there is no behaviour `{time.behavior}` in this block{near}")
            return None
        if time.point == END:
            if time.offset < 0:
                before = f"{-time.offset} s before the end of `{time.behavior}`"
                message = f"{before} cannot be kept: that time is unknown"
                self._refuse(location, message)
                return None
            known = self._known[time.behavior] is not None
            return (Beginning((time.behavior,), time.offset),) if known else None
        if time.point != START:
            self._refuse_point(time, location)
            return None
        others = self._known[time.behavior]
        if others is None:
            return None
        if len(others) < 2:
            other = others[0] if others else Beginning()
            if other.seconds + time.offset >= 0:
                return (Beginning(other.behind, other.seconds + time.offset),)
        elif not time.offset:
            return others
        elif time.offset > 0 and not any(each.seconds for each in others):
            return (Beginning(tuple(dict.fromkeys(id for each in others for id in each.behind)), time.offset),)
        message = f"`{time.behavior}:start` with this offset cannot be kept: it is not a fixed time after an end"
        self._refuse(location, message)
        return None

    def _read(self, text: str, location: SourceLocation) -> SyncTime | None:
        time = parse_sync(text)
        if time is None:
            message = f"`{text}` is not a time of BML 1.0; write 1.5, or greet:end + 0.5"
            self._refuse(location, message)
            return None
        return time if self._is_of_block(time, location) else None

    def _is_of_block(self, time: SyncTime, location: SourceLocation) -> bool:
        """Whether a time belongs to this block. If not, it is reported."""
        if time.block in ("", self._block):
            return True
        if time.block in self._behaviors:
            point = f"{time.block}:{time.behavior}:{time.point}"
            self._refuse(location, f"`{point}` is a point within `{time.block}`; {_ACT_LIMITS}")
        else:
            message = f"`{time.block}` is another block; an act cannot wait for what is in another act"
            self._refuse(location, message)
        return False

    def _refuse_point(self, time: SyncTime, location: SourceLocation) -> None:
        behavior = self._behaviors[time.behavior]
        marks = {each.get("id") for each in _marks_in(behavior.element)}
        if time.point in marks:
            message = f"`{time.point}` is a mark in the words of `{time.behavior}`; {_ACT_LIMITS}"
        elif time.point in INNER_POINTS:
            message = f"`{time.behavior}:{time.point}` is a point within a behaviour; {_ACT_LIMITS}"
        else:
            near = did_you_mean(time.point, (START, END))
            message = f"`{time.behavior}` has no sync point `{time.point}`{near}"
        self._refuse(location, message)

    def _refuse(self, location: SourceLocation, message: str) -> None:
        self._findings.diagnostics.error(TIME, location, message)


def _marks_in(element: BmlElement) -> list[BmlElement]:
    return [each for child in element for each in (child, *_marks_in(child)) if each.tag in MARKS]


def read_constraint(
    element: BmlElement, behaviors: Mapping[str, PlannedBehavior], refuse: Callable[[SourceLocation, str], None]
) -> None:
    """Add a `<constraint>` to the behaviours that it concerns.

    :param refuse: called for everything that cannot be kept.
    """
    for relation in element:
        syncs = [each for each in relation if each.is_bml and each.get("ref") is not None]
        if relation.tag == "before":
            message = "an act cannot make something happen before: it only waits for what has ended"
            refuse(relation.location, message)
        elif relation.tag == "after" and relation.get("ref") is not None:
            for sync in syncs:
                _read_relation(sync, relation, behaviors, refuse, exact=False)
        elif relation.tag == "synchronize":
            first = relation if relation.get("ref") is not None else syncs.pop(0) if syncs else None
            for sync in syncs:
                if first is not None:
                    _read_relation(sync, first, behaviors, refuse, exact=True)


def _read_relation(
    sync: BmlElement,
    reference: BmlElement,
    behaviors: Mapping[str, PlannedBehavior],
    refuse: Callable[[SourceLocation, str], None],
    *,
    exact: bool,
) -> None:
    """Read one `<sync>` at the time of `reference` or, if not `exact`, not before it."""
    written, wanted = sync.get("ref") or "", reference.get("ref") or ""
    moved, time = parse_sync(written), parse_sync(wanted)
    location = sync.value_location("ref")
    if moved is None or time is None:
        refuse(location if moved is None else reference.value_location("ref"), "this is not a time of BML 1.0")
        return
    if exact and moved.point != START and time.point == START:
        moved, time, written, wanted = time, moved, wanted, written
    behavior = behaviors.get(moved.behavior)
    if behavior is None:
        refuse(
            location, f"there is no behaviour `{moved.behavior}` in this block{did_you_mean(moved.behavior, behaviors)}"
        )
    elif moved.point != START or moved.offset:
        refuse(location, f"only the start of a behaviour can wait, not `{written}`; {_ACT_LIMITS}")
    elif not exact:
        if time.offset < 0:
            refuse(
                reference.value_location("ref"),
                "a time before an end cannot be kept: the end is unknown until it happens",
            )
        else:
            behavior.after.append((time, reference.value_location("ref")))
    elif behavior.start is None:
        behavior.start, behavior.start_location = wanted, reference.value_location("ref")
    elif parse_sync(behavior.start) != time:
        refuse(location, f"`{behavior.id}` has a `start` already; an act cannot hold both")
