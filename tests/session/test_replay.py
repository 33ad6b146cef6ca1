"""A recorded session, played again: as an account, to a console, and to be compared with its journal."""

from __future__ import annotations

import asyncio
from pathlib import Path

import msgspec
import pytest
from click.testing import CliRunner
from msgspec.structs import replace

from rise_engine.base.errors import SessionError
from rise_engine.cli import main
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import AnyInput, Note, SessionRecovered, Submit
from rise_engine.kernel.records import AnyRecord, MemoryRecord
from rise_engine.kernel.view import SessionView
from rise_engine.run.client.replay import ReplayClient
from rise_engine.run.protocol.client import EngineGone
from rise_engine.session.journal_format import encode_input, encode_record, with_checksum
from rise_engine.session.journal_reader import read_journal
from rise_engine.session.recovery import recover
from rise_engine.session.replay import NO_RECORD, compare_replay
from tests.patience import PATIENCE

from .journals import Made


@pytest.fixture
def over(tmp_path: Path) -> Made:
    return Made(tmp_path, ended=True)


def test_it_is_told_where_there_is_no_terminal(over: Made) -> None:
    result = CliRunner().invoke(main, ["replay", str(over.folder), "--speed", "1000"])
    assert result.exit_code == 0
    assert "Sample study" in result.output and "Greet" in result.output and "ended" in result.output


@pytest.mark.parametrize("more", [["--json"], ["--scenario", "."]])
def test_played_is_not_compared(over: Made, more: list[str]) -> None:
    result = CliRunner().invoke(main, ["replay", str(over.folder), "--speed", "2", *more])
    assert result.exit_code == 2 and "--speed" in result.output


async def test_a_console_gets_every_record_at_its_time_and_can_change_nothing(over: Made) -> None:
    client = ReplayClient(over.folder, speed=200)
    hello = await client.attach()
    assert hello.replay and hello.mode == "debug" and hello.scenario.title == "Sample study"
    records: list[AnyRecord] = []
    async for batch in client.records():
        for record in batch:
            assert client.now() >= record.t  # type: ignore[union-attr]
            records.append(record)  # type: ignore[arg-type]
    written = [*read_journal(over.journal).read_records()]
    assert records == written
    view = SessionView()
    for record in records:
        view.apply(record)
    assert view.ended
    reply = await client.send(Submit(function="stopAll"))
    assert not reply.accepted and "replay" in reply.reason
    assert not (await client.change_control("take")).accepted


async def test_leaving_in_the_middle(over: Made) -> None:
    client = ReplayClient(over.folder, speed=0.01)
    await client.attach()
    first = await anext(client.records())
    assert first
    await client.close()
    assert [batch async for batch in client.records()] == []


async def test_what_cannot_be_read_is_said(tmp_path: Path) -> None:
    with pytest.raises(EngineGone, match="is not a session"):
        await asyncio.wait_for(ReplayClient(tmp_path).attach(), PATIENCE)


# --- where it differs from its journal ---


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
    def fail(self: Kernel, input: object) -> None:
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr(Kernel, "handle", fail)
    for action in (recover, compare_replay):
        with pytest.raises(SessionError, match=r"journal.jsonl:2: input 1 makes the engine fail"):
            action(made.folder)


def test_a_difference_is_told_before_a_later_failure(made: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both lie in one block of lines, which is replayed before it is compared."""
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
