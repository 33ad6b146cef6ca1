"""The alignment of a recording with the session's clock, by marks found in it or by given moments.

  media time = offset + rate * session time, both in seconds (`rise_engine.session.media`).

A recorder's clock is off by some tens of millionths: 50 ppm are 90 ms in half an hour. So each end has a mark. A
sound's sweep and its distance from other sounds identify the mark: between two clocks that distance differs by
`USUAL_DRIFT` at most. An ambiguous result is reported, not guessed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

from msgspec import Struct

from rise_engine.base.text import pluralize
from rise_engine.run.recording.chirp import Sweep, sweep_of
from rise_engine.session.media import FoundMark

USUAL_DRIFT = 500e-6
"""Maximum difference of two clocks. Quartz crystals keep 100 ppm."""
LARGEST_DRIFT = 2_000e-6
"""The limit if nothing else fits: 1,001 ppm is a film played at 30 frames a second instead of 29.97."""
UNKNOWN_WITHIN = 0.5
"""Assumed maximum error in seconds of a mark's time if the record does not state it."""
_MAX_TIMES = 6
"""Maximum number of times in a sentence."""


class SessionMark(Struct, frozen=True):
    """A mark that was given in the session."""

    number: int
    at: float
    """Session time in seconds."""
    within: float = UNKNOWN_WITHIN
    """Maximum error of that in seconds."""
    medium: str = "sound"
    part: int = 0
    """The number of earlier interruptions of the session, during which only a camera's clock runs."""


class HeardMark(Struct, frozen=True):
    """A sound in a file that resembles a mark."""

    sweep: Sweep
    at: float
    """Seconds in the file at which it begins."""
    strength: float
    """Its ratio to the best match elsewhere in the file."""


class Alignment(Struct, frozen=True):
    """The position of a file on the session's clock."""

    offset: float | None = None
    """None: unknown; `problem` says why."""
    rate: float = 1.0
    marks: tuple[FoundMark, ...] = ()
    within: float | None = None
    """Maximum error in seconds between the marks, as far as their times are known."""
    remarks: tuple[str, ...] = ()
    """Remarks about it, in sentences."""
    problem: str = ""

    @property
    def rate_within_ppm(self) -> float | None:
        """The maximum error of the rate in millionths; None: it was not measured."""
        if len(self.marks) < 2 or self.within is None:
            return None
        return 2e6 * self.within / (self.marks[-1].session_at - self.marks[0].session_at)


_Pair = tuple[SessionMark, HeardMark]


def align_by_marks(marks: Sequence[SessionMark], heard: Sequence[HeardMark]) -> Alignment:
    """Match sounds to marks, and compute the alignment.

    :param marks: the session's audible marks.
    :param heard: the sounds found in the file.
    :return: without an offset if no match fits, or several do.
    """
    if not marks:
        return Alignment(problem="the session has no mark that could be heard: use --at FILE=SESSION for a moment")
    if not heard:
        return Alignment(problem=f"none of the session's {pluralize(len(marks), 'mark')} was found in the file")
    for limit in (USUAL_DRIFT, LARGEST_DRIFT):
        found = _best_matches(marks, heard, limit)
        if len(found) == 1:
            return _align_pairs(marks, heard, found[0])
        if found:
            return Alignment(problem=_ambiguity_text(found))
    return _single(marks, heard)


def _best_matches(marks: Sequence[SessionMark], heard: Sequence[HeardMark], limit: float) -> list[tuple[_Pair, ...]]:
    """Return every assignment of sounds to marks that explains the most marks, at least two."""
    found: dict[tuple[_Pair, ...], None] = {}
    for first, last in combinations(sorted(marks, key=lambda mark: mark.at), 2):
        if first.part != last.part:
            continue
        for begin, end in _pairs_that_fit(first, last, heard, limit):
            rate = (end.at - begin.at) / (last.at - first.at)
            pairs = {first: begin, last: end}
            for mark in marks:
                if mark not in pairs and mark.part == first.part:
                    pairs |= _nearest(mark, begin.at + rate * (mark.at - first.at), heard)
            found[tuple(sorted(pairs.items(), key=lambda pair: pair[0].at))] = None
    most = max(map(len, found), default=0)
    return [each for each in found if len(each) == most]


def _pairs_that_fit(
    first: SessionMark, last: SessionMark, heard: Sequence[HeardMark], limit: float
) -> Iterator[tuple[HeardMark, HeardMark]]:
    between = last.at - first.at
    allowed = limit * between + first.within + last.within
    for begin in heard:
        if begin.sweep != sweep_of(first.number):
            continue
        for end in heard:
            fits = end.at > begin.at and abs(end.at - begin.at - between) <= allowed
            if fits and end.sweep == sweep_of(last.number):
                yield begin, end


def _nearest(mark: SessionMark, at: float, heard: Sequence[HeardMark]) -> dict[SessionMark, HeardMark]:
    """Find the sound of a further mark; empty: none."""
    allowed = 2 * mark.within + 0.01
    near = [each for each in heard if each.sweep == sweep_of(mark.number) and abs(each.at - at) <= allowed]
    return {mark: min(near, key=lambda each: abs(each.at - at))} if near else {}


def _align_pairs(marks: Sequence[SessionMark], heard: Sequence[HeardMark], pairs: Sequence[_Pair]) -> Alignment:
    offset, rate = fit_line([(mark.at, sound.at) for mark, sound in pairs])
    remarks = [f"mark {mark.number} was not found" for mark in marks if mark not in dict(pairs)]
    used = {sound for _, sound in pairs}
    others = [each for each in heard if each not in used]
    if others:
        remarks.append(f"the file has {pluralize(len(others), 'mark')} of another session, at {_times(others)}")
    if abs(rate - 1) > USUAL_DRIFT:
        remarks.append(
            f"its clock differs by {abs(rate - 1) * 1e6:,.0f} ppm, which is more than the drift of a clock: "
            "check whether it was converted to another frame rate"
        )
    return Alignment(
        offset,
        rate,
        tuple(FoundMark(mark.number, mark.at, round(sound.at, 6), round(sound.strength, 1)) for mark, sound in pairs),
        max(mark.within for mark, _ in pairs),
        tuple(remarks),
    )


def _single(marks: Sequence[SessionMark], heard: Sequence[HeardMark]) -> Alignment:
    """Align by a single sound, if it is unambiguous, and no two sounds are as far apart as two marks."""
    possible = [(mark, sound) for sound in heard for mark in marks if sound.sweep == sweep_of(mark.number)]
    if len(possible) == 1 and len(heard) == 1:
        [(mark, sound)] = possible
        remarks = [f"mark {each.number} was not found" for each in marks if each is not mark]
        remarks.append("one mark gives only the offset; the speed of its clock is unknown")
        found = FoundMark(mark.number, mark.at, round(sound.at, 6), round(sound.strength, 1))
        return Alignment(sound.at - mark.at, 1.0, (found,), mark.within, tuple(remarks))
    if not possible:
        return Alignment(problem=f"the sound at {_times(heard)} does not match the sweep of any mark of this session")
    if len(heard) == 1:
        numbers = " or ".join(str(mark.number) for mark, _ in possible)
        return Alignment(problem=f"the mark at {_times(heard)} can be mark {numbers}: use --at FILE=markN")
    given = ", ".join(f"mark {mark.number} at {mark.at:.1f} s" for mark in sorted(marks, key=lambda mark: mark.at))
    return Alignment(
        problem=f"{pluralize(len(heard), 'mark')} found, at {_times(heard)}, and no two of them lie as far apart as "
        f"those of this session ({given}): they are of other sessions, or the file was cut. If you know one, use "
        "--at FILE=markN"
    )


def _ambiguity_text(found: Sequence[Sequence[_Pair]]) -> str:
    number = found[0][0][0].number
    starts = sorted({pairs[0][1].at: pairs[0][1] for pairs in found}.values(), key=lambda each: each.at)
    if len(starts) > 1:
        return (
            f"mark {number} can be any of those at {_times(starts)}, because the others fit each of them; choose "
            f"with --at FILE=mark{number}"
        )
    ends = sorted({pairs[-1][1].at: pairs[-1][1] for pairs in found}.values(), key=lambda each: each.at)
    last = found[0][-1][0].number
    return f"mark {last} can be any of those at {_times(ends)}; use --at FILE=mark{last} to choose"


def align_by_moments(moments: Sequence[FoundMark]) -> Alignment:
    """Align by given moments, each in the file and in the session.

    :param moments: one gives the offset, two or more also the rate.
    :return: without an offset if they contradict each other.
    """
    if len(moments) == 1:
        return Alignment(moments[0].media_at - moments[0].session_at, 1.0, tuple(moments))
    moments = sorted(moments, key=lambda each: each.session_at)
    long = moments[-1].session_at - moments[0].session_at
    if long <= 0:
        return Alignment(problem="the two moments of the session must differ: use others")
    offset, rate = fit_line([(each.session_at, each.media_at) for each in moments])
    worst = max(abs(each.media_at - offset - rate * each.session_at) for each in moments)
    if abs(rate - 1) > LARGEST_DRIFT + 0.2 / long or worst > 0.5:
        percent = f"{abs(rate - 1):.1%} {'faster' if rate > 1 else 'slower'}"
        return Alignment(problem=f"these moments cannot all be right: the file would run {percent} than the session")
    return Alignment(offset, rate, tuple(moments))


def fit_line(points: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Compute offset and rate of the best line, by least squares.

    >>> offset, rate = fit_line([(0.0, 1.7), (1000.0, 1001.75)])
    >>> round(offset, 6), round(rate, 6)
    (1.7, 1.00005)
    """
    mean_x = sum(x for x, _ in points) / len(points)
    mean_y = sum(y for _, y in points) / len(points)
    spread = sum((x - mean_x) ** 2 for x, _ in points)
    rate = sum((x - mean_x) * (y - mean_y) for x, y in points) / spread
    return mean_y - rate * mean_x, rate


def _times(heard: Sequence[HeardMark]) -> str:
    named = ", ".join(f"{each.at:.1f} s" for each in heard[:_MAX_TIMES])
    return named + (f" and {len(heard) - _MAX_TIMES} more" if len(heard) > _MAX_TIMES else "")
