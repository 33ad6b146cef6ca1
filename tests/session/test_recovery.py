"""Journals that are whole, torn, damaged or changed: read, recovered, replayed; never wrong, never a traceback."""

from __future__ import annotations

import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from rise_engine.kernel.inputs import SessionRecovered, TimerElapsed
from rise_engine.kernel.records import MemoryRecord, TaskRecord
from rise_engine.kernel.view import SessionView
from rise_engine.session.disk import Disk
from rise_engine.session.folder import INFO, SCENARIO_COPY, SessionError
from rise_engine.session.journal_format import (
    FORMAT,
    InputLine,
    JournalHeader,
    encode_header,
    encode_input,
    encode_record,
    with_checksum,
)
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.recovery import RecoveredSession, recover
from rise_engine.session.replay import NO_RECORD, compare_replay

from .journals import Made

quick = settings(
    max_examples=150,
    phases=[phase for phase in Phase if phase is not Phase.explain],
    suppress_health_check=[*settings().suppress_health_check, HealthCheck.function_scoped_fixture],
)


@pytest.fixture
def made(tmp_path: Path) -> Made:
    return Made(tmp_path)


@pytest.fixture(scope="module")
def shared(tmp_path_factory: pytest.TempPathFactory) -> Made:
    """One for tests that write the journal anew each time."""
    return Made(tmp_path_factory.mktemp("shared"))


@pytest.fixture(scope="module")
def ended(tmp_path_factory: pytest.TempPathFactory) -> Made:
    return Made(tmp_path_factory.mktemp("ended"), ended=True)


def kept(made: Made) -> dict[str, bytes]:
    """What a repair has put beside the journal."""
    return {
        path.name: path.read_bytes()
        for path in sorted(made.folder.iterdir())
        if path.name.startswith(("journal.torn", "journal.damaged", "journal.jsonl."))
    }


def clean(made: Made) -> None:
    for name in kept(made):
        (made.folder / name).unlink()


def unlabelled(journal: bytes) -> list[bytes]:
    """Inputs, then records (a record that stands before its input is right too), without what nobody can make again:
    `wall`, and the check sum of that."""
    lines = re.sub(rb'"wall":"[^"]*"|"crc":"[^"]*"', b"", journal).splitlines()
    return sorted(lines, key=lambda line: line.startswith(b'{"kind"'))


def step_of(made: Made, index: int) -> int:
    """The number of the step that line `index` (from 0) belongs to."""
    return sum(start <= index for start in made.step_lines)


def assert_is(made: Made, found: RecoveredSession, steps: int) -> None:
    """`found` is the session as it was after so many steps, and its journal with `lines` is what was written then."""
    fresh = made.replayed(steps)
    assert found.inputs == steps
    assert found.kernel.snapshot() == fresh.kernel.snapshot()
    assert found.timers == fresh.timers
    view = SessionView()
    for _, records in made.session.steps[:steps]:
        for record in records:
            view.apply(record)
    assert found.view.session is not None and view.session is not None
    assert replace(found.view, session=replace(found.view.session, wall=view.session.wall)) == view
    end = made.step_lines[steps] if steps < len(made.step_lines) else len(made.lines)
    assert found.size == made.journal.stat().st_size
    assert unlabelled(made.journal.read_bytes() + found.unwritten_lines) == unlabelled(b"".join(made.lines[:end]))


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
    with pytest.raises(SessionError, match=r"ended in order at 2026-11-21T14:00:12\.750"):
        recover(ended.folder)
    ended.write(b"".join(ended.lines[:-1]))  # without its last record, which belongs to the last input
    with pytest.raises(SessionError, match="ended in order"):
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


@pytest.mark.slow
def test_torn_at_every_byte(shared: Made) -> None:
    for cut in last_lines(shared):
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


def test_torn_at_the_very_beginning(shared: Made) -> None:
    for cut in range(len(shared.lines[0]) + len(shared.lines[1]) - 1):
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


# --- damaged ---


def outcome(made: Made) -> str:
    """Recover a damaged journal: whatever comes of it is right. Says what came of it."""
    before = made.journal.read_bytes()
    try:
        compare_replay(made.folder)
    except SessionError as error:
        assert len(str(error)) > 20
    try:
        found = recover(made.folder)
    except SessionError as error:
        assert len(str(error)) > 20
        assert made.journal.read_bytes() == before
        assert kept(made) == {}
        return "refused"
    assert_is(made, found, found.inputs)
    if found.report:
        assert b"".join(kept(made).values()) or found.unwritten_lines
    if found.inputs < len(made.session.steps):
        assert any("torn" in text for text in found.report)
        return "torn"
    return "repaired" if found.report else "identical"


@pytest.mark.slow
@quick
@given(st.data())
def test_a_flipped_byte_anywhere(shared: Made, data: st.DataObject) -> None:
    at = data.draw(st.integers(0, len(shared.whole) - 1), label="at")
    by = data.draw(st.sampled_from([1, 2, 32, 128, 255, shared.whole[at] ^ 10 or 1]), label="by")
    flipped = bytearray(shared.whole)
    flipped[at] ^= by
    shared.write(bytes(flipped))
    clean(shared)
    result = outcome(shared)
    assert result != "identical"
    index = shared.whole[:at].count(b"\n")
    if shared.lines[index].startswith(b'{"n"') and index != shared.step_lines[-1]:
        assert result == "refused"
    clean(shared)


@pytest.mark.slow
@quick
@given(st.data())
def test_much_damage_at_once(shared: Made, data: st.DataObject) -> None:
    lines = list(shared.lines)
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(lines) - 1), label="line")
        match data.draw(st.sampled_from(["drop", "rubbish", "join", "split", "double", "swap", "empty"])):
            case "drop":
                del lines[at]
            case "rubbish":
                lines[at] = b"#" * len(lines[at])  # joins the next line, too
            case "join":
                lines[at] = lines[at].rstrip(b"\n")
            case "split":
                lines[at] = lines[at][:20] + b"\n" + lines[at][20:]
            case "double":
                lines.insert(at, lines[at])
            case "swap":
                other = data.draw(st.integers(0, len(lines) - 1), label="with")
                lines[at], lines[other] = lines[other], lines[at]
            case "empty":
                lines.insert(at, b"\n")
    shared.write(b"".join(lines))
    clean(shared)
    try:
        outcome_without_torn(shared)
    finally:
        clean(shared)


def outcome_without_torn(made: Made) -> None:
    """As `outcome`; lines that were taken out at the end leave no trace, so less may be there without a word."""
    try:
        found = recover(made.folder)
    except SessionError as error:
        assert len(str(error)) > 20
    else:
        assert_is(made, found, found.inputs)


def test_a_damaged_record_is_made_again(made: Made) -> None:
    index = made.step_lines[6] + 2
    lines = list(made.lines)
    lines[index] = lines[index].replace(b'"count":0', b'"count":9')
    assert lines != made.lines
    damaged = b"".join(lines)
    made.write(damaged)
    assert not compare_replay(made.folder).identical
    assert list(compare_replay(made.folder).damaged) == [index + 1]
    found = recover(made.folder)
    assert_is(made, found, len(made.session.steps))
    assert made.journal.read_bytes() == made.whole  # `wall` too: a sibling had it
    assert kept(made) == {"journal.damaged-1.jsonl": damaged}
    assert f"line {index + 1} was damaged" in found.report[0] and "journal.damaged-1.jsonl" in found.report[0]
    assert recover(made.folder).report == []


def test_a_damaged_input_is_refused_by_its_line(made: Made) -> None:
    index = made.step_lines[6]
    lines = list(made.lines)
    lines[index] = lines[index].replace(b"/go", b"/no")
    made.write(b"".join(lines))
    for action in (recover, compare_replay):
        with pytest.raises(SessionError, match=rf"line {index + 1} is damaged, and it was input 7\..*exported"):
            action(made.folder)


def test_lost_inputs_are_refused_by_their_place(made: Made) -> None:
    start, end = made.step_lines[6], made.step_lines[8]
    made.write(b"".join([*made.lines[:start], *made.lines[end:]]))
    with pytest.raises(SessionError, match=rf"before line {start + 1} inputs 7 to 8 are missing\."):
        recover(made.folder)


def test_a_damaged_last_input_with_whole_records_is_refused(made: Made) -> None:
    """No later number tells that it is gone; that nothing accounts for its records does."""
    index = made.step_lines[-1]
    lines = list(made.lines)
    lines[index] = b"#" + lines[index][1:]
    made.write(b"".join(lines))
    for action in (recover, compare_replay):
        with pytest.raises(SessionError, match=f"line {index + 1} is damaged, and it was an input"):
            action(made.folder)


def test_a_damaged_header_is_made_again(made: Made) -> None:
    made.write(b"#" + made.whole[1:])
    found = recover(made.folder)
    assert made.journal.read_bytes() == made.whole
    assert found.report


def test_a_repair_that_fails_changes_nothing(made: Made) -> None:
    class Full(Disk):
        def sync(self, descriptor: int) -> None:
            raise OSError(28, "No space left on device")

    lines = list(made.lines)
    lines[8] = b"\n"
    for data in (made.whole + b"x", b"".join(lines)):
        made.write(data)
        with pytest.raises(SessionError, match="the disk is full"):
            recover(made.folder, Full())
        assert made.journal.read_bytes() == data
        assert kept(made) == {}
        assert_is(made, recover(made.folder), len(made.session.steps))
        clean(made)


# --- not what it should be ---


@pytest.mark.slow
@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"", "is empty: nothing was ever recorded"),
        (b"\n", "holds nothing that can be read"),
        (b"hello", "not even its first line is whole"),
        (b"# Notes\nabc\n", "its first line is no header"),
        (b"\0" * 5000, "holds nothing"),
        (
            with_checksum(msgspec.json.encode(JournalHeader(FORMAT + 1, "rise-tui 9"))),
            r"newer version \(rise-tui 9, format 2",
        ),
        (encode_header("x"), "no input"),
        (
            encode_header("x") + with_checksum(b'{"n":1,"input":"telepathy","t":0.0}'),
            "does not know.*install that version",
        ),
        (encode_header("x") + with_checksum(b'{"kind":"smell","seq":1}'), "does not know.*install that version"),
    ],
)
def test_unusable_journals(made: Made, data: bytes, says: str) -> None:
    made.write(data)
    with pytest.raises(SessionError, match=says):
        recover(made.folder)


def test_a_header_alone_replays_to_nothing(made: Made) -> None:
    made.write(made.lines[0])
    found = compare_replay(made.folder)
    assert found.identical and (found.inputs, found.records) == (0, 0)


def test_no_journal(made: Made) -> None:
    made.journal.unlink()
    with pytest.raises(SessionError, match="there is no journal"):
        recover(made.folder)
    made.journal.mkdir()
    with pytest.raises(SessionError, match="cannot be read"):
        recover(made.folder)


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_journal_that_may_not_be_read(made: Made) -> None:
    made.journal.chmod(0)
    with pytest.raises(SessionError, match="cannot be read and written: the file may not be written"):
        recover(made.folder)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("format = 1", "format = 2", "newer version"),
        ("seed = 7", "seed = 8", r"journal.jsonl:3: record 1 .*`seed` is 7, but the replay gives 8"),
        ('mode = "debug"', 'mode = "real"', "`mode` is"),
        ('mode = "debug"', 'mode = "dream"', "cannot be read"),
        ("seed = 7", "seed = ", "cannot be read"),
        ("seed = 7", "", "cannot be read"),
        ('robot = "generic"', 'robot = "nobody"', "does not load"),
    ],
)
def test_a_changed_session_file(made: Made, old: str, new: str, says: str) -> None:
    path = made.folder / INFO
    text = path.read_text("utf-8")
    assert old in text
    path.write_text(text.replace(old, new), "utf-8")
    with pytest.raises(SessionError, match=says):
        recover(made.folder)


def test_no_session_file(made: Made) -> None:
    (made.folder / INFO).unlink()
    for action in (recover, compare_replay):
        with pytest.raises(SessionError, match=f"it has no {INFO}"):
            action(made.folder)


@pytest.mark.slow
@quick
@given(at=st.integers(0, 5000), by=st.integers(1, 255))
def test_a_flipped_byte_in_the_session_file(shared: Made, at: int, by: int) -> None:
    path = shared.folder / INFO
    whole = path.read_bytes()
    flipped = bytearray(whole)
    flipped[at % len(whole)] ^= by
    shared.write(shared.whole)
    path.write_bytes(bytes(flipped))
    try:
        found = recover(shared.folder)
    except SessionError as error:
        assert len(str(error)) > 20
    else:
        assert found.kernel.snapshot() == shared.session.kernel.snapshot()
    finally:
        path.write_bytes(whole)


@pytest.mark.parametrize("how", ["missing", "changed", "broken"])
def test_the_copy_of_the_scenario(made: Made, how: str) -> None:
    copy = made.folder / SCENARIO_COPY
    if how == "missing":
        shutil.rmtree(copy)
    elif how == "changed":
        (copy / "memory.json").write_text('{"name": "Bert"}')
    else:
        (copy / "acts" / "all.xml").write_text("<Dialogs>")
    found = recover(made.folder)  # where the scenario was read, it is still the same
    assert found.kernel.snapshot() == made.session.kernel.snapshot()
    assert "was used" in found.report[0] and compare_replay(made.folder).identical
    (made.study / "memory.json").write_text('{"name": "Bert"}')
    for action in (recover, compare_replay):
        with pytest.raises(SessionError, match="does not help: it was changed since"):
            action(made.folder)
    shutil.rmtree(made.study)
    with pytest.raises(SessionError, match="does not help: it cannot be loaded"):
        recover(made.folder)


# --- replay ---


def test_replay_finds_a_changed_value(made: Made) -> None:
    """With a right check sum: as another version of the program would have written it."""
    index = next(i for i, line in enumerate(made.lines) if b'"key":"count","value":1' in line)
    record = next(r for r in made.records if isinstance(r, MemoryRecord) and (r.key, r.value) == ("count", 1))
    lines = list(made.lines)
    lines[index] = with_checksum(encode_record(replace(record, value=1.0, wall="another")))
    made.write(b"".join(lines))
    found = compare_replay(made.folder)
    assert found.difference is not None and not found.identical
    assert found.records == record.seq - 1
    assert str(found.difference) == (
        f"journal.jsonl:{index + 1}: record {record.seq} (of input 7, kind memory): "
        "`value` is 1.0, but the replay gives 1"
    )
    with pytest.raises(SessionError, match=rf"does not repeat: journal.jsonl:{index + 1}: .*`value`"):
        recover(made.folder)


def test_replay_finds_a_record_too_many(made: Made) -> None:
    extra = replace(made.records[-1], seq=made.records[-1].seq + 1)
    made.write(made.whole + with_checksum(encode_record(extra)))
    found = compare_replay(made.folder).difference
    assert found is not None and found.field == NO_RECORD and found.line == len(made.lines) + 1
    with pytest.raises(SessionError, match="the replay does not give it"):
        recover(made.folder)


def test_replay_does_not_mind_the_wall_clock(made: Made) -> None:
    made.write(b"".join([made.lines[0], *(_walled(line) for line in made.lines[1:])]))
    assert compare_replay(made.folder).identical


def _walled(line: bytes) -> bytes:
    value = msgspec.json.decode(line)
    del value["crc"]
    if "wall" in value:
        value["wall"] = "some other time"
    return with_checksum(msgspec.json.encode(value))


def test_replay_of_another_scenario(made: Made) -> None:
    acts = made.study / "acts" / "all.xml"
    assert compare_replay(made.folder, made.study).notes == compare_replay(made.folder).notes
    text = acts.read_text("utf-8")
    acts.write_text(text + "<!-- only a remark -->", "utf-8")
    found = compare_replay(made.folder, made.study)
    assert found.identical and "is not what this session ran" in found.notes[0]
    acts.write_text(text.replace("How are you", "How do you do"), "utf-8")
    found = compare_replay(made.folder, made.study)
    assert found.difference is not None and found.difference.field == "parameters"
    acts.write_text("<Dialogs>", "utf-8")
    with pytest.raises(SessionError, match="does not load"):
        compare_replay(made.folder, made.study)


def test_an_input_that_makes_the_kernel_fail_is_told(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    from rise_engine.kernel import Kernel

    def fail(self: Kernel, input: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(Kernel, "handle", fail)
    for action in (recover, compare_replay):
        with pytest.raises(SessionError, match=r"journal.jsonl:2: input 1 makes the engine fail"):
            action(made.folder)


def test_reading_is_quick(made: Made) -> None:
    """Not measured strictly here: a hundred thousand records take well under a second."""
    import time

    record = made.records[-1]
    lines = [with_checksum(encode_record(replace(record, seq=number))) for number in range(1, 20_001)]
    made.write(encode_header("x") + b"".join(lines))
    start = time.perf_counter()
    contents = read_journal(made.journal)
    assert contents.records == sum(1 for _ in contents.read_records()) == 20_000
    assert time.perf_counter() - start < 2


def test_a_session_that_was_recovered_twice_replays(made: Made) -> None:
    made.write(made.whole[:-5])
    for _ in range(2):
        found = recover(made.folder)
        fact = SessionRecovered(t=found.t + 1, reason="test")
        records, _ = found.kernel.handle(fact)
        with made.journal.open("ab") as file:
            file.write(
                found.unwritten_lines
                + encode_input(found.inputs + 1, fact)
                + b"".join(with_checksum(encode_record(record)) for record in records)
            )
    found = recover(made.folder)
    assert (found.inputs, found.report) == (len(made.session.steps) + 2, [])
    assert found.view.session is not None and found.view.session.status == "recovered"
    assert compare_replay(made.folder).identical
