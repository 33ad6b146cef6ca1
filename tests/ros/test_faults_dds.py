"""Rows of the fault table that need real processes: a robot that is killed, terminated, restarted, or stands still, and
the whole engine against it, over real DDS on the loopback. The others are in `test_faults.py`."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import msgspec
import pytest
from rise_adapters.ros2.mapping import read_mappings
from rise_adapters.ros2.robot import Ros2Robot

from rise_engine.kernel.records import RobotRecord
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.engine import Engine
from tests.forked import AsyncForked
from tests.ros.badrobot import Plan
from tests.ros.bench import GAZE, SPEECH, TYPES, Records, profile, scenario
from tests.ros.contract.peers import ROOT, environment

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from rise_adapters.ros2.transport.dds import DdsTransport

from tests.patience import PATIENCE

pytestmark = pytest.mark.dds

LONG = Plan(seconds=60)
TASK = "2/1"


class Process:
    """A bad robot in a process of its own, and what it has said."""

    def __init__(self, process: AsyncForked | asyncio.subprocess.Process) -> None:
        self.process = process
        self.events: list[dict[str, Any]] = []
        self._reading = asyncio.ensure_future(self._read())

    async def _read(self) -> None:
        assert self.process.stdout is not None
        while line := await self.process.stdout.readline():
            self.events.append(json.loads(line))

    def said(self, event: str, name: str = SPEECH) -> list[str]:
        return [each.get("id", "") for each in self.events if each["event"] == event and each.get("name", name) == name]

    async def ready(self) -> Process:
        await until(lambda: self.said("ready"))
        return self

    async def end(self) -> None:
        if self.process.returncode is None:
            self.process.kill()
        await self.process.wait()
        await self._reading


class Session(Records):
    """An engine on DDS in real time."""

    def __init__(self, **deadlines: float) -> None:
        self.records = []
        loop = asyncio.get_running_loop()
        self.clock = RealClock(loop)
        self.processes: list[Process] = []
        self.transport = DdsTransport(loop, node="engine", environment=environment())
        which = profile(**deadlines)
        self.robot = Ros2Robot(which, self.clock, self.transport, read_mappings(which, self.transport.fields))
        self.engine = Engine(scenario(which), self.robot, self.clock, 1, sinks=[self.records.append])
        self.engine.start()
        self.submit("startInteractionRule", "Watch")

    async def process(self, *plans: Plan, wait: bool = True) -> Process:
        """A robot. It has to be loaded first: one that is to come soon is made before it is needed."""
        order = {"names": TYPES, "plans": [msgspec.to_builtins(plan) for plan in plans or (Plan(),)]}
        made = Process(
            await AsyncForked.start(
                json.dumps(order),
                module="tests.ros.badrobot",
                loads=("rise_adapters.ros2.transport.dds",),
                stderr=None,
                cwd=ROOT,
                env=environment(),
            )
        )
        self.processes.append(made)
        return await made.ready() if wait else made

    async def connected(self) -> None:
        try:
            await until(lambda: self.robot_statuses()[-1:] == ["connected"])
        except AssertionError:
            raise AssertionError(f"never connected: {self.of(RobotRecord)}, nodes {self.transport.nodes()}") from None

    async def running(self) -> Process:
        """A robot that is in the middle of a long speech."""
        robot = await self.process(LONG)
        await self.connected()
        self.act()
        await until(lambda: "accepted" in self.history(TASK) and robot.said("begin"))
        return robot

    async def goes_on(self) -> None:
        """With another robot, the study goes on."""
        await self.process()
        await self.connected()
        self.act()
        await until(lambda: self.task() == "SUCCEEDED")

    async def over(self) -> None:
        self.engine.end("over", stop=True)
        await until(lambda: self.engine.ended)
        for process in self.processes:
            await process.end()
        await asyncio.sleep(0)
        self.transport.close()


async def until(holds: Callable[[], Any], patience: float = PATIENCE) -> None:
    limit = time.monotonic() + patience
    while not holds():
        assert time.monotonic() < limit, "it did not come to that"
        await asyncio.sleep(0.005)


@asynccontextmanager
async def session(**deadlines: float) -> AsyncIterator[Session]:
    made = Session(**deadlines)
    try:
        yield made
    finally:
        await made.over()
    made.check()


async def test_a06_sigkill_in_the_middle() -> None:
    async with session() as s:
        robot = await s.running()
        robot.process.kill()
        await until(lambda: s.ending(TASK))  # when the lease that the robot's node has is over
        assert s.ending(TASK).startswith("lost: server-gone") and s.robot_statuses()[-1] == "lost"
        await s.goes_on()


async def test_a06_sigkill_is_found_by_missing_feedback_before_the_lease_is_over() -> None:
    async with session(feedback=0.6) as s:
        robot = await s.process(Plan(seconds=60, feedback_every=0.1))
        await s.connected()
        s.act()
        await until(lambda: "accepted" in s.history(TASK) and robot.said("begin"))
        robot.process.kill()
        await until(lambda: s.ending(TASK))
        assert s.ending(TASK).startswith("lost: ")


async def test_a07_sigterm_in_the_middle() -> None:
    async with session() as s:
        robot = await s.running()
        robot.process.terminate()
        await robot.process.wait()
        await until(lambda: s.ending(TASK))
        assert s.ending(TASK).startswith("lost: server-gone")
        await s.goes_on()


async def test_a08_restarted_in_the_middle_and_it_knows_nothing() -> None:
    async with session() as s:
        robot = await s.running()
        robot.process.kill()
        again = await s.process(Plan())
        await until(lambda: s.ending(TASK))
        assert s.ending(TASK).startswith("lost: server-")
        await s.connected()
        s.act()
        await until(lambda: s.task() == "SUCCEEDED")
        assert len(again.said("begin")) == 1, "what was lost is not done again"


async def test_a24_the_server_stands_still_for_two_seconds() -> None:
    async with session() as s:
        robot = await s.process(Plan(seconds=2.2, block=2.0))
        await s.connected()
        s.act()
        await until(lambda: robot.said("begin"))
        s.stop_act()  # is answered only when it moves again, and the engine's loop does not wait for that
        turns = 0
        while not s.ending(TASK):
            await asyncio.sleep(0.005)
            turns += 1
        assert s.ending(TASK) == "canceled" or s.ending(TASK).startswith("succeeded: succeeded-during-cancel")
        assert s.task() == "CANCELED" and turns > 1


async def test_a26_a_robot_that_is_killed_again_and_again() -> None:
    async with session() as s:
        robot = await s.process(LONG)
        await s.connected()
        for _ in range(3):
            s.act()
            following = await s.process(LONG, wait=False)
            robot.process.kill()
            robot = await following.ready()
        robot.process.kill()
        await until(lambda: s.robot_statuses()[-1] == "lost" and s.engine.idle)
        changes = s.robot_statuses()
        # How many there are is up to how long processes take to start here; test_faults counts them in virtual time.
        assert len(changes) <= 3 * 4, changes
        await s.goes_on()
        # On a busy machine one that was killed may still be seen for a moment, and be lost once more.
        assert s.robot_statuses()[len(changes) :][-1] == "connected"


async def test_a23_two_servers_on_one_name() -> None:
    async with session(server=1) as s:
        robot = await s.process(LONG)
        await s.connected()
        twin = await s.process(LONG)
        await until(lambda: s.robot_statuses()[-1] == "degraded")
        s.act()
        await until(lambda: s.ending(TASK))
        assert s.ending(TASK).startswith("failed: two-servers: 2 nodes offer /pepper/rise/speech")
        assert robot.said("goal") == twin.said("goal") == []


async def test_a29_stop_reaches_the_goals_of_others_too() -> None:
    async with session() as s:
        robot = await s.running()
        s.stop_all()
        await until(s.stops)
        assert s.stops()[0].confirmed == ("pepper/look_at", "pepper/speech") and s.stops()[0].unconfirmed == ()
        assert robot.said("cancel", GAZE) == ["00" * 16] and "00" * 16 in robot.said("cancel")
        await until(lambda: robot.said("end") == robot.said("begin"))  # its own account of it comes by another way


async def test_a29_stop_after_the_robot_was_killed() -> None:
    async with session() as s:
        robot = await s.running()
        robot.process.kill()
        s.stop_all()
        await until(s.stops)
        assert all(part.endswith(("no answer)", "(gone)")) for part in s.stops()[0].unconfirmed)
        assert s.stops()[0].confirmed == () and len(s.stops()[0].unconfirmed) == 2
