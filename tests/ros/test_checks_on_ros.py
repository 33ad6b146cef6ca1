"""The checks `robot` and `sound` of a study, with a robot that is a process on the wire."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
import rise_adapters

from rise_engine.checks.devices import check_robot
from rise_engine.checks.outcome import CheckContext
from rise_engine.checks.programs import ChildRequest
from rise_engine.checks.runner import run_check
from rise_engine.ports.bridge import RosConnection, RosTransport
from rise_engine.study.model import Study, StudyCheck
from tests.cli.processes import folder
from tests.ros.contract.peers import environment, missing
from tests.ros.programs import Program

pytestmark = [pytest.mark.dds, pytest.mark.slow]

TRANSPORTS: list[RosTransport] = [kind for kind in ("dds", "rclpy") if not missing(kind)]
RISE = Path(rise_adapters.__file__).parent / "robots" / "rise.toml"
PATIENT, HASTY = "{ server = 100, acceptance = 20 }", "{ server = 0.1 }"
"""How long a robot is waited for: on a machine that is busy, and when it is not there."""


@pytest.mark.parametrize("ros", TRANSPORTS)
async def test_a_robot_on_the_wire(ros: RosTransport, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in environment().items():
        monkeypatch.setenv(name, value)
    scenario = folder(tmp_path / "scenario", 'robot = "patient"\nmode = "real"\nlanguage = "de"\n')
    (scenario / "robots").mkdir()
    for name, deadlines in (("patient", PATIENT), ("hasty", HASTY)):
        profile = RISE.read_text("utf-8").replace("[options]\n", f"[options]\ndeadlines = {deadlines}\n", 1)
        (scenario / "robots" / f"{name}.toml").write_text(profile, "utf-8")
    connection = RosConnection(ros)
    request = ChildRequest("robot", str(scenario), "hasty", "real", connection)
    missing_robot = await check_robot(request)
    assert not missing_robot.passed and "is its wrapper running?" in missing_robot.reason

    command = (sys.executable, "-m", "rise_ros.examples.simulated_robot", "--robot", "rise", "--ros", ros)
    robot = Program(tmp_path / "robot.log", *command)
    try:
        await robot.says("point_at")
        found = await check_robot(ChildRequest("robot", str(scenario), None, "real", connection))
        assert found.passed and found.value.endswith(": 2 actions offered"), found
        assert 'Speech "' not in robot.said()  # nothing is sent to it
        study = Study(str(tmp_path), "Lab", "lab", 1, 4, "scenario", "real")
        context = CheckContext(study, "P07", str(scenario), "real", ros=connection)
        heard = await run_check(StudyCheck("sound", auto="sound"), context)
        assert (heard.result, heard.question) == ("asked", "The robot said “Hallo”, and it was heard"), heard
        assert 'Speech "Hallo"' in robot.said()
    finally:
        robot.process.kill()
        robot.process.wait()
