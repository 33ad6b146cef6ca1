"""The session as another process sees it, over real DDS on the loopback."""

from __future__ import annotations

import asyncio
import json
import random
import sys
import tempfile
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from statistics import quantiles

import pytest
from rise_adapters.ros2.port import STATUS, QoS
from rise_adapters.ros2.record_topics import RECORDS_LATCHED

from rise_engine.kernel.inputs import Note
from rise_engine.link.socket_client import SocketClient
from tests.link.serving import ROOT, Follower
from tests.ros.facing import Node, until

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from rise_adapters.ros2.dds import DdsTransport

from tests.ros.face_process import environment

KEY_SECONDS = 0.010
"""By which a flood may delay a wizard's key (99 of 100)."""


PLACE = "/dev/shm" if Path("/dev/shm").is_dir() else "/tmp"
"""In memory: how long a disk takes is not what is measured."""

CLOCK = """
import sys, time, threading
late, done = [], threading.Event()
threading.Thread(target=lambda: (sys.stdin.read(), done.set()), daemon=True).start()
while not done.is_set():
    due = time.monotonic() + 0.005
    time.sleep(0.005)
    late.append(time.monotonic() - due)
print(sorted(late)[len(late) * 99 // 100])
"""
"""By how much a process that does nothing else comes late on this machine (99 of 100)."""


class Session:
    """A session in a process of its own."""

    def __init__(self, process: asyncio.subprocess.Process, socket: Path) -> None:
        self.process, self.socket = process, socket

    async def end(self) -> dict[str, float]:
        figures, _ = await asyncio.wait_for(self.process.communicate(b""), 30)
        assert self.process.returncode == 0
        found: dict[str, float] = json.loads(figures)
        return found


@asynccontextmanager
async def on_the_wire() -> AsyncIterator[tuple[Session, Node]]:
    domain = random.SystemRandom().randrange(1, 100)
    pipe = asyncio.subprocess.PIPE
    with tempfile.TemporaryDirectory(prefix="rise-", dir=PLACE) as place:
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "tests.ros.face_process", place, str(domain),
            stdin=pipe, stdout=pipe, cwd=ROOT, env=environment(),
        )  # fmt: skip
        transport = DdsTransport(asyncio.get_running_loop(), node="node", domain=domain, environment=environment())
        try:
            assert process.stdout is not None
            words = (await asyncio.wait_for(process.stdout.readline(), 30)).decode().split()
            node = Node(transport)
            await node.ready()
            yield Session(process, Path(words[1])), node
        finally:
            transport.close()
            if process.returncode is None:
                process.kill()
                await process.wait()


async def test_the_whole_face_over_dds() -> None:
    async with on_the_wire() as (session, node):
        assert {"/node", "/rise"} <= set(node.transport.nodes())
        hello = node.ask("startCommunicationRobotAct", "Hello")
        assert await hello.decided()
        assert await hello.ended() == ("SUCCEEDED", "")
        await until(lambda: hello.progress == ["PENDING", "ACTIVE"])

        story, waiting = (node.ask("startCommunicationRobotAct", act) for act in ("Story", "Hello"))
        assert await story.decided() and await waiting.decided()
        await until(lambda: waiting.feedback)
        assert waiting.feedback[0]["position"] == 0
        node.cancel(waiting)
        assert (await waiting.ended())[0] == "CANCELED"
        answers: list[object] = []
        node.client.cancel_all(answers.append)
        assert (await story.ended())[0] == "CANCELED"
        await until(lambda: answers)

        assert not await node.ask("startCommunicationRobotAct", "Helo").decided()
        await until(lambda: any("did you mean 'Hello'" in state["reason"] for state in node.tasks))

        assert await node.ask("assignValue", json.dumps({"umlaut": ["ä😀", None, 1.5]})).decided()
        answer = await node.get("umlaut")
        assert (answer["found"], answer["type"]) == (True, "array") and json.loads(answer["value"]) == [
            "ä😀",
            None,
            1.5,
        ]
        assert not (await node.get("nothing"))["found"]

        rule = node.ask("startInteractionRule", "Doors")
        assert await rule.decided()
        assert await node.ask("raiseEventTopic", "/open").decided()
        await until(lambda: node.rules and node.rules[-1]["state"] == "Open")

        await until(lambda: node.diagnostics)
        levels = {each["name"]: each["level"] for each in node.diagnostics[-1]["status"]}
        assert levels["rise: session"] == levels["rise: journal"] == levels["rise: ros"] == 0

        late = node.hear("/rise/record", "rise_interfaces/msg/Record", QoS(RECORDS_LATCHED, latched=True))
        await until(lambda: late and late[-1]["seq"] == node.records[-1]["seq"])
        assert [record["seq"] for record in late] == list(range(1, late[-1]["seq"] + 1))
        assert all(json.loads(record["json"])["seq"] == record["seq"] for record in late)
        status = node.hear("/rise/domain_task/_action/status", "action_msgs/msg/GoalStatusArray", STATUS)
        await until(lambda: status)

        ending = asyncio.create_task(session.end())
        assert await rule.ended() == ("ABORTED", "the session has ended: the test is over") or rule.result["reason"]
        await ending
        await until(lambda: not node.client.servers())


async def test_a_thousand_goals_in_a_second_do_not_hold_up_the_wizard() -> None:
    """One of three times on a machine that has other things to do; one that is late itself is forgiven that."""
    figures = ""
    for _ in range(3):
        slower, machine, figures = await _flooded(1000, 2.0)
        if slower < KEY_SECONDS + machine:
            return
    pytest.fail(figures)


async def _flooded(rate: int, seconds: float) -> tuple[float, float, str]:
    """By how much the wizard's keys took longer (99 of 100) while goals came in, and how late the machine was."""
    async with on_the_wire() as (session, node):
        wizard = await Follower(SocketClient(session.socket, "anna")).attach()
        quiet = await _keys(wizard, 1.0)
        flood = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "tests.ros.goal_flood", str(node.transport.domain), str(rate), str(seconds),  # type: ignore[attr-defined]
            stdout=asyncio.subprocess.PIPE, cwd=ROOT, env=environment(),
        )  # fmt: skip
        assert flood.stdout is not None
        await flood.stdout.readline()
        clock = await asyncio.create_subprocess_exec(
            sys.executable, "-S", "-c", CLOCK, stdin=asyncio.subprocess.PIPE, stdout=asyncio.subprocess.PIPE
        )
        busy = await _keys(wizard, seconds)
        machine = float((await clock.communicate(b""))[0])
        sent = json.loads(await flood.stdout.read())
        await flood.wait()
        await wizard.close()
        found = await session.end()
        a, b = (quantiles(each, n=100)[98] for each in (quiet, busy))
        figures = f"key p99 {a * 1000:.1f} -> {b * 1000:.1f} ms, machine {machine * 1000:.1f} ms, {sent}, {found}"
        print(figures)
        assert sent["answered"] == sent["sent"], figures
        return b - a, machine, figures


async def _keys(wizard: Follower, seconds: float) -> list[float]:
    """How long each took until it was accepted."""
    took = []
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        began = time.perf_counter()
        assert (await wizard.client.send(Note(text="key"))).accepted
        took.append(time.perf_counter() - began)
        await asyncio.sleep(0.01)
    return took
