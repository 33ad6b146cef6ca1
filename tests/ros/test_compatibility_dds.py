"""A session and a robot that were built from two versions of one interface package, over real DDS on the loopback.

On the wire a message has no names of fields: without a comparison, what was meant as one thing arrives as another, and
the robot says that it succeeded.
"""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from msgspec.structs import replace
from rise_adapters.ros2.actions.server import ActionServer
from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.mapping import read_mappings
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.transport.port import Message

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, Note, RobotChanged
from rise_engine.ports.robot import RobotReport
from rise_engine.run.engine.clock import RealClock
from rise_engine.scenario.model import RobotProfile
from rise_engine.scenario.reading.action_declarations import core_actions
from tests.ros.contract.peers import environment
from tests.ros.session_node_bench import until

pytest.importorskip("cyclonedds")
pytest.importorskip("rosbags")

from rise_adapters.ros2.transport.dds import DdsTransport

from tests.patience import PATIENCE

pytestmark = pytest.mark.dds

WAVE = "lab_msgs/action/Wave"
ONE = "int32 level\nfloat32[] gains\nstring[] tags\n---\nbool done\n---\n"
OTHER = "float32[] gains\nint32 level\nstring[] tags\n---\nbool done\n---\n"
GOAL = {"level": 1, "gains": [0.5, 0.25], "tags": ["a"]}


def node(name: str, share: Path, definition: str) -> DdsTransport:
    """A node whose computer has that version of `lab_msgs`."""
    file = share / name / "lab_msgs/action/Wave.action"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(definition, "utf-8")
    settings = {name: value for name, value in environment().items() if name != "AMENT_PREFIX_PATH"}
    return DdsTransport(asyncio.get_running_loop(), node=name, share=[share / name], environment=settings)


class Arm:
    """A robot that waves."""

    def __init__(self, transport: DdsTransport) -> None:
        self.transport = transport
        self.received: list[Message] = []
        clock = RealClock(asyncio.get_running_loop(), 1.0, 0.0)
        self.server = ActionServer(transport, "/arm/wave", WAVE, self.asked, clock=clock)

    def asked(self, goal: ServerGoal) -> None:
        self.received.append(goal.message)
        goal.accept()
        goal.succeed({"done": True})

    async def leave(self) -> None:
        self.server.close()
        self.transport.close()


async def test_e1_two_builds_of_one_interface_package(tmp_path: Path) -> None:
    transport = node("session", tmp_path, ONE)
    carrier = {"action": "/arm/wave", "type": WAVE, "goal": GOAL}
    patient = {"deadlines": {"server": 60.0, "acceptance": 60.0}}
    which = RobotProfile(
        "arm", "Arm", "ros2", {"Emotion": replace(core_actions()["Emotion"], carrier=carrier)}, patient
    )
    clock = RealClock(asyncio.get_running_loop(), 1.0, 0.0)
    robot = Ros2Robot(which, clock, transport, read_mappings(which, transport.fields))
    reports: list[RobotReport] = []
    robot.connect(reports.append)

    def statuses() -> list[str]:
        return [each.status for each in reports if isinstance(each, RobotChanged)]

    def endings() -> list[ActionReport]:
        return [each for each in reports if isinstance(each, ActionReport) and each.status != "accepted"]

    def wave(action: str) -> None:
        robot.start(StartAction(action=action, type="Emotion", parameters={"value": "happy"}, expected=1.0))

    try:
        wave("1/1")  # before anything is there: it waits for the robot
        wrong = Arm(node("arm_of_last_year", tmp_path, OTHER))
        await until(endings, PATIENCE)
        assert endings()[0].status == "failed"
        assert endings()[0].reason.startswith("other-version: /arm/wave is offered")
        sentence = f"with another version of {WAVE}; build its interface package from the same release"
        assert sentence in endings()[0].reason
        await until(statuses, PATIENCE)
        assert statuses() == ["lost"]
        wave("2/1")
        await until(lambda: len(endings()) == 2, PATIENCE)
        assert sentence in endings()[1].reason and wrong.received == []

        await wrong.leave()
        right = Arm(node("arm", tmp_path, ONE))
        await until(lambda: statuses()[-1] == "connected", PATIENCE)
        wave("3/1")
        await until(lambda: len(endings()) == 3, PATIENCE)
        assert endings()[2].status == "succeeded" and right.received == [GOAL]
        assert [each for each in reports if isinstance(each, Note)] == []
        await right.leave()
    finally:
        robot.close()
        transport.close()
