"""A session as tiers: rows of annotations, as those who code videos have them. ELAN, Praat and BORIS get theirs here.

Tiers follow one law: annotations do not overlap, each is at least a millisecond long, and none begins before 0. What a
session has beside that is laid out so that it holds: of two that overlap the second goes to a tier `NAME 2`, a moment
becomes an annotation of `MOMENT_MS` (or less, where the next begins earlier), and what lies before 0 falls off, and
is counted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.results.export.media_clock import MediaClock

Doer: TypeAlias = Literal["robot", "wizard", "participant", "session"]
"""Who does what a tier shows."""
MOMENT_MS = 100
"""How long a moment is drawn."""
ROBOT_SPEECH = "robot speech"
"""The tier that a session without anything has, since no program takes a file without tiers."""
_UNFIT = re.compile("[\x00-\x1f\x7f-\x9f\ud800-\udfff\ufffe\uffff\u2028\u2029]")
"""What XML cannot hold, or what ends a line somewhere: annotations are one line."""


class TierSpan(Struct, frozen=True, kw_only=True):
    """Something of a session, in session seconds, before it is laid out."""

    tier: str
    start: float
    end: float | None
    """None: it was a moment."""
    text: str
    code: str
    """The same whenever the same thing happens: an act's name, a rule with its state."""
    doer: Doer
    asked_by: str = ""
    """Of an act: the kind of who asked for it."""


class Annotation(Struct, frozen=True, kw_only=True):
    """One annotation, in milliseconds on the clock of what is annotated."""

    start: int
    end: int
    """Later than `start`."""
    moment: bool
    """Whether it had no length, and was given one to be seen."""
    text: str
    """Never empty, and one line."""
    span: TierSpan
    """What it was made from."""


class Tier(Struct, frozen=True, kw_only=True):
    """One row: annotations in the order of time that do not overlap."""

    name: str
    """One line, and no other tier of the session has it."""
    lane: int
    """0; 1 and more for those that hold what overlaps."""
    doer: Doer
    annotations: tuple[Annotation, ...]


class TierSet(Struct, frozen=True, kw_only=True):
    """All tiers of one session; there is at least one."""

    tiers: tuple[Tier, ...]
    lost: int
    """How many things fell off, because they had ended before 0."""
    end: int
    """Milliseconds at which the session, or the last annotation, ended; at least 1."""


def lay_out(
    spans: Iterable[TierSpan],
    clock: MediaClock,
    duration: float,
    *,
    group: Callable[[TierSpan], str] = lambda span: span.tier,
) -> TierSet:
    """Give every span its place in a tier; the tiers stand in the order in which their first spans come.

    `clock`: what session time becomes. `duration`: of the session, in session seconds. `group`: what must not overlap;
    its words become the tier's name.
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
    """The text as one line that XML and every reader can hold: blanks for line ends and tabs, `�` for controls."""
    text = text.replace("\r\n", " ")
    text = _UNFIT.sub(lambda found: " " if found[0] in "\t\n\r\x0b\x0c\x85\u2028\u2029" else "\ufffd", text)
    return text.strip()


class _Names:
    """Names of tiers that are told apart; a rule may be called `note 2`."""

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
    """A span in milliseconds, whose end may still move when it is a moment."""

    start: int
    end: int
    yields: bool
    """Whether it may end earlier, because the next begins."""
    span: TierSpan


def _pack(spans: list[TierSpan], clock: MediaClock) -> tuple[list[list[Annotation]], int]:
    """Rows without overlaps, as few as it takes, and how many spans lie before 0."""
    pieces: list[_LaidSpan] = []
    for span in spans:
        start = clock.to_ms(span.start)
        end = start if span.end is None else clock.to_ms(span.end)
        moment = end <= start
        if (start if moment else end - 1) < 0:
            continue
        pieces.append(_LaidSpan(max(start, 0), start + MOMENT_MS if moment else end, moment, span))
    fell_off = len(spans) - len(pieces)
    pieces.sort(key=lambda piece: piece.start)  # stable: what was told first comes first
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
