"""A robot that knows nothing of RISE, from its profile alone: speech as a service, driving as in Nav2, an arm as in
ros2_control, a velocity that is to be repeated; and the simulated robot that plays it."""

from __future__ import annotations

import asyncio
import shutil
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from msgspec.structs import replace
from rise_adapters.ros2.doctor.robot import check_robot
from rise_adapters.ros2.mapping import read_mappings
from rise_adapters.ros2.transport import selection
from rise_adapters.ros2.transport.port import QoS
from rise_ros.examples.goal_reader import GoalReader
from rise_ros.examples.simulated_robot import RobotOnWire

from rise_engine.base.suspend import suspended_seconds
from rise_engine.cli import main
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import StopReport
from rise_engine.run.engine.clock import RealClock
from rise_engine.scenario.model import RobotProfile
from tests.ros.memory import MemoryTransport, MemoryWire
from tests.ros.zora import FOLDER, Zora, definitions, zora

pytestmark = pytest.mark.usefixtures("share")
ARM = {"shoulder": 90, "elbow": 0, "duration": 500}


@pytest.fixture
def share(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ZORA", str(FOLDER))


def changed(action: str, **carrier: Any) -> RobotProfile:
    profile = zora()
    spec = profile.actions[action]
    spec = replace(spec, carrier={**spec.carrier, **carrier})
    return replace(profile, actions={**profile.actions, action: spec})


# --- it does what the profile says ------------------------------------------------------------------------------------


def test_every_action_reaches_the_robot_as_it_was_meant() -> None:
    robot = Zora()
    robot.start("hello", "Speech", message="Hello!", volume=0.5)
    robot.start("go", "Go", place="table")
    robot.start("arm", "Arm", **ARM)
    robot.start("turn", "Turn", speed=0.5, duration=400)
    robot.start("bye", "Tts", text="Bye!")
    robot.run(5)
    assert sorted(robot.endings()) == [(name, "succeeded", "") for name in ("arm", "bye", "go", "hello", "turn")]
    begun = [line for line in robot.said if not line.startswith(("action ", "service ", "topic "))]
    assert [line for line in begun if ": " not in line] == [
        'Speech "Hello!" volume=0.5',
        'Go place="table"',
        "Arm 500 ms shoulder=90",
        "Turn speed=0.5",
        'Tts text="Bye!"',
    ]
    (pose,) = robot.wire.messages("/zora/navigate_to_pose/*/send_goal", "request")
    header, placed = pose["goal"]["pose"]["header"], pose["goal"]["pose"]["pose"]
    assert (header["frame_id"], placed["position"]) == ("lab", {"x": 1.0, "y": 2.0, "z": 0.0})
    assert header["stamp"]["sec"] > 1_700_000_000 and placed["orientation"]["z"] == pytest.approx(1)
    (arm,) = robot.wire.messages("*/follow_joint_trajectory/*/send_goal", "request")
    assert arm["goal"]["trajectory"]["joint_names"] == ["shoulder", "elbow"]
    assert arm["goal"]["trajectory"]["points"][0]["positions"] == pytest.approx([1.5708, 0], abs=1e-4)


def test_places_are_told_apart_by_all_that_is_known_of_them() -> None:
    profile = replace(zora(), places={"a": {"x": 1, "y": 0, "yaw": 0}, "b": {"x": 1, "y": 0, "yaw": 1.5, "frame": "f"}})
    transport = Zora(profile=profile).near
    mapping = read_mappings(profile, transport.fields)["Go"]
    for place in profile.places:
        sent = mapping.make_message({"place": place}, node="/n", goal="1/1", frame="base_link")
        received = transport.wire.types.complete(f"{mapping.type}_Goal", sent)
        assert GoalReader([profile.actions["Go"]], profile.places).read(received)[1] == {"place": place}


# --- a service --------------------------------------------------------------------------------------------------------

LONG = "x" * 140
"""Ten seconds of speech."""
UNSTOPPABLE = "nothing stops a call of /zora/say; the robot may go on until it answers"
SERVICE = {
    "it says that it failed": (
        ("Speech=fail",), 20, "failed", "robot-error: it went wrong on the robot (simulated fault)", ["ended failed"]
    ),
    "it refuses": (("Speech=reject",), 1, "failed", "robot-error: refused: a simulated fault", ["rejected"]),
    "it takes longer than the profile allows": (
        ("Speech=slow:3",), 20, "timed-out",
        "no-result: it should have taken 10.3 s, and /zora/say had not ended it 2 s later", ["begun"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", SERVICE)
def test_how_a_call_ends(case: str) -> None:
    faults, seconds, status, reason, did = SERVICE[case]
    robot = Zora(*faults, profile=changed("Speech", deadlines={"result": 2}))
    robot.start("a", "Speech", message=LONG)
    robot.run(seconds)
    assert [(*each[:2], each[2].partition(" (nothing offers")[0]) for each in robot.endings()] == [
        ("a", status, reason)
    ]
    assert robot.log("Speech")[-1:] == did
    if robot.log("Speech")[-1] != "begun":  # nothing of it is still open
        robot.start("b", "Speech", message="Hi")
        robot.run(9)
        assert robot.endings()[1][0] == "b" and not robot.endings()[1][2].startswith("held")


def test_a_call_that_is_stopped_ends_here_and_holds_the_service_until_its_answer() -> None:
    robot = Zora()
    robot.start("a", "Speech", message=LONG)
    robot.run(1)
    robot.robot.cancel("a")
    assert robot.endings() == [("a", "canceled", f"unstoppable: {UNSTOPPABLE}")]
    robot.start("b", "Speech", message="Hi")
    robot.run(5)
    why = "nothing stops a call, and it has not answered"
    held = f"held: /zora/say may still be doing Speech ({why}) and gets nothing else"
    assert robot.endings()[1:] == [("b", "failed", held)]
    assert robot.log("Speech") == ["arrived", "accepted", "begun"]
    assert robot.stop().unstoppable == ("zora/say (nothing stops a call of a service)",)
    robot.run(3)
    assert [each.unstoppable for each in robot.told if isinstance(each, StopReport)][-1] == ()
    assert robot.notes() == ["late: /zora/say answered a 9.3 s after its end; it changes nothing"]
    robot.start("c", "Speech", message="Hi")
    robot.run(1)
    assert robot.endings()[2:] == [("c", "succeeded", "")]
    assert robot.log("Speech").count("begun") == 2


def test_beside_what_an_engine_that_has_gone_left_nothing_begins_until_somebody_releases_it() -> None:
    """Not at another part either: a base that still turns, and an arm that now moves, were never meant together."""
    robot = Zora(connect=False)
    robot.robot.adopt([StartAction("old", "Speech", {}, 1.0)])
    robot.connect()
    robot.start("word", "Speech", message="Hi")
    robot.start("turn", "Turn", speed=0.5, duration=1000)
    robot.start("given up", "Turn", speed=0.5, duration=1000)
    robot.run(8)
    robot.robot.cancel("given up")
    assert robot.log("Speech") == robot.log("Turn") == []
    assert robot.endings() == [("given up", "canceled", "it had not been sent yet")]
    robot.robot.release_open_goals("zora/say")
    robot.run(2)
    assert sorted(each[:2] for each in robot.endings()[1:]) == [("turn", "succeeded"), ("word", "succeeded")]
    why = "an engine that has gone called it"
    assert robot.notes() == [f"released: somebody has released /zora/say; {why}"]


@pytest.mark.parametrize("unattended", ["wait", "go on"])
def test_a_robot_that_acts_by_itself_goes_on_after_a_crash_during_a_call(unattended: str) -> None:
    """Nobody is told of the call's answer any more, and there may be nobody who releases it."""
    robot = Zora(connect=False, profile=replace(zora(), options={**zora().options, "unattended": unattended}))
    robot.robot.adopt([StartAction("old", "Speech", {"message": "Hi"}, 1.0)])
    robot.connect()
    robot.run(45)
    robot.start("a", "Turn", speed=0.5, duration=1000)
    robot.run(15)
    robot.start("b", "Turn", speed=0.5, duration=1000)
    robot.run(10)
    ends = "succeeded" if unattended == "go on" else "failed"
    assert [each[:2] for each in robot.endings()] == [("a", "failed"), ("b", ends)]
    who = "the profile (`unattended`) has released /zora/say; an engine that has gone called it"
    assert robot.notes() == ([f"released: {who}"] if unattended == "go on" else [])


def test_a_call_is_not_sent_where_nobody_would_answer_it_or_two_would() -> None:
    robot = Zora(serving=False)
    robot.start("a", "Speech", message="Hi")
    robot.start("b", "Speech", message="Hi")
    robot.robot.cancel("b")
    robot.run(6)
    robot.serve()
    robot.serve()
    robot.run(2)
    robot.start("c", "Speech", message="Hi")
    robot.run(6)
    assert [(name, status, reason.partition(":")[0]) for name, status, reason in robot.endings()] == [
        ("b", "canceled", "it had not been sent yet"),
        ("a", "failed", "server-missing"),
        ("c", "failed", "two-servers"),
    ]
    assert robot.log("Speech") == []


def test_a_call_that_waited_is_not_made_after_a_standstill() -> None:
    robot = Zora(serving=False)
    robot.start("a", "Speech", message="Hi")
    robot.run(1)
    robot.serve()
    robot.loop.stand_still(60)
    assert [(name, status, reason.partition(":")[0]) for name, status, reason in robot.endings()] == [
        ("a", "failed", "standstill")
    ]
    assert robot.log("Speech") == []


def test_a_call_whose_time_is_over_for_the_kernel() -> None:
    robot = Zora("Speech=hang")
    robot.start("a", "Speech", message="Hi")
    robot.run(11.6)  # three times what was expected, and 10 s
    robot.robot.cancel("a")
    assert robot.endings() == [("a", "timed-out", f"no-result: {UNSTOPPABLE}")]


# --- a velocity -------------------------------------------------------------------------------------------------------


def test_a_topic_is_repeated_at_its_rate_and_reset_once() -> None:
    robot = Zora(profile=changed("Turn", qos={}))
    robot.start("turn", "Turn", speed=0.5, duration=1000)
    robot.run(3)
    sent = robot.wire.messages("/cmd_vel")
    assert [each["twist"]["angular"]["z"] for each in sent] == [0.5] * 10 + [0.0]
    stamps = [each["header"]["stamp"]["sec"] * 10**9 + each["header"]["stamp"]["nanosec"] for each in sent]
    assert all(earlier < later for earlier, later in pairwise(stamps))
    robot.start("again", "Turn", speed=0.5, duration=60_000)
    robot.run(0.25)
    robot.stop()
    assert [each["twist"]["angular"]["z"] for each in robot.wire.messages("/cmd_vel")[11:]] == [0.5] * 3 + [0.0]
    assert robot.log("Turn") == ["begun", "ended reset"] * 2


@pytest.mark.parametrize("suspended", [True, False])
def test_a_base_does_not_go_on_by_itself_after_a_standstill_of_the_session(
    monkeypatch: pytest.MonkeyPatch, suspended: bool
) -> None:
    """Its watchdog has stopped it meanwhile, and somebody may stand before it."""
    robot = Zora()
    robot.start("turn", "Turn", speed=0.5, duration=60_000)
    robot.run(1)
    before = len(robot.wire.messages("/cmd_vel"))
    now = robot.clock.now
    if suspended:
        before_that = suspended_seconds()
        monkeypatch.setattr("rise_adapters.ros2.robot.simple_goals.suspended_seconds", lambda: before_that + 5)
    else:
        monkeypatch.setattr(robot.clock, "now", lambda: now() + 5)
    robot.run(1)
    assert {each["twist"]["angular"]["z"] for each in robot.wire.messages("/cmd_vel")[before:]} == {0.0}
    assert [(status, reason) for _, status, reason in robot.endings()] == [
        ("failed", "standstill: the session was silent for 5.1 s, so the robot does not go on")
    ]


def test_a_base_that_died_does_not_turn_by_itself_when_it_is_back_although_a_bag_listens_too() -> None:
    robot = Zora()
    bag = MemoryTransport(robot.wire, robot.loop, "/bag")
    bag.subscribe("/cmd_vel", "geometry_msgs/msg/TwistStamped", lambda message: None)
    robot.run(1)
    robot.start("turn", "Turn", speed=0.5, duration=60_000)
    robot.run(1)
    robot.far[0].close()
    robot.run(1)
    before = len(robot.wire.messages("/cmd_vel"))
    robot.serve()
    robot.run(2)
    assert {each["twist"]["angular"]["z"] for each in robot.wire.messages("/cmd_vel")[before:]} <= {0.0}
    assert robot.endings() == [("turn", "lost", "server-gone: the listener of /cmd_vel went away during the action")]
    assert robot.log("Turn").count("begun") == 1


def test_a_base_that_is_back_after_a_stop_gets_a_reset_of_that_time() -> None:
    """A controller ignores a velocity with an old stamp."""
    robot = Zora()
    robot.wire.forget("/zora0")
    robot.run(1)
    robot.stop()
    back = time.time_ns()
    robot.wire.heal("/zora0")
    robot.run(3)
    stamp = robot.wire.messages("/cmd_vel")[-1]["header"]["stamp"]
    assert stamp["sec"] * 10**9 + stamp["nanosec"] >= back


# --- what goes wrong on request ---------------------------------------------------------------------------------------

FAULTS = {
    # what goes wrong; when it is cancelled; how it ends for the engine; what the robot really does
    "reject": (None, "failed", "arrived rejected"),
    "slow-accept:1": (None, "succeeded", "arrived accepted begun ended succeeded"),
    "slow-accept:3": (None, "timed-out", "arrived accepted begun cancel-asked ended canceled"),
    "slow-reject:1": (None, "failed", "arrived rejected"),
    "lost-accept": (None, "succeeded", "arrived accepted begun ended succeeded"),
    "late-begin:2": (1, "canceled", "arrived accepted cancel-asked ended canceled"),
    "refuse-cancel": (1, "succeeded", "arrived accepted begun cancel-asked ended succeeded"),
    "ignore-cancel": (1, "succeeded", "arrived accepted begun cancel-asked ended succeeded"),
    "slow-cancel:2": (1, "canceled", "arrived accepted begun cancel-asked ended canceled"),
    "die-on-goal:1": (None, "lost", "arrived"),
    "die-on-goal": (None, "lost", "arrived"),
    "die-on-cancel:1": (1, "lost", "arrived accepted begun cancel-asked ended vanished"),
    "fail": (None, "failed", "arrived accepted begun ended failed"),
    "abort": (None, "failed", "arrived accepted begun ended failed"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_the_robot_does_wrong_as_it_is_asked_to_and_writes_down_what_it_does(fault: str) -> None:
    cancel, status, did = FAULTS[fault]
    robot = Zora(f"Go={fault}@1", profile=changed("Go", deadlines={"acceptance": 2}))
    robot.start("go", "Go", place="dock")
    if cancel is not None:
        robot.run(cancel)
        robot.robot.cancel("go")
    robot.run(8)
    assert [each[:2] for each in robot.endings()] == [("go", status)]
    heard = [each for each, before in zip(robot.log("Go"), ["", *robot.log("Go")], strict=False)
             if (each, before) != ("cancel-asked",) * 2]  # fmt: skip  # it is asked again
    assert " ".join(heard) == did


def test_a_robot_that_becomes_inactive_is_not_sent_anything_and_comes_back() -> None:
    robot = Zora("inactive@2-12")
    robot.run(3)
    robot.start("a", "Go", place="dock")
    robot.start("b", "Speech", message="Hi")  # of a service's node nothing is known: it refuses
    robot.run(8)
    robot.run(3)
    robot.start("c", "Go", place="dock")
    robot.run(4)
    assert [(name, status, reason.partition(":")[0]) for name, status, reason in robot.endings()] == [
        ("a", "failed", "inactive"),
        ("b", "failed", "robot-error"),
        ("c", "succeeded", ""),
    ]
    assert robot.log("Go") == ["arrived", "accepted", "begun", "ended succeeded"]


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("Turn=hang", "nobody answers on a topic (/cmd_vel)"),
        ("Speech=refuse-cancel", "nobody stops a call of a service (/zora/say)"),
        ("Go=slow-accept", "`slow-accept` needs seconds, as in slow-accept:2"),
        ("Go=refuse-cancel:2", "only `slow`, `slow-accept`"),
        ("Go=ignore-cansel", "did you mean 'ignore-cancel'?"),
    ],
)
def test_a_fault_that_cannot_be(fault: str, said: str) -> None:
    with pytest.raises(ValueError, match="fault") as caught:
        Zora(fault)
    assert said in str(caught.value)


# --- what is wrong with a profile -------------------------------------------------------------------------------------

WRONG = {
    "unstoppable = true ": "# ",
    "goal.pose": "goal.pos",
    "{elbow:rad}": "{elbow:m}",
    "action/Tts": "action/Tss",
    "angular.z": "angular.zz",
}


def test_check_says_everything_at_once_with_its_place_in_every_mode(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # With rclpy, the robot's types would have to be built; without, they are read from the folder of its profile.
    monkeypatch.setattr(selection, "rclpy_missing", lambda: "not in this test")
    study = tmp_path / "zora"
    shutil.copytree(FOLDER, study)
    profile = study / "robots" / "zora.toml"
    text = profile.read_text("utf-8")
    for right, wrong in WRONG.items():
        text = text.replace(right, wrong)
    profile.write_text(text, "utf-8")
    for mode, of_types in (("real", "error"), ("debug", "warning")):
        ran = CliRunner().invoke(main, ["check", str(study), "--mode", mode])
        said = ran.stdout
        found = [line.split(" ")[:2] for line in said.splitlines() if line.startswith("robots/zora.toml")]
        assert found == [
            ["robots/zora.toml:15:1:", "warning"],
            ["robots/zora.toml:27:1:", of_types],
            ["robots/zora.toml:39:6:", "error"],
            ["robots/zora.toml:57:44:", "error"],
            ["robots/zora.toml:69:83:", "error"],
        ], said
        assert ran.exit_code == 1


# --- the doctor -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("joints", "frames", "problems"),
    [
        (["shoulder", "elbow"], ["map", "lab", "base_link"], []),
        (["shouldr", "elbow"], ["map", "lab", "base_link"], ["Arm: the robot has no joint `shoulder`", "shouldr"]),
        (["shoulder", "elbow"], ["map", "labb", "base_link"], ["Go: the robot has no frame `lab`", "labb"]),
        ([], [], []),
    ],
)  # fmt: skip
async def test_the_doctor_compares_joints_and_frames(joints: list[str], frames: list[str], problems: list[str]) -> None:
    loop = asyncio.get_running_loop()
    wire = MemoryWire(definitions())
    far = MemoryTransport(wire, loop, "/zora")
    robot = RobotOnWire(far, zora(), RealClock(loop), lambda line: None)
    transforms = [{"header": {"frame_id": "map"}, "child_frame_id": each} for each in frames]
    if joints:
        static = far.publisher("/tf_static", "tf2_msgs/msg/TFMessage", QoS(depth=1, latched=True))
        static.publish({"transforms": transforms})
        states = far.publisher("/joint_states", "sensor_msgs/msg/JointState")
        loop.call_later(0.2, states.publish, {"name": joints})
    near = MemoryTransport(wire, loop, "/doctor")
    found = await check_robot(near, zora(), 2.0)
    robot.close()
    wanted = ["; did you mean `".join(problems) + "`?"] if problems else []
    assert [each.sentence for each in found if each.level == "problem"] == wanted
    notes = [each.sentence for each in found if each.level == "note"]
    assert [each.startswith("nothing was heard on") for each in notes] == ([] if joints else [True, True])
    same = [each.sentence for each in found if each.sentence.startswith("the ")]
    assert len(same) == (0 if not joints else 1 if problems else 2)
