"""A session as tiers, which are rows of annotations for video coding. ELAN, Praat and BORIS get theirs from here.

Annotations of a tier never overlap, are at least a millisecond long, and do not begin before 0. The layout ensures
this: of two that overlap, the second goes to a tier `NAME 2`; a moment becomes an annotation of `MOMENT_MS` (or less,
if the next one begins earlier); what is before 0 is left out and counted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.results.export.media_clock import MediaClock

Doer: TypeAlias = Literal["robot", "wizard", "participant", "session"]
"""Who acts in a tier."""
MOMENT_MS = 100
"""The length of an annotation for a moment."""
ROBOT_SPEECH = "robot speech"
"""The only tier of an empty session, because no program accepts a file without tiers."""
_UNFIT = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff\u2028\u2029]")
"""Characters that XML cannot hold, or that end a line somewhere. Annotations have one line."""


class TierSpan(Struct, frozen=True, kw_only=True):
    """A part of a session in session seconds, before it is laid out."""

    tier: str
    start: float
    end: float | None
    """None: it was a moment."""
    text: str
    code: str
    """A code that is the same for equal events: an act's name, a rule with its state."""
    doer: Doer
    asked_by: str = ""
    """The kind of requester, for an act."""


class Annotation(Struct, frozen=True, kw_only=True):
    """One annotation, in milliseconds on the clock of the annotations."""

    start: int
    end: int
    """Later than `start`."""
    moment: bool
    """Whether it had no length and got one to be visible."""
    text: str
    """One line, never empty."""
    span: TierSpan
    """Its source."""


class Tier(Struct, frozen=True, kw_only=True):
    """One row of annotations in the order of time, without overlaps."""

    name: str
    """One line, unique in the session."""
    lane: int
    """0, or a higher number for overlapping annotations."""
    doer: Doer
    annotations: tuple[Annotation, ...]


class TierSet(Struct, frozen=True, kw_only=True):
    """All tiers of one session. There is at least one."""

    tiers: tuple[Tier, ...]
    lost: int
    """The number of spans left out because they ended before 0."""
    end: int
    """Milliseconds at which the session or the last annotation ended, at least 1."""


def lay_out(
    spans: Iterable[TierSpan],
    clock: MediaClock,
    duration: float,
    *,
    group: Callable[[TierSpan], str] = lambda span: span.tier,
) -> TierSet:
    """Lay out all spans in tiers, which are in the order of their first spans.

    `clock`: converts session time. `duration`: the session's length in session seconds. `group`: spans with the same
    result must not overlap; it becomes the tier's name.
    """
    groups: dict[str, list[TierSpan]] = {}
    for span in spans:
        groups.setdefault(one_line(group(span)) or "?", []).append(span)
    names = _Names(groups)
    tiers: list[Tier] = []
    lost = 0
    for name, members in groups.items():
        doers = {span.doer for span in members}
        doer: Doer = members[0].doer if len(doers) == 1 else "session"
        lanes, fell_off = _pack(members, clock)
        lost += fell_off
        for number, lane in enumerate(lanes):
            given = names.give(name, number)
            tiers.append(Tier(name=given, lane=number, doer=doer, annotations=tuple(lane)))
    if not tiers:
        tiers.append(Tier(name=ROBOT_SPEECH, lane=0, doer="robot", annotations=()))
    ends = [tier.annotations[-1].end for tier in tiers if tier.annotations]
    return TierSet(tiers=tuple(tiers), lost=lost, end=max([1, clock.to_ms(duration), *ends]))


def one_line(text: str) -> str:
    """Convert a text to one line that XML and all readers accept: blanks for line ends and tabs, `�` for controls."""
    text = text.replace("\r\n", " ")
    text = _UNFIT.sub(lambda found: " " if found[0] in "\t\n\r\x0b\x0c\x85\u2028\u2029" else "\ufffd", text)
    return text.strip()


class _Names:
    """A source of unique tier names. A rule may be called `note 2`."""

    def __init__(self, groups: Iterable[str]) -> None:
        self._taken = set(groups)

    def give(self, name: str, lane: int) -> str:
        if lane == 0:
            return name
        number = lane + 1
        while f"{name} {number}" in self._taken:
            number += 1
        self._taken.add(f"{name} {number}")
        return f"{name} {number}"


class _LaidSpan(Struct):
    """A span in milliseconds. The end of a moment may still move."""

    start: int
    end: int
    yields: bool
    """Whether it may end earlier, because the next one begins."""
    span: TierSpan


def _pack(spans: list[TierSpan], clock: MediaClock) -> tuple[list[list[Annotation]], int]:
    """Return as few rows without overlaps as possible, and the number of spans before 0."""
    pieces: list[_LaidSpan] = []
    for span in spans:
        start = clock.to_ms(span.start)
        end = start if span.end is None else clock.to_ms(span.end)
        moment = end <= start
        if (start if moment else end - 1) < 0:
            continue
        pieces.append(_LaidSpan(max(start, 0), start + MOMENT_MS if moment else end, moment, span))
    fell_off = len(spans) - len(pieces)
    pieces.sort(key=lambda piece: piece.start)  # stable: keeps the order of equal starts
    lanes: list[list[_LaidSpan]] = []
    for piece in pieces:
        for lane in lanes:
            last = lane[-1]
            if last.end <= piece.start or (last.yields and last.start < piece.start):
                last.end = min(last.end, piece.start)
                lane.append(piece)
                break
        else:
            lanes.append([piece])
    return [[_annotation(piece) for piece in lane] for lane in lanes], fell_off


def _annotation(piece: _LaidSpan) -> Annotation:
    text = one_line(piece.span.text) or one_line(piece.span.code) or "?"
    return Annotation(start=piece.start, end=piece.end, moment=piece.yields, text=text, span=piece.span)
