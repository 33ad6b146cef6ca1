"""What a session publishes for other nodes, on a wire in memory and a real engine."""

from __future__ import annotations

import asyncio
import json
from datetime import datetime
from pathlib import Path

import pytest
from rise_adapters.ros2.record_messages import RULES_LATCHED
from rise_adapters.ros2.session_node import interface, record_topics
from rise_adapters.ros2.session_node.interface import ERROR, OK, STALE, WARN
from rise_adapters.ros2.session_node.record_topics import REPEATED_STATUS
from rise_adapters.ros2.transport.port import Message

from rise_engine.base.files import Disk
from rise_engine.kernel.inputs import RobotChanged, StopReport, Submit
from tests.ros.memory import MemoryTransport, MemoryWire
from tests.ros.session_node_bench import START_ACT, START_RULE, Node, session_and_node, status_of, until

# --- what is published --------------------------------------------------------------------------------------------


async def test_every_record_is_published_as_it_stands_in_the_journal(tmp_path: Path) -> None:
    async with session_and_node(tmp_path, disk=Disk()) as (session, node, _):
        for task in (node.ask(START_RULE, "Doors"), node.ask(START_ACT, "Hello"), node.ask("raiseEventTopic", "open")):
            assert await task.decided()
        await until(lambda: session.hub.view.tasks[2].ended)
        journal = next((tmp_path / "sessions").glob("*/journal*")).read_text("utf-8").splitlines()
        lines = [line.rpartition(',"crc"')[0] + "}" for line in journal if line.startswith('{"kind"')]
        await until(lambda: len(node.records) == len(lines))
        assert [record["json"] for record in node.records] == lines
        assert [record["seq"] for record in node.records] == list(range(1, len(lines) + 1))
        for record, line in zip(node.records, lines, strict=True):
            read = json.loads(line)
            assert (record["kind"], record["t"], record["seq"]) == (read["kind"], read["t"], read["seq"])
            stamp = record["header"]["stamp"]
            assert stamp["sec"] + stamp["nanosec"] / 1e9 == pytest.approx(
                datetime.fromisoformat(read["wall"]).timestamp(), abs=1e-5
            )
            assert record["session"] == Path(session.hub.folder).name


async def test_rule_states(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (_, node, _):
        rule = node.ask(START_RULE, "Doors")
        for topic in ("open", "knock", "leave"):
            assert await node.ask("raiseEventTopic", topic).decided()
        assert (await rule.ended())[0] == "SUCCEEDED"
        told = [(m["status"], m["state"], m["previous_state"], m["trigger"]) for m in node.rules]
        assert told == [
            ("started", "Closed", "", "start"),
            ("entered", "Closed", "", "start"),
            ("entered", "Open", "Closed", "/open"),
            ("stayed", "Open", "Open", "/knock"),
            ("entered", "Gone", "Open", "/leave"),
            ("ended", "Gone", "", ""),
        ]
        assert {m["rule"] for m in node.rules} == {"Doors"} and node.rules[0]["priority"] == 2.0


def moves(node: Node) -> list[Message]:
    return [m for m in node.rules if m["rule"] == "Doors" and m["status"] == "entered" and m["trigger"] != "start"]


async def test_who_comes_late_hears_the_state_of_every_running_rule(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, wire):
        for rule in ("Patient", "Doors"):
            assert await node.ask(START_RULE, rule).decided()
        for number in range(RULES_LATCHED * 2):
            topic = ("open", "close")[number % 2]
            session.engine.accept(Submit(function="raiseEventTopic", behavior=topic))
        await until(lambda: len(moves(node)) == RULES_LATCHED * 2)
        late = Node(MemoryTransport(wire, asyncio.get_running_loop(), "/late"))
        await until(lambda: len(late.rules) == RULES_LATCHED)
        state = {message["rule"]: message for message in late.rules}
        assert (state["Patient"]["status"], state["Patient"]["state"]) == (REPEATED_STATUS, "Waiting")
        assert state["Doors"]["state"] == "Closed"
        first = next(m for m in node.rules if m["rule"] == "Patient")
        assert state["Patient"]["header"] == first["header"], "it says since when"
        repeated = [m for m in node.rules if m["status"] == REPEATED_STATUS]
        assert 2 <= len(repeated) <= 4, "and seldom"


async def test_an_ended_rule_is_not_repeated(tmp_path: Path) -> None:
    async with session_and_node(tmp_path) as (session, node, _):
        assert await node.ask(START_RULE, "Patient").decided()
        assert await node.ask("stopInteractionRule", "Patient").decided()
        assert await node.ask(START_RULE, "Doors").decided()
        for number in range(RULES_LATCHED * 2):
            session.engine.accept(Submit(function="raiseEventTopic", behavior=("open", "close")[number % 2]))
        await until(lambda: len(moves(node)) == RULES_LATCHED * 2)
        assert REPEATED_STATUS not in {m["status"] for m in node.rules}


async def test_a_wire_that_is_gone_costs_the_session_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    wire = MemoryWire()
    loop = asyncio.get_running_loop()
    from tests.ros.session_node_bench import faced

    transport = MemoryTransport(wire, loop, "/rise")
    async with faced(tmp_path, transport) as session:
        transport.break_down()
        for number in range(100):
            session.engine.accept(Submit(function="assignValue", behavior=f"age = {number}"))
        await until(lambda: not session.face._topics.waiting)
        assert session.face._topics.error == "the middleware was shut down"
        assert session.face.status()["level"] == ERROR
    assert session.hub.view.tasks[100].status == "SUCCEEDED"
    assert caplog.text.count("could not be published") <= 2, "said once"


async def test_records_that_come_too_fast_are_counted_and_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(record_topics, "MAX_WAITING", 50)
    monkeypatch.setattr(interface, "DIAGNOSTICS_SECONDS", 0.05)
    async with session_and_node(tmp_path) as (session, node, _):
        await until(lambda: not session.face._topics.waiting)
        for number in range(100):
            session.engine.accept(Submit(function="assignValue", behavior=f"age = {number}"))
        assert session.face._topics.waiting == 50 and session.face._topics.dropped == 150
        note = await until(lambda: [r for r in node.records if r["kind"] == "note"])
        assert "150 records were not published" in json.loads(note[0]["json"])["text"]
        seqs = [record["seq"] for record in node.records]
        assert seqs == sorted(seqs) and len(seqs) == node.records[-1]["seq"] - 150
        assert WARN in {status["level"] for array in node.diagnostics for status in array["status"]}


# --- diagnostics --------------------------------------------------------------------------------------------------


async def test_diagnostics(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interface, "DIAGNOSTICS_SECONDS", 0.02)
    async with session_and_node(tmp_path, disk=Disk()) as (session, node, _):
        await until(lambda: status_of(node, "session")["level"] == OK)
        assert [s["name"] for s in node.diagnostics[-1]["status"]] == [
            "rise: session", "rise: robot link", "rise: journal", "rise: loop lag", "rise: ros",
        ]  # fmt: skip
        assert {s["hardware_id"] for s in node.diagnostics[-1]["status"]} == {session.engine.scenario.robot.name}
        assert status_of(node, "robot link")["level"] == status_of(node, "journal")["level"] == OK
        assert await node.ask(START_ACT, "Story").decided()
        await until(lambda: status_of(node, "session")["message"] == "running")
        values = {each["key"]: each["value"] for each in status_of(node, "session")["values"]}
        assert (values["acts running"], values["mode"], values["control"]) == ("Story", "debug", "nobody")
        session.engine.post(RobotChanged(status="degraded", detail="one motor is hot"))
        await until(lambda: status_of(node, "robot link")["level"] == WARN)
        session.engine.post(RobotChanged(status="lost", detail="no answer"))
        await until(lambda: status_of(node, "robot link")["level"] == ERROR)
        assert status_of(node, "robot link")["message"] == "lost: no answer"
        session.engine.accept(Submit(function="stopAll"))
        await until(lambda: status_of(node, "session")["level"] in (WARN, ERROR))
        session.engine.post(StopReport(unconfirmed=("arm",)))
        session.engine.end("done")
        session.engine.end_now("done")
        await until(lambda: status_of(node, "session")["level"] == STALE)
        assert status_of(node, "session")["message"] == "the session has ended: done"


async def test_the_robot_has_said_nothing_yet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(interface, "DIAGNOSTICS_SECONDS", 0.02)
    async with session_and_node(tmp_path, start=False) as (_, node, _):
        await until(lambda: status_of(node, "robot link")["level"] == STALE)
        assert status_of(node, "session")["level"] == STALE
        assert status_of(node, "journal")["message"] == "this session is not recorded"
