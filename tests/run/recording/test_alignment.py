"""Which sound is which mark: what fits is taken, what can be read in two ways is told."""

from __future__ import annotations

import pytest

from rise_engine.run.recording.alignment import (
    Alignment,
    HeardMark,
    SessionMark,
    align_by_marks,
    align_by_moments,
)
from rise_engine.run.recording.chirp import sweep_of
from rise_engine.session.media import FoundMark

TWO = [SessionMark(1, 2.0, 0.05), SessionMark(2, 1802.0, 0.05)]


def heard(*marks: tuple[int, float]) -> list[HeardMark]:
    return [HeardMark(sweep_of(number), at, 10.0) for number, at in marks]


def offset_of(found: Alignment) -> float:
    assert found.offset is not None, found.problem
    return found.offset


def test_two_marks_give_offset_and_rate() -> None:
    found = align_by_marks(TWO, heard((1, 10.0), (2, 1810.09)))
    assert found.rate == pytest.approx(1.000_05) and offset_of(found) == pytest.approx(10 - 2 * 1.000_05)
    assert found.marks == (FoundMark(1, 2.0, 10.0, 10.0), FoundMark(2, 1802.0, 1810.09, 10.0))
    assert found.within == 0.05 and found.rate_within_ppm == pytest.approx(55.6, abs=0.1)
    assert not found.remarks and not found.problem


def test_marks_of_other_sessions_in_the_file_are_told_apart_by_their_distance() -> None:
    found = align_by_marks(TWO, heard((1, 10.0), (2, 1510.0), (1, 2000.0), (2, 3800.1), (1, 4000.0), (2, 5700.0)))
    assert [mark.media_at for mark in found.marks] == [2000.0, 3800.1]
    assert found.remarks == ("the file has 4 marks of another session, at 10.0 s, 1510.0 s, 4000.0 s, 5700.0 s",)


@pytest.mark.parametrize(
    ("sounds", "problem"),
    [
        # sessions of the same length
        (((1, 10.0), (2, 1810.0), (1, 2000.0), (2, 3800.0)), "mark 1 can be any of those at 10.0 s, 2000.0 s, "),
        # the same mark twice, as a second loudspeaker gives it
        (((1, 10.0), (1, 10.6), (2, 1810.3)), "mark 1 can be any of those at 10.0 s, 10.6 s, "),
        (((1, 10.0), (2, 1809.8), (2, 1810.4)), "mark 2 can be any of those at 1809.8 s, 1810.4 s; use --at"),
        # two of another session
        (((1, 10.0), (2, 1500.0)), "2 marks found, at 10.0 s, 1500.0 s, and no two of them lie as far apart as those"),
        (((2, 10.0), (1, 1810.0)), "no two of them lie as far apart as those of this session (mark 1 at 2.0 s, mark 2"),
        (((1, 10.0), (1, 500.0)), "they are of other sessions, or the file was cut. If you know one, use --at FILE="),
        ((), "none of the session's 2 marks was found in the file"),
    ],
)
def test_what_is_not_certain_is_told(sounds: tuple[tuple[int, float], ...], problem: str) -> None:
    found = align_by_marks(TWO, heard(*sounds))
    assert found.offset is None and problem in found.problem and not found.marks


def test_one_mark_gives_the_offset_only() -> None:
    found = align_by_marks(TWO, heard((2, 1795.0)))
    assert (offset_of(found), found.rate, found.rate_within_ppm) == (-7.0, 1.0, None)
    assert found.remarks == (
        "mark 1 was not found",
        "one mark gives only the offset; the speed of its clock is unknown",
    )
    other = align_by_marks(TWO[:1], heard((2, 5.0)))
    assert (
        other.offset is None
        and other.problem == "the sound at 5.0 s does not match the sweep of any mark of this session"
    )
    either = align_by_marks([*TWO, SessionMark(3, 1900.0)], heard((1, 5.0)))
    assert either.problem == "the mark at 5.0 s can be mark 1 or 3: use --at FILE=markN"
    assert "no mark that could be heard" in align_by_marks([], heard((1, 5.0))).problem


def test_three_marks_are_laid_through_and_a_missing_one_is_told() -> None:
    marks = [SessionMark(1, 0.0, 0.02), SessionMark(2, 600.0, 0.02), SessionMark(3, 1200.0, 0.02)]
    found = align_by_marks(marks, heard((1, 5.0), (2, 605.03), (3, 1205.0)))
    assert len(found.marks) == 3 and found.rate == pytest.approx(1.0) and offset_of(found) == pytest.approx(5.01)
    found = align_by_marks(marks, heard((1, 5.0), (3, 1205.0)))
    assert len(found.marks) == 2 and found.remarks == ("mark 2 was not found",)


def test_marks_on_both_sides_of_an_interruption_have_no_distance() -> None:
    marks = [SessionMark(1, 2.0, 0.05), SessionMark(2, 600.0, 0.05, part=1), SessionMark(3, 1200.0, 0.05, part=1)]
    through = heard((1, 10.0), (2, 668.0), (3, 1268.0))  # a minute of interruption
    found = align_by_marks(marks, through)
    assert offset_of(found) == pytest.approx(68.0) and [mark.number for mark in found.marks] == [2, 3]
    assert "mark 1 was not found" in found.remarks
    crossing = align_by_marks(marks[:2], heard((1, 10.0), (2, 608.0)))
    assert crossing.offset is None


def test_a_film_at_another_frame_rate_is_found_and_told() -> None:
    found = align_by_marks(TWO, heard((1, 10.0), (2, 10.0 + 1800 * 1.001)))
    assert found.rate == pytest.approx(1.001)
    assert found.remarks[0].startswith("its clock differs by 1,000 ppm, which is more than the drift of a clock: check")


def test_moments_that_somebody_gives() -> None:
    clap = FoundMark(0, 12.0, 14.5, 0)
    assert (align_by_moments([clap]).offset, align_by_moments([clap]).rate) == (2.5, 1.0)
    both = align_by_moments([FoundMark(0, 1012.0, 1014.6, 0), clap])
    assert both.rate == pytest.approx(1.0001) and offset_of(both) == pytest.approx(14.5 - 12 * 1.0001)
    wrong = align_by_moments([clap, FoundMark(0, 1012.0, 1114.6, 0)])
    assert wrong.problem == "these moments cannot all be right: the file would run 10.0% faster than the session"
    same = align_by_moments([clap, FoundMark(0, 12.0, 20.0, 0)])
    assert same.problem == "the two moments of the session must differ: use others"
