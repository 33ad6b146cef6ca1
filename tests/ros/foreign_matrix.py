"""Every fault that the simulated robot knows, on a robot that knows nothing of RISE: Zora (tests/ros/data/zora), whose
speech is a service, and which drives as in Nav2 and moves its arm as in ros2_control.

    python -m tests.ros.foreign_matrix --robot dds --transport dds --part 1/4

Moments and truth are those of `fault_matrix`. With rclpy, its package `zora_interfaces` has to be built and sourced.
"""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import sys
import tempfile
from functools import cache, partial
from itertools import product
from pathlib import Path
from typing import Any

from msgspec.structs import replace
from rise_adapters.simulated.faults import FAULT_KINDS

from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from tests.ros.contract.peers import ROOT
from tests.ros.fault_matrix import (
    MOMENTS,
    START_SECONDS,
    Case,
    open_transport,
    play_cases,
    play_to_end,
    read_arguments,
)
from tests.ros.zora import FOLDER
from tests.run.engine.samples import assert_one_ending_each

ACTIONS = {
    "Go": ("zora/navigate_to_pose", "<place>table</place>"),
    "Arm": ("zora/follow_joint_trajectory", "<shoulder>90</shoulder><duration>3000</duration>"),
    "Tts": ("zora/tts", f"<text>{'Hello, dear reader. ' * 3}</text>"),
    "Turn": ("zora/cmd_vel", "<speed>0.5</speed><duration>3000</duration>"),
    "Speech": ("zora/say", f"<message>{'Hello, dear reader. ' * 3}</message>"),
}
"""The part that each is done by, and its parameters: three seconds and more of it."""
AMOUNTS = {"slow": 2, "slow-accept": 2.5, "slow-reject": 2.5, "late-begin": 2, "slow-cancel": 1.5}
OF_GOALS = ("lost-accept", "refuse-cancel", "ignore-cancel", "slow-cancel", "die-on-cancel")
"""What cannot go wrong with a call of a service."""
FAULTS = [
    f"{action}={kind}{f':{AMOUNTS[kind]}' if kind in AMOUNTS else ''}@1"
    for action, kind in product(ACTIONS, FAULT_KINDS)
    if action != "Turn" and (action != "Speech" or kind not in OF_GOALS)
]
CASES = [
    *product(
        FAULTS, ("nothing", "stop_in_the_middle", "cancel_and_start_again", "kill", "kill_the_engine_in_the_middle")
    ),
    *product(["Turn"], MOMENTS),  # a message on a topic has no fault of its own
]

EVENTS = {"arrived": "goal", "begun": "begin", "ended": "end"}
"""Of its log, in the words of `badrobot`."""


@cache
def study(action: str) -> tuple[Path, Scenario]:
    """Its folder, and the scenario: one act of one action."""
    folder = Path(tempfile.mkdtemp(prefix="rise-zora-")) / "zora"
    shutil.copytree(FOLDER, folder)
    act = f'<Dialog name="Greet"><{action}><actionID>1</actionID>{ACTIONS[action][1]}</{action}></Dialog>'
    (folder / "acts").joinpath("greet.xml").write_text(act)
    loaded, findings = load(folder)
    assert loaded is not None, findings
    return folder, loaded


class SimulatedRobot:
    """The simulated robot as a process, and the events of its log in the words of `badrobot`."""

    def __init__(self, process: asyncio.subprocess.Process, log: Path) -> None:
        self.process = process
        self._log = log

    @property
    def events(self) -> list[dict[str, Any]]:
        rows = [json.loads(line) for line in self._log.read_text().splitlines() if line.endswith("}")]
        return [
            {"event": EVENTS[row["event"]], "id": row["goal"], "at": row["t"]} for row in rows if row["event"] in EVENTS
        ]

    def said(self, event: str) -> list[str]:
        return [each["id"] for each in self.events if each["event"] == event]

    async def end(self) -> None:
        if self.process.returncode is None:
            self.process.kill()
        await self.process.wait()


class ForeignCase(Case):
    """A session with Zora."""

    def __init__(self, action: str, *more: Any) -> None:
        self.action = action
        super().__init__(*more)

    def make_scenario(self) -> Scenario:
        return replace(study(self.action)[1], mode="real")

    def check(self) -> None:
        assert self.engine.idle
        assert_one_ending_each(self.records)


async def play(fault: str, moment: str, robot: str, transport: str) -> list[str]:
    """One case; what was wrong, in sentences."""
    action = fault.partition("=")[0]
    folder, _ = study(action)
    log = folder.parent / "did.jsonl"
    log.write_text("")
    command = ["-m", "rise_ros.examples.simulated_robot", "--config", str(folder), "--ros", robot]
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, *command, "--log", str(log), *(["--fault", fault] if "=" in fault else [])),
        stdout=asyncio.subprocess.PIPE,
        cwd=ROOT,
        env=dict(os.environ),
    )
    made = SimulatedRobot(process, log)
    try:
        assert process.stdout is not None
        async with asyncio.timeout(START_SECONDS):
            while b"/cmd_vel" not in (line := await process.stdout.readline()):
                assert line, "the simulated robot did not start"
        drain = asyncio.ensure_future(process.stdout.read())
        case = ForeignCase(action, partial(open_transport, transport, share=[folder / "share"]), made)
        found = await play_to_end(case, moment, ACTIONS[action][0])
    finally:
        await made.end()
    await drain
    return found


if __name__ == "__main__":
    os.environ["ZORA"] = str(FOLDER)
    sys.exit(asyncio.run(play_cases(CASES, play, read_arguments())))
