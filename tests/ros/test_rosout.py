"""What a session tells on /rosout."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from rise_adapters.ros2.session_node import record_topics
from rise_adapters.ros2.session_node.record_topics import ERROR, INFO, WARN, log_line_for_record
from rise_adapters.ros2.transport.port import Message

from rise_engine.kernel.inputs import RobotChanged, StopReport, Submit
from rise_engine.kernel.records import (
    ActionRecord,
    NoteRecord,
    OutcomeRecord,
    RecordingRecord,
    RuleRecord,
    StopRecord,
)
from tests.ros.memory import MemoryTransport, MemoryWire
from tests.ros.session_node_bench import Node, faced, session_and_node, until


async def test_what_somebody_greps_for(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, wire):
        heard = node.hear("/rosout", record_topics.ROSOUT_TYPE, record_topics.ROSOUT_QOS)
        engine = session.engine

        def lines() -> list[tuple[int, str]]:
            return [(each["level"], each["msg"]) for each in heard]

        assert await node.ask("startCommunicationRobotAct", "Story").decided()
        engine.post(RobotChanged(status="lost", detail="server-gone: the program of Pepper has gone"))
        engine.post(RobotChanged(status="connected", detail="Pepper"))
        assert not await node.ask("startCommunicationRobotAct", "Sotry").decided()
        assert not await node.ask("releaseStop", "/node").decided()
        assert (await node.ask("stopAll").ended())[0] == "SUCCEEDED"
        engine.post(StopReport(confirmed=("a",), unconfirmed=("b (no answer)",)))
        await until(lambda: any("NOT confirmed" in text or text.startswith("stop latched") for _, text in lines()))
        engine.post(Submit(function="releaseStop", source="wizard:anna"))
        await until(lambda: (INFO, "stop released by wizard:anna") in lines())
        engine.end("the study is over")
        engine.end_now("the study is over")
        await until(lambda: (INFO, "session ended: the study is over") in lines())
        said = lines()
        assert said[0][0] == INFO and said[0][1].startswith("session started: scenario, mode debug, robot generic")
        assert (ERROR, "robot lost: server-gone: the program of Pepper has gone") in said
        assert (INFO, "robot connected: Pepper") in said
        rejected = [text for level, text in said if level == WARN and " was rejected: " in text]
        assert rejected[0].startswith("act Sotry was rejected: there is no")
        assert rejected[1].startswith("release /node was rejected: a stop can be released by the")
        assert all(text.endswith(" (asked for by ros:domain_task)") for text in rejected)
        assert (WARN, "stop requested by ros:domain_task") in said
        assert {each["name"] for each in heard} == {"rise"} and all(each["stamp"]["sec"] > 0 for each in heard)
        late = Node(MemoryTransport(wire, asyncio.get_running_loop(), "/late")).hear(
            "/rosout", record_topics.ROSOUT_TYPE, record_topics.ROSOUT_QOS
        )
        await until(lambda: len(late) == len(heard))


async def test_a_node_in_a_namespace_and_without_rosout(tmp_path: Path) -> None:
    wire = MemoryWire()
    loop = asyncio.get_running_loop()
    heard: list[Message] = []
    MemoryTransport(wire, loop, "/cli").subscribe(
        "/rosout", record_topics.ROSOUT_TYPE, heard.append, record_topics.ROSOUT_QOS
    )
    async with faced(tmp_path, MemoryTransport(wire, loop, "/lab/rise")):
        await until(lambda: heard)
    assert {each["name"] for each in heard} == {"lab.rise"}


@pytest.mark.parametrize(
    ("record", "line"),
    [
        (StopRecord(1, 0.0, "", "latched", unconfirmed=("pepper/speech (it refused to stop)",)),
         (ERROR, "stop latched: NOT confirmed by pepper/speech (it refused to stop)")),
        (StopRecord(1, 0.0, "", "latched", confirmed=("a", "b")), (WARN, "stop latched: confirmed by a, b")),
        (ActionRecord(1, 0.0, "", 1, "Greet", "1", "Speech", {}, "lost", "server-gone: x"),
         (WARN, "Speech of Greet lost: server-gone: x")),
        (ActionRecord(1, 0.0, "", 1, "Greet", "1", "Speech", {}, "succeeded"), None),
        (RuleRecord(1, 0.0, "", "Doors", "faulted", "Open", reason="no x"),
         (ERROR, "rule Doors was stopped by a fault: no x")),
        (NoteRecord(1, 0.0, "", "late: it came twice", "ros:/pepper/speech"), (INFO, "note: late: it came twice")),
        (NoteRecord(1, 0.0, "", "the participant yawns", "wizard:anna"), None),
        (RecordingRecord(1, 0.0, "", "camera", "stalled", "/a", 5, "the disk is full", "node:c"),
         (WARN, "recording stalled: camera: the disk is full")),
        (RecordingRecord(1, 0.0, "", "camera", "running", "/a", 5, "", "node:c"), None),
        (OutcomeRecord(1, 0.0, "", "aborted", "a fire drill", "wizard:anna"),
         (INFO, "the session counts as aborted: a fire drill")),
    ],
)  # fmt: skip
def test_what_is_told_of_a_record(record: object, line: tuple[int, str] | None) -> None:
    assert log_line_for_record(record) == line  # type: ignore[arg-type]
