"""The checks `robot` and `sound` of a study, with a robot that is a process on the wire."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from rise_engine.checks import CheckContext, run_check
from rise_engine.study.model import Study, StudyCheck
from tests.engine.processes import folder
from tests.patience import PATIENCE
from tests.ros.contract.peers import environment, missing
from tests.ros.session_node_bench import until

pytestmark = [pytest.mark.dds, pytest.mark.slow]

TRANSPORTS = [kind for kind in ("dds", "rclpy") if not missing(kind)]


@contextmanager
def robot_process(ros: str, log: Path) -> Iterator[None]:
    """A robot that writes down what it does."""
    command = [sys.executable, "-m", "rise_ros.examples.simulated_robot", "--robot", "rise", "--ros", ros]
    with log.open("wb") as file:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=file, stderr=subprocess.STDOUT)
    try:
        yield
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize("ros", TRANSPORTS)
async def test_a_robot_on_the_wire(ros: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in environment().items():
        monkeypatch.setenv(name, value)
    scenario = folder(tmp_path / "scenario", 'robot = "rise"\nmode = "real"\nlanguage = "de"\n')
    study = Study(str(tmp_path), "Lab", "lab", 1, 4, "scenario", "real")
    context = CheckContext(study, "P07", str(scenario), "real")
    robot, sound = StudyCheck("robot", auto="robot"), StudyCheck("sound", auto="sound")

    missing_robot = await run_check(robot, context)
    assert missing_robot.result == "failed" and "is its wrapper running?" in missing_robot.reason

    log = tmp_path / "robot.log"
    with robot_process(ros, log):
        await until(lambda: b"point_at" in log.read_bytes(), PATIENCE)
        found = await run_check(robot, context)
        assert found.result == "passed" and found.value.endswith(": 2 actions offered"), found
        assert b'Speech "' not in log.read_bytes()  # nothing is sent to it
        heard = await run_check(sound, context)
        assert (heard.result, heard.question) == ("asked", "The robot said “Hallo”, and it was heard")
        assert b'Speech "Hallo"' in log.read_bytes()
