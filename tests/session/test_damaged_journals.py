"""Journals that are damaged or changed: read and recovered; never wrong, never a traceback."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable

import msgspec
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from rise_engine.base.errors import SessionError
from rise_engine.base.files import Disk
from rise_engine.session.folder import INFO, SCENARIO_COPY
from rise_engine.session.journal_format import (
    FORMAT,
    JournalHeader,
    encode_header,
    with_checksum,
)
from rise_engine.session.recovery import recover
from rise_engine.session.replay import compare_replay
from tests.chance import examples

from .journals import Made, assert_is, clean, kept

quick = settings(
    max_examples=examples(150),
    phases=[phase for phase in Phase if phase is not Phase.explain],
    suppress_health_check=[*settings().suppress_health_check, HealthCheck.function_scoped_fixture],
)


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


def damaged_input(lines: list[bytes], steps: list[int]) -> None:
    lines[steps[6]] = lines[steps[6]].replace(b"/go", b"/no")


def lost_inputs(lines: list[bytes], steps: list[int]) -> None:
    del lines[steps[6] : steps[8]]


def damaged_last_input(lines: list[bytes], steps: list[int]) -> None:
    """No later number tells that it is gone; that nothing accounts for its records does."""
    lines[steps[-1]] = b"#" + lines[steps[-1]][1:]


@pytest.mark.parametrize(
    ("damage", "step", "says"),
    [
        (damaged_input, 6, "line {} is damaged, and it was input 7\\..*exported"),
        (lost_inputs, 6, "before line {} inputs 7 to 8 are missing\\."),
        (damaged_last_input, -1, "line {} is damaged, and it was an input"),
    ],
)
def test_inputs_that_are_not_whole_are_refused_by_their_place(
    made: Made, damage: Callable[[list[bytes], list[int]], None], step: int, says: str
) -> None:
    lines = list(made.lines)
    damage(lines, made.step_lines)
    made.write(b"".join(lines))
    for action in (recover, compare_replay):
        with pytest.raises(SessionError, match=says.format(made.step_lines[step] + 1)):
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
        (b"# Notes\nabc\n", "its first line is not the header"),
        (b"\0" * 5000, "holds nothing"),
        (
            with_checksum(msgspec.json.encode(JournalHeader(FORMAT + 1, "rise-tui 9"))),
            rf"newer version \(rise-tui 9, format {FORMAT + 1}",
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
        (f"format = {FORMAT}", f"format = {FORMAT + 1}", "newer version"),
        ("seed = 7", "seed = 8", "session.toml says seed = 8, but journal.jsonl says seed = 7"),
        ('mode = "debug"', 'mode = "real"', 'session.toml says mode = "real", but journal.jsonl says mode = "debug"'),
        ('mode = "debug"', 'mode = "dream"', "cannot be read"),
        ("seed = 7", "seed = ", "cannot be read"),
        ("seed = 7", "", "cannot be read"),
        ('robot = "generic"', 'robot = "nobody"', 'session.toml says robot = "nobody"'),
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
