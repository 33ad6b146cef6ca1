"""Bags: a recorder's services as Jazzy has them (which stays paused after a stop), and a program of our own."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from rise_adapters.recorders import rosbag2
from rise_adapters.recorders.rosbag2 import open_rosbag2
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog
from rise_adapters.ros2.transport.port import Message, SendReply

from rise_engine.ports.recorder import RecorderError, RecordingPlan
from tests.patience import PATIENCE
from tests.ros.memory import MemoryTransport, MemoryWire

NODE = "/rosbag2_recorder"


class BagRecorderNode:
    """rosbag2's recorder on Jazzy: after `stop` it stays paused, and `record` does not resume it."""

    def __init__(self, wire: MemoryWire) -> None:
        self.transport = MemoryTransport(wire, asyncio.get_running_loop(), node=NODE)
        self.wire = wire
        self.paused = False
        self.resumes = True
        self.refuses = ""
        self.bag: Path | None = None
        for service in ("record", "stop", "resume", "is_paused"):
            type = {"is_paused": "IsPaused"}.get(service, service.capitalize())
            self.transport.serve(f"{NODE}/{service}", f"rosbag2_interfaces/srv/{type}", getattr(self, service))

    def record(self, request: Message, answer: SendReply) -> None:
        if self.bag is not None or self.refuses:
            answer({"return_code": 1, "error_string": self.refuses or "already recording"})
            return
        self.bag = Path(request["uri"])
        self.bag.mkdir()
        (self.bag / "bag_0.mcap").write_bytes(b"")
        answer({"return_code": 0, "error_string": ""})

    def resume(self, request: Message, answer: SendReply) -> None:
        self.paused = self.paused and not self.resumes
        answer({})

    def is_paused(self, request: Message, answer: SendReply) -> None:
        self.write()
        answer({"paused": self.paused})

    def write(self) -> None:
        """Messages come all the time; they are written unless it is paused."""
        if self.bag is not None and not self.paused:
            with (self.bag / "bag_0.mcap").open("ab") as file:
                file.write(b"x" * 1000)

    def stop(self, request: Message, answer: SendReply) -> None:
        if self.bag is not None:
            (self.bag / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
        self.bag, self.paused = None, True
        answer({})


@pytest.fixture
async def node(monkeypatch: pytest.MonkeyPatch) -> BagRecorderNode:
    wire = MemoryWire()

    async def open_in_memory(choice: str, arguments: Any, *, node: str) -> MemoryTransport:
        return MemoryTransport(wire, asyncio.get_running_loop(), node=f"/{node}")

    monkeypatch.setattr("rise_adapters.ros2.transport.selection.open_transport", open_in_memory)
    monkeypatch.setattr(rosbag2, "FOUND_SECONDS", 0.2)
    monkeypatch.setattr(rosbag2, "ANSWER_SECONDS", 0.2)
    return BagRecorderNode(wire)


def plan(folder: Path) -> RecordingPlan:
    return RecordingPlan("S1", folder)


async def test_the_second_bag_is_not_empty_although_the_recorder_stays_paused(
    node: BagRecorderNode, tmp_path: Path
) -> None:
    for name in ("S1_bag", "S1_bag_2"):
        recorder = open_rosbag2("bag", {"node": NODE})
        assert await recorder.prepare(plan(tmp_path)) == f"the bag recorder {NODE} over in memory, node /rise_recorders"
        assert await recorder.start() == str(tmp_path / name)
        first, second = await recorder.status(), await recorder.status()
        assert first.recording and second.bytes is not None and (first.bytes or 0) < second.bytes
        assert await recorder.stop() == str(tmp_path / name) and node.paused
        await recorder.close()
        assert (tmp_path / name / "metadata.yaml").exists()


async def test_one_that_cannot_be_resumed_is_found_out(node: BagRecorderNode, tmp_path: Path) -> None:
    node.paused, node.resumes = True, False
    recorder = open_rosbag2("bag", {"node": NODE})
    await recorder.prepare(plan(tmp_path))
    with pytest.raises(RecorderError, match="has made a bag and stays paused: nothing would be in it"):
        await recorder.start()
    await recorder.stop()  # what it has begun is ended
    assert node.bag is None
    await recorder.close()


async def test_one_that_is_paused_by_somebody_does_not_record(node: BagRecorderNode, tmp_path: Path) -> None:
    recorder = open_rosbag2("bag", {"node": NODE})
    await recorder.prepare(plan(tmp_path))
    await recorder.start()
    node.paused = True
    assert not (await recorder.status()).recording
    await recorder.close()


async def test_what_somebody_else_records_goes_on(node: BagRecorderNode, tmp_path: Path) -> None:
    node.bag = tmp_path
    recorder = open_rosbag2("bag", {"node": NODE})
    await recorder.prepare(plan(tmp_path))
    with pytest.raises(RecorderError, match=r"refused to record \(code 1\): already recording"):
        await recorder.start()
    assert await recorder.stop() == "" and node.bag is not None
    await recorder.close()


async def test_one_that_is_not_there_or_silent_is_given_up(node: BagRecorderNode, tmp_path: Path) -> None:
    missing = open_rosbag2("bag", {"node": "/nobody"})
    with pytest.raises(RecorderError, match="there is no service /nobody/is_paused: is the recorder running"):
        await missing.prepare(plan(tmp_path))
    node.wire.drop("*/record", what="reply")
    recorder = open_rosbag2("bag", {"node": NODE})
    await recorder.prepare(plan(tmp_path))
    with pytest.raises(RecorderError, match=r"/record did not answer within 0.2 s"):
        await recorder.start()
    assert await recorder.stop() and node.bag is None  # it had begun after all
    await recorder.close()


async def test_a_stop_whose_answer_is_lost_is_known_by_the_bag(node: BagRecorderNode, tmp_path: Path) -> None:
    """Its answer has another type in later releases."""
    node.wire.drop("*/stop", what="reply")
    recorder = open_rosbag2("bag", {"node": NODE})
    await recorder.prepare(plan(tmp_path))
    path = await recorder.start()
    assert await recorder.stop() == path
    await recorder.close()


def test_the_services_are_known_without_ros() -> None:
    catalog = InterfaceCatalog(environment={})
    fields = {
        name: dict(catalog.fields(f"rosbag2_interfaces/srv/{name}"))
        for name in ("Record_Request", "Record_Response", "IsPaused_Response", "Stop_Response", "Resume_Request")
    }
    assert fields["Record_Request"] == {"uri": "string"}
    assert fields["Record_Response"] == {"return_code": "int32", "error_string": "string"}
    assert fields["IsPaused_Response"] == {"paused": "bool"}


# --- the program -----------------------------------------------------------------------------------------------------


def ros2(folder: Path, *lines: str) -> str:
    """A program `ros2` that takes `bag record --output DIR` and then does this."""
    path = folder / "ros2-of-test"
    head = [
        '[ "$3" = --help ] && exit 0',
        'bag="$4"',
        'mkdir "$bag"',
        'end() { echo x > "$bag/metadata.yaml"; exit 0; }',
    ]
    path.write_text("\n".join(["#!/bin/sh", *head, *lines, ""]))
    path.chmod(0o700)
    return str(path)


async def test_a_program_of_our_own_records_until_it_is_interrupted(tmp_path: Path) -> None:
    program = ros2(tmp_path, "trap end INT", 'echo "$@" > "$bag/bag_0.mcap"', "while :; do sleep 0.05; done")
    recorder = open_rosbag2("bag", {"program": program, "topics": ["/rise/record"], "arguments": ["--storage", "mcap"]})
    await recorder.prepare(plan(tmp_path))
    path = Path(await recorder.start())
    async with asyncio.timeout(PATIENCE):
        while not (await recorder.status()).bytes:  # noqa: ASYNC110  # another process, or the session
            await asyncio.sleep(0.02)
    said = (path / "bag_0.mcap").read_text()
    assert said == f"bag record --output {path} --storage mcap /rise/record\n"
    assert await recorder.stop() == str(path) and (path / "metadata.yaml").exists()
    await recorder.close()


async def test_a_program_that_ends_or_leaves_half_a_bag_says_so(tmp_path: Path) -> None:
    broken = ros2(tmp_path, 'echo "no plugin: mcap" >&2', "exit 3")
    recorder = open_rosbag2("bag", {"program": broken})
    await recorder.prepare(plan(tmp_path))
    with pytest.raises(RecorderError, match="bag record ended with exit status 3: no plugin: mcap"):
        await recorder.start()
        async with asyncio.timeout(PATIENCE):
            while True:
                await recorder.status()
                await asyncio.sleep(0.02)
    with pytest.raises(RecorderError, match=r"the bag has no metadata.yaml: `ros2 bag reindex"):
        await recorder.stop()
    await recorder.close()
    with pytest.raises(RecorderError, match="ros2-nowhere is not installed here"):
        await open_rosbag2("bag", {"program": "ros2-nowhere"}).prepare(plan(tmp_path))
