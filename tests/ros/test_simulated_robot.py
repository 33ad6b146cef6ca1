"""The simulated robot on a wire: what arrives is what was meant, and what goes wrong is what was asked for."""

from __future__ import annotations

import asyncio
import os
from pathlib import Path
from typing import Any

import pytest
from rise_adapters.ros2.actions.client import (
    ABORTED,
    ALL_GOALS,
    CANCEL_NONE,
    CANCELED,
    SUCCEEDED,
    ActionClient,
    CancelResponse,
)
from rise_adapters.ros2.mapping import read_mappings, with_all_carriers
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.transport.port import Message
from rise_ros.examples.goal_reader import GoalReader
from rise_ros.examples.run_node import NodeError
from rise_ros.examples.simulated_robot import RobotOnWire, find_robot

from rise_engine.kernel.inputs import Submit
from rise_engine.run.engine.clock import RealClock, VirtualClock
from rise_engine.run.engine.engine import Engine
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import RobotProfile
from rise_engine.scenario.parameters import convert_parameter
from tests.ros.memory import ClockLoop, MemoryTransport, MemoryWire
from tests.ros.session_node_bench import until

SCENARIOS = Path(__file__).parents[2] / "scenarios"
ROBOTS = ("rise", "floka", "nao", "pepper", "ros4hri")
every_robot = pytest.mark.parametrize("robot", ROBOTS)

CALLS: dict[str, list[dict[str, Any]]] = {
    "Speech": [{"message": "Hello {you}!"}, {"message": "Hm", "rate": 0.8, "language": "de-DE", "volume": 0.5}],
    "LookAt": [{"pointx": 1.5, "pointy": -0.25, "pointz": 0}, {"pointx": 1, "pointy": 2, "pointz": 3, "roll": 0.5}],
    "Emotion": [{"value": "happy"}, {"value": "fear", "duration": 1500}, {"value": "neutral"}],
    "Animation": [{"value": "head_nod", "repetitions": 3, "duration": 500}],
    "PointAt": [{"pointx": 1, "pointy": 2, "pointz": -3, "hand": "left", "duration": 800}],
    "Gaze": [{"value": "reset"}],
    "ShowOnTablet": [{"text": "Hello", "image": "a.png"}],
}


class Rig:
    """A simulated robot in virtual time, and a client of its speech."""

    def __init__(self, robot: str = "rise", **more: Any) -> None:
        self.clock = VirtualClock()
        self.wire = MemoryWire()
        self.said: list[str] = []
        self.profile = find_robot(robot, None)
        self.loop = loop = ClockLoop(self.clock)
        self.robot = RobotOnWire(
            MemoryTransport(self.wire, loop, "/robot"), self.profile, self.clock, self.said.append, **more
        )
        self.said.clear()
        self.transport = MemoryTransport(self.wire, loop, "/engine")
        self.mappings = read_mappings(self.profile, self.transport.fields)
        self.clients: dict[str, ActionClient] = {}
        self.feedback: list[Message] = []

    def client(self, action: str) -> ActionClient:
        if action not in self.clients:
            carrier = self.mappings[action]
            made = self.clients[action] = ActionClient(self.transport, carrier.name, carrier.type)
            made.on_feedback = lambda id, message: self.feedback.append(message)
        return self.clients[action]

    def send(self, action: str, **parameters: Any) -> Sent:
        client = self.client(action)
        goal = Sent()
        message = self.mappings[action].make_message(parameters, node="/engine", goal="1/1", frame="base_link")

        def answered(accepted: bool) -> None:
            goal.accepted = accepted
            if accepted:
                client.get_result(goal.id, goal.ended)

        client.send(goal.id, message, answered)
        return goal

    def run(self, seconds: float) -> None:
        self.loop.run_until(self.clock.now() + seconds)


class Sent:
    def __init__(self) -> None:
        self.id = os.urandom(16)
        self.accepted: bool | None = None
        self.status: int | None = None
        self.result: Message = {}

    def ended(self, status: int, result: Message) -> None:
        self.status, self.result = status, result


# --- what arrives -----------------------------------------------------------------------------------------------------


@every_robot
def test_a_goal_is_read_back_as_it_was_meant(robot: str) -> None:
    profile = with_all_carriers(find_robot(robot, None))
    transport = MemoryTransport(MemoryWire(), ClockLoop(VirtualClock()), "/engine")
    mappings = read_mappings(profile, transport.fields)
    assert len(mappings) > 4
    for name, carrier in mappings.items():
        shared = [profile.actions[other] for other, its in mappings.items() if its.name == carrier.name]
        spec = profile.actions[name]
        for call in CALLS.get(name, []):
            meant = {each: convert_parameter(spec.parameters[each], value) for each, value in call.items()}
            message = carrier.make_message(meant, node="/engine", goal="1/1", frame="base_link")
            type = carrier.type if carrier.kind == "topic" else f"{carrier.type}_Goal"
            read, parameters = GoalReader(shared, profile.places).read(transport.wire.types.complete(type, message))
            assert read.name == name
            expected = {each: value for each, value in meant.items() if each not in carrier.unused_parameters}
            if carrier.kind == "topic":  # the time is kept by who sends
                expected.pop("duration", None)
            assert {each: value for each, value in expected.items() if parameters.get(each) != value} == {}


def test_what_the_robot_says_in_the_terminal() -> None:
    rig = Rig()
    rig.send("Speech", message="Hello!")
    rig.send("LookAt", pointx=1.2, pointy=0, pointz=0.4, duration=500)
    rig.run(10)
    assert rig.said == [
        'Speech "Hello!"',
        'LookAt (1.2, 0, 0.4) 500 ms frame="base_link"',
        'LookAt (1.2, 0, 0.4) 500 ms frame="base_link": done, 0.5 s',
        'Speech "Hello!": done, 0.7 s',
    ]  # fmt: skip


def test_a_topic_is_shown_too() -> None:
    rig = Rig("ros4hri")
    carrier = rig.mappings["Emotion"]
    message = carrier.make_message({"value": "fear"}, node="/engine", goal="1/1", frame="base_link")
    rig.transport.publisher(carrier.name, carrier.type).publish(message)
    rig.run(1)
    assert rig.said == ["Emotion fear"]


# --- time, and what happens at once -----------------------------------------------------------------------------------


def test_believable_time_and_progress() -> None:
    rig = Rig()
    goal = rig.send("Speech", message="x" * 14 * 4)
    rig.run(4.25)
    assert (goal.accepted, goal.status) == (True, None)
    rig.run(0.1)
    assert (goal.status, goal.result) == (SUCCEEDED, {"reason": ""})
    told = [each["progress"] for each in rig.feedback]
    assert told == sorted(told)
    assert len(told) > 10
    assert 0 <= told[0] < 0.1 < 0.9 < told[-1] <= 1


def test_one_goal_of_an_action_at_a_time_and_two_actions_at_once() -> None:
    rig = Rig()
    first, second = rig.send("Speech", message="x" * 14), rig.send("Speech", message="x" * 14)
    other = rig.send("Emotion", value="sad", duration=1000)
    rig.run(1.35)
    assert [goal.status for goal in (first, second, other)] == [SUCCEEDED, None, SUCCEEDED]
    rig.run(1.35)
    assert second.status == SUCCEEDED


def test_a_busy_robot_may_refuse() -> None:
    rig = Rig(busy="reject")
    first, second = rig.send("Speech", message="x" * 14), rig.send("Speech", message="y")
    rig.run(0.1)
    assert (first.accepted, second.accepted) == (True, False)
    assert rig.said[-1] == 'Speech "y": rejected, the robot is busy'
    rig.run(2)
    assert rig.send("Speech", message="z") and rig.said[-1].endswith("done, 1.3 s")


def test_cancel_what_runs_and_what_waits() -> None:
    rig = Rig()
    first, second = rig.send("Speech", message="x" * 140), rig.send("Speech", message="y" * 140)
    rig.run(0.5)
    answers: list[CancelResponse] = []
    rig.client("Speech").cancel(second.id, answers.append)
    rig.run(0.01)
    assert (answers[0].code, answers[0].goals, second.status) == (CANCEL_NONE, (second.id,), CANCELED)
    rig.client("Speech").cancel(ALL_GOALS, answers.append)
    rig.run(0.1)
    assert (answers[1].goals, first.status, first.result) == ((first.id,), CANCELED, {"reason": "canceled"})
    third = rig.send("Speech", message="z")
    rig.run(1)
    assert third.status == SUCCEEDED


# --- what goes wrong on request ---------------------------------------------------------------------------------------


def test_reject_fail_and_slow() -> None:
    rig = Rig(faults=("Speech=reject@1", "Speech=fail@2", "Speech=slow:3@3"))
    goals = []
    for _ in range(3):
        goals.append(rig.send("Speech", message="x" * 14))
        rig.run(2)
    refused, failed, slow = goals
    assert refused.accepted is False
    assert (failed.status, failed.result) == (ABORTED, {"reason": "it went wrong on the robot (simulated fault)"})
    assert slow.status is None
    rig.run(2)
    assert slow.status == SUCCEEDED


def test_an_error_code_where_the_result_has_one() -> None:
    rig = Rig("ros4hri", faults=("Speech=fail@1",))
    failed = rig.send("Speech", message="Hello")
    rig.run(3)
    assert failed.status == ABORTED
    assert (
        rig.mappings["Speech"].result_rule.failure(failed.result)
        == "it went wrong on the robot (simulated fault) (error code 255)"
    )
    fine = rig.send("Speech", message="Hello")
    rig.run(3)
    assert (fine.status, rig.mappings["Speech"].result_rule.failure(fine.result)) == (SUCCEEDED, "")


@pytest.mark.slow
def test_one_that_hangs_does_not_even_answer_a_cancel() -> None:
    rig = Rig(faults=("Speech=hang",))
    goal = rig.send("Speech", message="Hello")
    rig.run(1)
    answers: list[CancelResponse] = []
    rig.client("Speech").cancel(goal.id, answers.append)
    rig.run(3600)
    assert (goal.accepted, goal.status, answers) == (True, None, [])


def test_a_robot_that_vanishes_and_comes_back_knows_nothing() -> None:
    rig = Rig(faults=("vanish@2-5",))
    goal = rig.send("Speech", message="x" * 140)
    client = rig.client("Speech")
    rig.run(1.9)
    assert client.count_servers() == 1
    rig.run(0.2)
    assert (client.count_servers(), goal.status) == (0, None)
    rig.run(3)
    assert client.count_servers() == 1
    again = Sent()
    client.get_result(goal.id, again.ended)
    new = rig.send("Speech", message="Hello")
    rig.run(1)
    assert (goal.status, again.status, new.status) == (None, 0, SUCCEEDED)


def test_at_its_end_nobody_is_left_waiting() -> None:
    rig = Rig()
    runs, waits = rig.send("Speech", message="x" * 140), rig.send("Speech", message="y")
    rig.run(1)
    rig.robot.close()
    rig.run(1)
    assert [goal.result for goal in (runs, waits)] == [{"reason": "the simulated robot was switched off"}] * 2
    assert rig.client("Speech").count_servers() == 0
    assert rig.clock.next_at is None


# --- which robot ------------------------------------------------------------------------------------------------------


def test_a_robot_by_its_file_and_by_a_scenario(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('title = "Mine"\ndriver = "ros2"\n[options]\nwrapper = "mine"\n[actions.Speech]\n', "utf-8")
    assert find_robot(str(file), None).title == "Mine"
    assert find_robot(None, SCENARIOS / "greeting").name == "floka"
    assert find_robot("rise", SCENARIOS / "greeting" / "scenario.toml").name == "rise"


@pytest.mark.parametrize(
    ("robot", "says"), [("peper", "did you mean `pepper`"), ("nowhere.toml", "cannot be read"), (None, "which robot")]
)
def test_a_robot_that_does_not_exist(robot: str | None, says: str) -> None:
    with pytest.raises(NodeError, match=says):
        find_robot(robot, None)


# --- a whole study ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["rise", "floka"])
async def test_the_greeting_runs_over_the_wire(robot: str) -> None:
    loaded = load(SCENARIOS / "greeting", robot=robot, mode="real")
    assert loaded.scenario is not None, loaded.diagnostics
    profile: RobotProfile = loaded.scenario.robot
    loop = asyncio.get_running_loop()
    clock = RealClock(loop, 10.0)
    wire = MemoryWire()
    said: list[str] = []
    robot_node = RobotOnWire(MemoryTransport(wire, loop, "/robot"), profile, clock, said.append)
    transport = MemoryTransport(wire, loop, "/rise")
    engine = Engine(
        loaded.scenario, Ros2Robot(profile, clock, transport, read_mappings(profile, transport.fields)), clock, 1
    )
    engine.start()
    try:
        for function, behavior in (
            ("startInteractionRule", "Greeting"),
            ("assignValue", "person_near = true"),
            ("assignValue", "H_speech = 'Hello robot'"),
        ):
            engine.post(Submit(function=function, behavior=behavior, source="test"))
        await until(lambda: [line for line in said if "pleased to meet you" in line and "done" in line], 30)
        assert 'Speech "My name is Floka, and I am a robot. Well, the head of one.": done, 4.4 s' in said
    finally:
        engine.end("the test is over")
        engine.end_now("the test is over")
        robot_node.close()
