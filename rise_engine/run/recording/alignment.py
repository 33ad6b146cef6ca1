"""Lays a recording against the session's clock, by marks that were found in it or moments that somebody has given.

media time = offset + rate * session time, both in seconds (`rise_engine.session.media`).

A recorder's clock is off by some tens of millionths: 50 ppm are 90 ms in half an hour, which is why there is a mark at
each end. Which mark of the session a sound in the file is, follows from how it sweeps and from how far it lies from
the others: between two clocks that distance differs by `USUAL_DRIFT` at most. What can be read in two ways is told,
and never guessed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

from msgspec import Struct

from rise_engine.base.text import pluralize
from rise_engine.run.recording.chirp import Sweep, sweep_of
from rise_engine.session.media import FoundMark

USUAL_DRIFT = 500e-6
"""By which two clocks differ at most. Quartz crystals keep 100 ppm."""
LARGEST_DRIFT = 2_000e-6
"""What is looked for when nothing fits otherwise: 1,001 ppm is a film that is played at 30 frames a second instead of
29.97."""
UNKNOWN_WITHIN = 0.5
"""Seconds by which the time of a mark can be wrong of which nothing is on record."""
_TOLD = 6
"""So many times are named in a sentence."""


class SessionMark(Struct, frozen=True):
    """A mark that was given in the session."""

    number: int
    at: float
    """Session time in seconds."""
    within: float = UNKNOWN_WITHIN
    """Seconds by which that is wrong at most."""
    medium: str = "sound"
    part: int = 0
    """Interruptions of the session before it: what a camera went on for then, its clock did not count."""


class HeardMark(Struct, frozen=True):
    """A sound in a file that sounds as marks do."""

    sweep: Sweep
    at: float
    """Seconds in the file at which it begins."""
    strength: float
    """How far it stands above all else in the file, as a ratio."""


class Alignment(Struct, frozen=True):
    """How a file lies against the session's clock."""

    offset: float | None = None
    """None: nobody knows; `problem` says why."""
    rate: float = 1.0
    marks: tuple[FoundMark, ...] = ()
    within: float | None = None
    """Seconds by which this is wrong at most between the marks, as far as the times of the marks are known."""
    remarks: tuple[str, ...] = ()
    """What there is to know about it, in sentences."""
    problem: str = ""

    @property
    def rate_within_ppm(self) -> float | None:
        """Millionths by which the rate is wrong at most; None: it was not measured."""
        if len(self.marks) < 2 or self.within is None:
            return None
        return 2e6 * self.within / (self.marks[-1].session_at - self.marks[0].session_at)


_Pair = tuple[SessionMark, HeardMark]


def align_by_marks(marks: Sequence[SessionMark], heard: Sequence[HeardMark]) -> Alignment:
    """Find out which sound is which mark, and what follows from that.

    :param marks: of the session, that could be heard.
    :param heard: what was found in the file.
    :return: without an offset where nothing was found that fits, or more than one thing.
    """
    if not marks:
        return Alignment(problem="the session has no mark that could be heard: say --at FILE=SESSION for a moment")
    if not heard:
        return Alignment(problem=f"none of the session's {pluralize(len(marks), 'mark')} was found in the file")
    for limit in (USUAL_DRIFT, LARGEST_DRIFT):
        found = _best_matches(marks, heard, limit)
        if len(found) == 1:
            return _of_pairs(marks, heard, found[0])
        if found:
            return Alignment(problem=_several_fit(found))
    return _single(marks, heard)


def _best_matches(marks: Sequence[SessionMark], heard: Sequence[HeardMark], limit: float) -> list[tuple[_Pair, ...]]:
    """Every way to read the sounds that explains the most marks, of at least two."""
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
    """The sound that a further mark must be; nothing when there is none."""
    allowed = 2 * mark.within + 0.01
    near = [each for each in heard if each.sweep == sweep_of(mark.number) and abs(each.at - at) <= allowed]
    return {mark: min(near, key=lambda each: abs(each.at - at))} if near else {}


def _of_pairs(marks: Sequence[SessionMark], heard: Sequence[HeardMark], pairs: Sequence[_Pair]) -> Alignment:
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
    """Where no two sounds lie as far apart as two marks do: one alone gives the offset, if there is no doubt."""
    possible = [(mark, sound) for sound in heard for mark in marks if sound.sweep == sweep_of(mark.number)]
    if len(possible) == 1 and len(heard) == 1:
        [(mark, sound)] = possible
        remarks = [f"mark {each.number} was not found" for each in marks if each is not mark]
        remarks.append("one mark gives only the offset; the speed of its clock is unknown")
        found = FoundMark(mark.number, mark.at, round(sound.at, 6), round(sound.strength, 1))
        return Alignment(sound.at - mark.at, 1.0, (found,), mark.within, tuple(remarks))
    if not possible:
        return Alignment(
            problem=f"what was found at {_times(heard)} does not match the sweep of any mark of this session"
        )
    if len(heard) == 1:
        numbers = " or ".join(str(mark.number) for mark, _ in possible)
        return Alignment(problem=f"the mark at {_times(heard)} can be mark {numbers}: say --at FILE=markN")
    given = ", ".join(f"mark {mark.number} at {mark.at:.1f} s" for mark in sorted(marks, key=lambda mark: mark.at))
    return Alignment(
        problem=f"{pluralize(len(heard), 'mark')} found, at {_times(heard)}, and no two of them lie as far apart as "
        f"those of this session ({given}): they are of other sessions, or the file was cut. If you know one, say "
        "--at FILE=markN"
    )


def _several_fit(found: Sequence[Sequence[_Pair]]) -> str:
    number = found[0][0][0].number
    starts = sorted({pairs[0][1].at: pairs[0][1] for pairs in found}.values(), key=lambda each: each.at)
    if len(starts) > 1:
        return (
            f"mark {number} can be any of those at {_times(starts)}, because the others fit each of them: say which "
            f"with --at FILE=mark{number}"
        )
    ends = sorted({pairs[-1][1].at: pairs[-1][1] for pairs in found}.values(), key=lambda each: each.at)
    last = found[0][-1][0].number
    return f"mark {last} can be any of those at {_times(ends)}: say which with --at FILE=mark{last}"


def align_by_moments(moments: Sequence[FoundMark]) -> Alignment:
    """By what somebody has given: each moment in the file with the session's.

    :param moments: one gives the offset, two or more the rate, too.
    :return: without an offset when they cannot all be right.
    """
    if len(moments) == 1:
        return Alignment(moments[0].media_at - moments[0].session_at, 1.0, tuple(moments))
    moments = sorted(moments, key=lambda each: each.session_at)
    long = moments[-1].session_at - moments[0].session_at
    if long <= 0:
        return Alignment(problem="two moments of the session have to differ: say others")
    offset, rate = fit_line([(each.session_at, each.media_at) for each in moments])
    worst = max(abs(each.media_at - offset - rate * each.session_at) for each in moments)
    if abs(rate - 1) > LARGEST_DRIFT + 0.2 / long or worst > 0.5:
        percent = f"{abs(rate - 1):.1%} {'faster' if rate > 1 else 'slower'}"
        return Alignment(problem=f"these moments cannot all be right: the file would run {percent} than the session")
    return Alignment(offset, rate, tuple(moments))


def fit_line(points: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Offset and rate of the line that fits best: least squares; through two points it goes exactly.

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
    named = ", ".join(f"{each.at:.1f} s" for each in heard[:_TOLD])
    return named + (f" and {len(heard) - _TOLD} more" if len(heard) > _TOLD else "")
