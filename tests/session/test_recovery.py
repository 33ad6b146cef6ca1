"""Journals that are whole, torn, damaged or changed: read, recovered, replayed; never wrong, never a traceback."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from rise_engine.base.errors import SessionError
from rise_engine.kernel.inputs import SessionRecovered, TimerElapsed
from rise_engine.kernel.records import TaskRecord
from rise_engine.session.journal_format import (
    FORMAT,
    InputLine,
    JournalHeader,
    encode_record,
)
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.recovery import recover
from rise_engine.session.replay import compare_replay
from tests.chance import SEARCH

from .journals import Made, assert_is, clean, kept, step_of

# --- whole ---


def test_what_was_written_is_read(made: Made) -> None:
    contents = read_journal(made.journal)
    assert contents.header == JournalHeader(FORMAT, "rise-tui 0.2.0")
    read = [*contents.lines()]
    assert [(number, line + b"\n") for number, line, _ in read] == [*enumerate(made.lines, 1)]
    assert [found for _, _, found in read if isinstance(found, InputLine)] == [
        InputLine(n, fact) for n, (fact, _) in enumerate(made.session.steps, 1)
    ]
    assert [*map(encode_record, contents.read_records())] == [*map(encode_record, made.records)]
    assert (contents.size, contents.torn, contents.damaged, contents.gaps) == (len(made.whole), b"", {}, [])
    assert not contents.ended


def test_an_unfinished_session_is_as_it_was(made: Made) -> None:
    found = recover(made.folder)
    assert_is(made, found, len(made.session.steps))
    assert (found.report, found.unwritten_lines, kept(made)) == ([], b"", {})
    assert found.scenario == made.scenario
    assert found.t == made.session.t


def test_it_goes_on(made: Made) -> None:
    """The timers are those of the kernel: when they elapse, the kernel knows them."""
    found = recover(made.folder)
    records, _ = found.kernel.handle(SessionRecovered(t=13.0, reason="test"))
    assert [r.status for r in records if isinstance(r, TaskRecord)] == [
        "ABORTED",
        "ACTIVE",
    ]  # Late is lost, Wait begins
    [after] = [timer for timer, target in found.kernel.core.timers.items() if target.purpose == "after"]
    records, _ = found.kernel.handle(TimerElapsed(t=found.timers[after], timer=after))
    assert records


@pytest.mark.parametrize(
    ("clock", "t"),
    [
        (None, 12.75),
        (b"99.500         \n", 99.5),
        (b"3.0\n", 12.75),
        (b"", 12.75),
        (b"nan", 12.75),
        (b"inf", 12.75),
        (b"-5", 12.75),
        (b"1e300", 12.75),
        (b"\xff\x00", 12.75),
    ],
)
def test_the_time_goes_on_from_the_clock_file(made: Made, clock: bytes | None, t: float) -> None:
    if clock is not None:
        (made.folder / "clock").write_bytes(clock)
    assert recover(made.folder).t == t


def test_an_ended_session_is_not_recovered(ended: Made) -> None:
    ended.write(ended.whole)
    with pytest.raises(SessionError, match=r"ended properly at 2026-11-21T14:00:12\.750"):
        recover(ended.folder)
    ended.write(b"".join(ended.lines[:-1]))  # without its last record, which belongs to the last input
    with pytest.raises(SessionError, match="ended properly"):
        recover(ended.folder)
    assert kept(ended) == {}


def test_a_whole_session_replays(ended: Made) -> None:
    ended.write(ended.whole)
    found = compare_replay(ended.folder)
    assert found.identical
    assert (found.inputs, found.records, found.seconds, found.notes) == (
        len(ended.session.steps),
        len(ended.records),
        12.75,
        [],
    )


# --- torn ---


def last_lines(made: Made) -> Iterator[int]:
    """Every byte of the last two lines, and of the last input and what is before it."""
    yield from range(len(made.whole) - sum(map(len, made.lines[-2:])), len(made.whole))
    start = sum(map(len, made.lines[: made.step_lines[-1]]))
    yield from range(start - 3, start + len(made.lines[made.step_lines[-1]]) + 2)


def is_near_an_end(made: Made, cut: int) -> bool:
    """Whether a line ends within three bytes of it."""
    return b"\n" in made.whole[max(0, cut - 3) : cut + 3]


@pytest.mark.search
@pytest.mark.slow
def test_torn_at_every_byte(shared: Made) -> None:
    """Around the ends of lines at every byte, within them at every thirtieth; in a search at every one."""
    for cut in last_lines(shared):
        if not (SEARCH or cut % 30 == 0 or is_near_an_end(shared, cut)):
            continue
        data = shared.whole[:cut]
        shared.write(data)
        lines = data.count(b"\n")
        torn = data[data.rfind(b"\n") + 1 :]
        contents = read_journal(shared.journal)
        assert (contents.torn, contents.size, contents.damaged) == (torn, cut - len(torn), {})
        assert compare_replay(shared.folder).identical
        assert_is(shared, recover(shared.folder), step_of(shared, lines - 1))
        assert kept(shared) == ({"journal.torn-1": torn} if torn else {})
        assert not any("torn" in text for text in recover(shared.folder).report), "it is put aside once"
        clean(shared)


@pytest.mark.search
def test_torn_at_the_very_beginning(shared: Made) -> None:
    for cut in range(0, len(shared.lines[0]) + len(shared.lines[1]) - 1, 1 if SEARCH else 5):
        shared.write(shared.whole[:cut])
        with pytest.raises(SessionError):
            recover(shared.folder)
        assert shared.journal.read_bytes() == shared.whole[:cut]
    assert kept(shared) == {}


def test_a_torn_tail_may_be_whole_lines_of_rubbish(made: Made) -> None:
    rubbish = b"\0" * 4096 + b"\nnonsense\n" + made.lines[-1][:40] + b"\n\n"
    made.write(made.whole + rubbish)
    found = recover(made.folder)
    assert_is(made, found, len(made.session.steps))
    assert kept(made) == {"journal.torn-1": rubbish}
    assert "journal.torn-1" in found.report[0]
    made.write(made.whole + b"{")
    assert "journal.torn-2" in recover(made.folder).report[0]
    assert kept(made) == {"journal.torn-1": rubbish, "journal.torn-2": b"{"}


def test_missing_records_of_the_last_step_are_made_again(made: Made) -> None:
    made.write(b"".join(made.lines[: made.step_lines[-1] + 3]))  # the input and two of its seven records
    found = recover(made.folder)
    assert_is(made, found, len(made.session.steps))
    assert found.unwritten_lines == b"".join(
        made.lines[made.step_lines[-1] + 3 :]
    )  # with the same wall: a sibling had it
    assert "5 records of the last input" in found.report[0]
    made.write(b"".join(made.lines[: made.step_lines[-1] + 1]))
    found = recover(made.folder)
    assert found.unwritten_lines.count(made.records[-8].wall.encode()) == 7  # no sibling: that of the record before


def test_recovering_twice_gives_the_same(made: Made) -> None:
    made.write(b"".join(made.lines[: made.step_lines[-1] + 3]) + b'{"kind":"co')
    first, data = recover(made.folder), made.journal.read_bytes()
    second = recover(made.folder)
    assert made.journal.read_bytes() == data
    for name in ("t", "inputs", "timers", "size", "unwritten_lines", "info", "scenario"):
        assert getattr(first, name) == getattr(second, name), name
    assert first.kernel.snapshot() == second.kernel.snapshot()
    assert first.view == second.view
    # And with the lines appended, as the engine does: once more the same, with nothing left to do.
    made.journal.write_bytes(data + first.unwritten_lines)
    third = recover(made.folder)
    assert (third.unwritten_lines, third.report) == (b"", [])
    assert third.kernel.snapshot() == first.kernel.snapshot()
    assert third.view == first.view
