"""The loop of the paper's figure 8 as a lab runs it: a session, a robot and two nodes, a process each, on the wire."""

from __future__ import annotations

import json
import re
import shutil
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from rise_adapters.ros2.transport.selection import open_transport

from tests.patience import PATIENCE
from tests.ros.contract.peers import environment, missing
from tests.ros.model_server import ModelServer
from tests.ros.programs import Program
from tests.ros.session_node_bench import until
from tests.ros.zora import FOLDER as ZORA

pytestmark = pytest.mark.dds

LAB = Path(__file__).parents[2] / "scenarios" / "lab_opening"
TRANSPORTS = [kind for kind in ("dds", "rclpy") if not missing(kind)]
Start = Callable[..., Program]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    programs: list[Program] = []

    def begin(name: str, *command: str, **more: str) -> Program:
        programs.append(Program(tmp_path / f"{name}.log", sys.executable, "-m", *command, **more))
        return programs[-1]

    yield begin
    for program in programs:
        if program.process.poll() is None:
            program.process.kill()
            program.process.wait()


def node(start: Start, name: str, *options: str) -> Program:
    return start(name, f"rise_ros.examples.{name}", *options)


@pytest.mark.slow
@pytest.mark.parametrize("ros", TRANSPORTS)
async def test_the_loop_of_figure_8_in_processes(
    ros: str, start: Start, tmp_path: Path, model_server: ModelServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    model_server.answer = "There are three of us."
    robot = node(start, "simulated_robot", "--robot", "rise", "--ros", ros, "--speed", "5")
    session = start(
        "session", "rise_engine", "serve", str(LAB), "--robot", "rise", "--mode", "real", "--ros", ros,
        "--rule", "Conversation", "--new", RISE_SESSIONS=str(tmp_path / "sessions"),
    )  # fmt: skip
    ears = node(
        start, "keyword_spotter", "--ros", ros, "--otherwise", "/H_question", "--keyword", "kitchen=/H_kitchen",
        "--ros-args", "-r", "speech:=/lab/speech",
    )  # fmt: skip
    answers = node(
        start, "answer_node", "--ros", ros, "--rule", "Conversation", "--state", "Thinking", "--act", "R_Answer",
        "--base-url", model_server.url,
    )  # fmt: skip
    await session.says("serving lab-opening")
    for program in (robot, ears, answers):
        await program.says(r"point_at|listening to /lab/speech|answers when Conversation enters Thinking")

    for name, value in environment().items():
        monkeypatch.setenv(name, value)
    transport = await open_transport(ros, node="speaker")
    try:
        mouth = transport.publisher("/lab/speech", "std_msgs/msg/String")
        await until(mouth.count_subscribers, PATIENCE)
        mouth.publish({"data": "How many robots do you have?"})
        await robot.says(r'Speech "There are three of us\.": done')
        await answers.says(r"R_Answer succeeded")
        assert len(model_server.requests) == 1
        mouth.publish({"data": "What is in the kitchen?"})
        await robot.says(r'Speech "Over there is the kitchen.*: done')
    finally:
        transport.close()

    assert [program.end() for program in (ears, answers)] == [0, 0]
    assert session.end(signal.SIGTERM) == 0, "while the robot can still tell how its actions ended"
    assert robot.end() == 0
    for program in (robot, ears, answers, session):
        assert "Traceback" not in program.said()


@pytest.mark.slow
@pytest.mark.skipif("dds" not in TRANSPORTS, reason="its definitions are those of a folder, which rclpy does not read")
async def test_a_robot_that_knows_nothing_of_rise_plays_a_tour(start: Start, tmp_path: Path) -> None:
    """A service, Nav2's and ros2_control's actions, a result with decimals, a velocity: from a profile alone."""
    study, log = tmp_path / "zora", tmp_path / "did.jsonl"
    shutil.copytree(ZORA, study)
    profile = study / "robots" / "zora.toml"
    profile.write_text(profile.read_text("utf-8").replace("seconds = 3", "seconds = 0.3"), "utf-8")
    robot = start(
        "robot", "rise_ros.examples.simulated_robot", "--config", str(study), "--ros", "dds", "--log",
        str(log), ZORA=str(study),
    )  # fmt: skip
    await robot.says("topic /cmd_vel")
    session = start(
        "session", "rise_engine", "run", str(study), "--act", "Tour", "--ros", "dds", "--strict", ZORA=str(study)
    )
    assert session.process.wait(PATIENCE) == 0, session.said() + robot.said()
    did = [json.loads(line) for line in log.read_text("utf-8").splitlines()]
    assert [(each["action"], each.get("how")) for each in did if each["event"] == "ended"] == [
        ("Speech", "succeeded"), ("Go", "succeeded"), ("Arm", "succeeded"), ("Turn", "reset"), ("Tts", "succeeded"),
    ]  # fmt: skip
    assert re.search('Go place="table"', robot.said())
    assert robot.end() == 0 and "Traceback" not in robot.said()


@pytest.mark.slow
@pytest.mark.parametrize("ros", TRANSPORTS)
async def test_what_stands_in_the_way_is_said_in_sentences(ros: str, start: Start) -> None:
    for name, options, says in (
        ("simulated_robot", ("--robot", "peper"), "simulated_robot: .*did you mean `pepper`"),
        ("simulated_robot", ("--robot", "rise", "--fault", "Speech=break"), "simulated_robot: the fault"),
        ("simulated_robot", ("--robot", "generic"), "simulated_robot: robot generic: .*has no `carrier`"),
        ("keyword_spotter", ("--topic", "what is that?"), "keyword_spotter: "),
        ("answer_node", ("--rule", "R", "--state", "S", "--base-url", "file:///x"), "answer_node: --base-url is an"),
    ):
        program = node(start, name, "--ros", ros, *options)
        assert program.process.wait(PATIENCE) == 1, program.said()
        assert re.search(says, program.said()), program.said()
        assert "Traceback" not in program.said()


@pytest.mark.slow
def test_help_needs_no_ros(start: Start) -> None:
    for name in ("simulated_robot", "keyword_spotter", "gaze_trigger", "answer_node"):
        program = node(start, name, "--help")
        assert program.process.wait(PATIENCE) == 0
        assert f"usage: {name}" in program.said()


@pytest.mark.slow
@pytest.mark.parametrize("ros", TRANSPORTS)
async def test_a_second_session_in_the_domain_needs_names_of_its_own(ros: str, start: Start, tmp_path: Path) -> None:
    """E5, between processes. The one that was killed is in nobody's way, though the network still shows it."""

    def session(name: str, *more: str) -> Program:
        return start(
            name, "rise_engine", "serve", str(LAB), "--mode", "debug", "--ros", ros, "--new", "--name", name, *more,
            RISE_SESSIONS=str(tmp_path / "sessions"), RISE_RUNTIME=str(tmp_path / "run"),
        )  # fmt: skip

    first = session("first")
    await first.says("serving first")
    second = session("second")
    assert second.process.wait(PATIENCE) == 1
    assert re.search(r"another session is on ROS under the same names .*“Opening of the laboratory”.*", second.said())
    assert re.search(rf"process {first.process.pid}\n.*--ros-args -r __ns:=/lab2", second.said())
    third = session("third", "--ros-args", "-r", "__ns:=/lab2")
    await third.says("serving third")
    first.process.kill()
    first.process.wait(PATIENCE)
    fourth = session("fourth")
    await fourth.says("serving fourth")
    for program in (third, fourth):
        assert program.end(signal.SIGTERM) == 0
        assert "Traceback" not in program.said()
