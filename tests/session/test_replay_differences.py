"""Where a replay differs from its journal."""

from __future__ import annotations

import msgspec
import pytest
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.kernel.inputs import AnyInput, Note, SessionRecovered
from rise_engine.kernel.records import MemoryRecord
from rise_engine.session.journal_format import (
    encode_input,
    encode_record,
    with_checksum,
)
from rise_engine.session.recovery import recover
from rise_engine.session.replay import NO_RECORD, compare_replay

from .journals import Made

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


def test_a_difference_is_told_before_a_later_failure(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both lie in one block of lines, which is replayed before it is compared."""
    from rise_engine.kernel import Kernel

    handle = Kernel.handle

    def fail(self: Kernel, input: AnyInput) -> object:
        if isinstance(input, Note):
            raise ZeroDivisionError("division by zero")
        return handle(self, input)

    index = next(i for i, line in enumerate(made.lines) if b'"key":"count","value":1' in line)
    record = next(r for r in made.records if isinstance(r, MemoryRecord) and (r.key, r.value) == ("count", 1))
    monkeypatch.setattr(Kernel, "handle", fail)
    with pytest.raises(SessionError, match=r"input 9 makes the engine fail"):
        compare_replay(made.folder)
    lines = list(made.lines)
    lines[index] = with_checksum(encode_record(replace(record, value=2)))
    made.write(b"".join(lines))
    assert "`value` is 2, but the replay gives 1" in str(compare_replay(made.folder).difference)


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
