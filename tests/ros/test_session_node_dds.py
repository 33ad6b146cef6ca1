"""The session as another process sees it, over real DDS on the loopback."""

from __future__ import annotations

import asyncio
import json
import tempfile
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
from rise_adapters.ros2.actions.client import ALL_GOALS
from rise_adapters.ros2.record_messages import RECORDS_LATCHED
from rise_adapters.ros2.transport.port import STATUS, QoS

from rise_engine.kernel.inputs import Note
from rise_engine.run.client.socket import SocketClient
from tests.forked import PIPE, AsyncForked
from tests.ros.session_node_bench import Node, until
from tests.run.server.serving import ROOT, Follower

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from rise_adapters.ros2.transport.dds import DdsTransport

from tests.patience import PATIENCE
from tests.ros.domains import own_domain
from tests.ros.session_node_process import environment

pytestmark = pytest.mark.dds

PLACE = "/dev/shm" if Path("/dev/shm").is_dir() else "/tmp"
"""In memory: what a disk does is not what is tested."""


class Session:
    """A session in a process of its own."""

    def __init__(self, process: AsyncForked, socket: Path, domain: int) -> None:
        self.process, self.socket, self.domain = process, socket, domain

    async def end(self) -> dict[str, float]:
        self.process.stdin.close()
        figures = await asyncio.wait_for(self.process.stdout.read(), PATIENCE)
        assert await asyncio.wait_for(self.process.wait(), PATIENCE) == 0
        found: dict[str, float] = json.loads(figures)
        return found


@asynccontextmanager
async def on_the_wire() -> AsyncIterator[tuple[Session, Node]]:
    domain = own_domain()
    with tempfile.TemporaryDirectory(prefix="rise-", dir=PLACE) as place:
        process = await AsyncForked.start(
            place, domain, module="tests.ros.session_node_process",
            stdin=PIPE, stderr=None, cwd=ROOT, env=environment(domain),
        )  # fmt: skip
        transport = DdsTransport(asyncio.get_running_loop(), node="node", environment=environment(domain))
        try:
            words = (await asyncio.wait_for(process.stdout.readline(), PATIENCE)).decode().split()
            node = Node(transport)
            await node.ready()
            yield Session(process, Path(words[1]), domain), node
        finally:
            transport.close()
            if process.returncode is None:
                process.kill()
                await process.wait()


async def test_the_whole_face_over_dds() -> None:
    async with on_the_wire() as (session, node):
        await until(lambda: {"/node", "/rise"} <= set(node.transport.nodes()))
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
        node.client.cancel(ALL_GOALS, answers.append)
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
        await until(lambda: not node.client.count_servers())


async def test_a_thousand_goals_in_a_second_keep_nobody_waiting_for_ever() -> None:
    """Every goal is answered, and the wizard's keys are taken meanwhile; how quickly, `benchmarks/ros.py` measures."""
    async with on_the_wire() as (session, _):
        wizard = await Follower(SocketClient(session.socket, "anna")).attach()
        flood = await AsyncForked.start(
            session.domain, 1000, 1, module="tests.ros.goal_flood", stderr=None, cwd=ROOT,
            env=environment(session.domain),
        )  # fmt: skip
        await flood.stdout.readline()
        sent = asyncio.create_task(flood.stdout.read())
        keys = 0
        while not sent.done():
            assert (await wizard.client.send(Note(text="key"))).accepted
            keys += 1
        await flood.wait()
        figures = json.loads(await sent)
        await wizard.close()
        await session.end()
        assert figures["answered"] == figures["sent"] >= 900 and figures["accepted"], figures
        assert keys > 10
