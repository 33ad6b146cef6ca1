"""Zora, a robot that knows nothing of RISE (tests/ros/data/zora): simulated on a wire in memory, in virtual time, and
the engine's side of it."""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from rise_adapters.ros2.mapping import read_mappings
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog
from rise_ros.examples.robot_log import RobotLog
from rise_ros.examples.simulated_robot import RobotOnWire

from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, Note, StopReport
from rise_engine.ports.robot import RobotReport
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.scenario.durations import expected_seconds
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import RobotProfile
from tests.ros.memory import ClockLoop, MemoryTransport, MemoryWire

FOLDER = Path(__file__).parent / "data" / "zora"
SHARE = FOLDER / "share"


@cache
def zora() -> RobotProfile:
    """With the places of its study."""
    scenario = load(FOLDER).scenario
    assert scenario is not None
    return scenario.robot


@cache
def definitions() -> Mapping[str, Mapping[str, str]]:
    """Of its own types."""
    types = InterfaceCatalog([SHARE], environment={})
    names = ["zora_interfaces/srv/Say_Request", "zora_interfaces/srv/Say_Response"]
    for file in (SHARE / "zora_interfaces" / "action").iterdir():
        names += [f"zora_interfaces/action/{file.stem}_{part}" for part in ("Goal", "Result", "Feedback")]
    return {name: types.fields(name) for name in names}


class Zora:
    """A session's robot, without an engine, and the simulated robot that it reaches."""

    def __init__(
        self, *faults: str, serving: bool = True, connect: bool = True, profile: RobotProfile | None = None
    ) -> None:
        self.clock = VirtualClock()
        self.loop = ClockLoop(self.clock)
        self.wire = MemoryWire(definitions())
        self.profile = profile or zora()
        self.near = MemoryTransport(self.wire, self.loop, "/engine")
        self.said: list[str] = []
        self._log = io.StringIO()
        self.far: list[RobotOnWire] = []
        if serving:
            self.serve(*faults)
        self.told: list[RobotReport] = []
        self.robot = Ros2Robot(self.profile, self.clock, self.near, read_mappings(self.profile, self.near.fields))
        if connect:
            self.connect()

    def connect(self) -> None:
        self.robot.connect(self.told.append)
        self.run(1)

    def serve(self, *faults: str) -> None:
        far = MemoryTransport(self.wire, self.loop, f"/zora{len(self.far)}")
        log = RobotLog(self._log)
        self.far.append(RobotOnWire(far, self.profile, self.clock, self.said.append, faults=faults, log=log))

    def start(self, name: str, kind: str, **parameters: Any) -> None:
        expected = expected_seconds(self.profile.actions[kind], parameters)
        self.robot.start(StartAction(name, kind, parameters, expected))

    def run(self, seconds: float) -> None:
        self.loop.run_until(self.clock.now() + seconds)

    def endings(self) -> list[tuple[str, str, str]]:
        """Of each action that has ended, how, and why."""
        return [
            (each.action, each.status, each.reason)
            for each in self.told
            if isinstance(each, ActionReport) and each.status != "accepted"
        ]

    def notes(self) -> list[str]:
        return [each.text for each in self.told if isinstance(each, Note)]

    def stop(self) -> StopReport:
        self.robot.stop_all()
        self.run(3)
        return next(each for each in reversed(self.told) if isinstance(each, StopReport))

    def log(self, action: str) -> list[str]:
        """What the robot really did with an action."""
        rows = [json.loads(line) for line in self._log.getvalue().splitlines()]
        return [" ".join(filter(None, (each["event"], each.get("how")))) for each in rows if each["action"] == action]
