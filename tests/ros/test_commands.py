"""ROS on the command line: what is refused, and what `doctor` and `check` say."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

from rise_engine.cli.program import split_ros_args
from tests.forked import run_engine
from tests.ros.contract.peers import environment
from tests.ros.programs import LOADS

pytestmark = pytest.mark.slow

ROOT = Path(__file__).parents[2]
GREETING = str(ROOT / "scenarios" / "greeting")


def rise_engine(*arguments: str, **more: str) -> subprocess.CompletedProcess[str]:
    return run_engine(*arguments, loads=LOADS, env={**environment(), **more})


@pytest.mark.parametrize(
    ("given", "ours", "theirs"),
    [
        ("serve D", "serve D", ""),
        ("serve D --ros-args -r a:=b", "serve D", "-r a:=b"),
        ("serve --ros-args -r __ns:=/lab -- D --ros dds", "serve D --ros dds", "-r __ns:=/lab"),
        ("run D -- X", "run D -- X", ""),
        ("run --ros-args -r a:=b --ros-args -p x:=1 -- D", "run D", "-r a:=b -p x:=1"),
        ("run D --ros-args", "run D", ""),
    ],
)
def test_what_stands_after_ros_args_is_for_ros(given: str, ours: str, theirs: str) -> None:
    assert split_ros_args(given.split()) == (ours.split(), tuple(theirs.split()))


def test_a_real_robot_without_ros_is_refused_with_what_to_do(tmp_path: Path) -> None:
    for command in ("run", "serve"):
        said = rise_engine(command, GREETING, "--mode", "real", "--ros", "off", RISE_SESSIONS=str(tmp_path / "s"))
        assert said.returncode == 1
        assert "ROS 2" in said.stderr and "--mode debug" in said.stderr and "Traceback" not in said.stderr
    assert not (tmp_path / "s").exists() or not any((tmp_path / "s").iterdir()), "no session was begun"


def test_virtual_time_has_no_real_robot() -> None:
    said = rise_engine("run", GREETING, "--mode", "real", "--speed", "max")
    assert said.returncode == 1 and "real time" in said.stderr
    said = rise_engine("run", GREETING, "--ros", "dds", "--speed", "max")
    assert said.returncode == 2 and "--ros dds" in said.stderr


def test_what_ros_refuses_is_said(tmp_path: Path) -> None:
    pytest.importorskip("cyclonedds")
    said = rise_engine("run", GREETING, "--mode", "real", "--ros", "dds", "--ros-args", "-r", "nonsense")
    assert said.returncode == 1 and "nonsense" in said.stderr and "Traceback" not in said.stderr


def test_a_robot_does_nothing_wrong_on_request() -> None:
    pytest.importorskip("cyclonedds")
    said = rise_engine("run", GREETING, "--mode", "real", "--ros", "dds", "--fault", "Speech=fail")
    assert said.returncode == 2 and "simulated" in said.stderr


def test_doctor_looks_for_the_robot_of_a_scenario() -> None:
    pytest.importorskip("cyclonedds")
    said = rise_engine("doctor", GREETING, "--ros", "dds", "--seconds", "0.2", "--json")
    found = json.loads(said.stdout)
    assert said.returncode == 1 and found["problems"] == 1
    assert any("nothing of floka is there" in finding["sentence"] for finding in found["findings"])
    assert rise_engine("doctor", "--robot", "flokka").returncode == 2


@pytest.mark.parametrize("mode", ["debug", "real"])
def test_check_reads_the_carriers_in_every_mode(mode: str, tmp_path: Path) -> None:
    (tmp_path / "robots").mkdir()
    (tmp_path / "scenario.toml").write_text('robot = "mine"\n')
    (tmp_path / "robots" / "mine.toml").write_text(
        'driver = "ros2"\n[actions.Speech]\n'
        'carrier = { action = "say", type = "rise_interfaces/action/Speech", goal = { mesage = "{message}" } }\n'
    )
    said = rise_engine("check", str(tmp_path), "--mode", mode)
    assert said.returncode == 1
    assert "robots/mine.toml" in said.stdout and "mesage" in said.stdout and "message" in said.stdout
