"""What `rise-engine doctor` finds, without any ROS: environments, and robots on a wire in memory."""

from __future__ import annotations

import asyncio
import json
import os
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from rise_adapters.ros2.actions.client import ActionClient
from rise_adapters.ros2.actions.server import ActionServer
from rise_adapters.ros2.doctor import DoctorFinding, as_json, as_text, computer, examine, exit_status
from rise_adapters.ros2.doctor import robot as doctor_robot
from rise_adapters.ros2.doctor.computer import check_network
from rise_adapters.ros2.transport import selection
from rise_adapters.ros2.transport.port import STATUS, PortError, QoS

from rise_engine.base.errors import AdapterError
from rise_engine.run.engine.clock import RealClock
from rise_engine.scenario.model import RobotProfile
from rise_engine.scenario.reading.action_declarations import core_actions
from tests.ros.memory import MemoryTransport, MemoryWire
from tests.ros.test_lifecycle import LifecycleNode

SPEECH: dict[str, Any] = {
    "action": "rise/robot/speech",
    "type": "test_interfaces/action/Say",
    "goal": {"text": "{message}"},
}
LED: dict[str, Any] = {"topic": "rise/robot/led", "type": "test_interfaces/msg/Led", "message": {"name": "{value}"}}
TYPES = {
    "test_interfaces/action/Say_Goal": {"text": "string"},
    "test_interfaces/action/Say_Result": {"reason": "string"},
    "test_interfaces/action/Say_Feedback": {},
    "test_interfaces/msg/Led": {"name": "string"},
}


def profile(driver: str = "ros2", **carriers: Any) -> RobotProfile:
    specs = core_actions()
    actions = {name: replace(specs[name], carrier=carrier) for name, carrier in carriers.items()}
    return RobotProfile("tin", "Tin", driver, actions)


def said(findings: list[DoctorFinding], level: str) -> str:
    return "\n".join(f"{finding.sentence} {finding.remedy}" for finding in findings if finding.level == level)


@pytest.fixture
def only(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Say which transports are here."""

    def says(rclpy: str = "rclpy is not here", dds: str = "") -> None:
        monkeypatch.setattr(selection, "why_unavailable", lambda: {"rclpy": rclpy, "dds": dds})

    says()
    return says


def workspace(place: Path, *, rmw: tuple[str, ...] = (), interfaces: dict[str, str] | None = None) -> dict[str, str]:
    """A sourced installation, as it looks from the environment."""
    index = place / "share/ament_index/resource_index/rmw_typesupport"
    index.mkdir(parents=True)
    for name in rmw:
        (index / name).touch()
    for name, value in (interfaces or {}).items():
        file = place / "share" / f"{name}.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps({"type_hashes": [{"type_name": name, "hash_string": value}]}), "utf-8")
    return {"ROS_DISTRO": "jazzy", "AMENT_PREFIX_PATH": str(place)}


# --- the machine --------------------------------------------------------------------------------------------------


def test_without_any_ros(tmp_path: Path, only: Any) -> None:
    findings = list(computer.check_installation({}, installed=tmp_path))
    assert [finding.level for finding in findings] == ["note", "note"] and "not needed" in findings[0].sentence
    assert exit_status(findings) == 0
    assert said(list(computer.check_installation({}, wanted=True, installed=tmp_path)), "problem").startswith(
        "rclpy is not here"
    )


def test_ros_that_is_installed_but_not_sourced(tmp_path: Path, only: Any) -> None:
    (tmp_path / "jazzy").mkdir()
    (tmp_path / "jazzy/setup.bash").touch()
    finding = next(iter(computer.check_installation({}, wanted=True, installed=tmp_path)))
    assert finding.level == "warning" and finding.remedy == f"source {tmp_path}/jazzy/setup.bash"


def test_ros_that_is_sourced(tmp_path: Path, only: Any) -> None:
    only(rclpy="")
    environment = workspace(tmp_path)
    findings = list(computer.check_installation(environment, wanted=True))
    assert {finding.level for finding in findings} == {"ok"} and "Jazzy" in findings[0].sentence
    findings = list(computer.check_installation({**environment, "ROS_DISTRO": "humble"}))
    assert "made for" in said(findings, "warning")
    findings = list(computer.check_installation({"ROS_DISTRO": "jazzy"}))
    assert "only in part" in said(findings, "warning")
    findings = list(
        computer.check_installation({**environment, "AMENT_PREFIX_PATH": f"{tmp_path}{os.pathsep}/no/such"})
    )
    assert "/no/such" in said(findings, "warning")


def test_the_middleware(tmp_path: Path) -> None:
    environment = workspace(tmp_path, rmw=("rmw_fastrtps_cpp", "rmw_cyclonedds_cpp"))
    assert computer.installed_rmw(environment) == ["rmw_cyclonedds_cpp", "rmw_fastrtps_cpp"]
    assert "use rmw_fastrtps_cpp" in said(list(computer.check_middleware(environment, "rclpy")), "note")
    assert "topics at best" in said(list(computer.check_middleware(environment, "dds")), "warning")
    cyclone = {**environment, "RMW_IMPLEMENTATION": "rmw_cyclonedds_cpp"}
    assert {finding.level for finding in computer.check_middleware(cyclone, "dds")} == {"ok"}
    zenoh = {**environment, "RMW_IMPLEMENTATION": "rmw_zenoh_cpp"}
    assert "apt install ros-jazzy-rmw-zenoh-cpp" in said(list(computer.check_middleware(zenoh, "rclpy")), "problem")
    assert list(computer.check_middleware({}, "dds")) == []


NETWORK = [
    # the environment; the transport; the level and words of the worst finding
    ({}, "dds", "ok", "ROS domain 0"),
    ({"ROS_DOMAIN_ID": "42"}, "dds", "ok", "ROS domain 42"),
    ({"ROS_DOMAIN_ID": "150"}, "dds", "note", "ports may be taken"),
    ({"ROS_DOMAIN_ID": "300"}, "dds", "problem", "0 to 232"),
    ({"ROS_DOMAIN_ID": "lab"}, "dds", "problem", "0 to 232"),
    ({"ROS_LOCALHOST_ONLY": "1"}, "rclpy", "warning", "whatever the discovery range says"),
    ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}, "rclpy", "note", "only programs on this machine"),
    ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "OFF"}, "rclpy", "problem", "no node is found"),
    ({"ROS_AUTOMATIC_DISCOVERY_RANGE": "local"}, "rclpy", "problem", "'local'"),
    ({"ROS_DISCOVERY_SERVER": "10.0.0.1:11811"}, "dds", "warning", "ROS_DISCOVERY_SERVER"),
    ({"ROS_DISCOVERY_SERVER": "10.0.0.1:11811"}, "rclpy", "ok", ""),
    ({"ROS_SECURITY_ENABLE": "true"}, "dds", "problem", "no security"),
    ({"FASTDDS_DEFAULT_PROFILES_FILE": "/no/such.xml"}, "rclpy", "warning", "/no/such.xml"),
    ({"CYCLONEDDS_URI": "file:///no/such.xml"}, "dds", "problem", "/no/such.xml"),
    ({"CYCLONEDDS_URI": "<General><AllowMulticast>"}, "dds", "problem", "well-formed"),
    ({"CYCLONEDDS_URI": "<General><AllowMulticast>false</AllowMulticast></General>"}, "dds", "problem", "no peers"),
    ({"CYCLONEDDS_URI": "<General><AllowMulticast>false</AllowMulticast></General>"}, "rclpy", "note", "means nothing"),
    ({"CYCLONEDDS_URI": "<General><AllowMulticast>false</AllowMulticast></General>", "ROS_STATIC_PEERS": "10.0.0.2"},
     "dds", "note", "another setting"),
    ({"CYCLONEDDS_URI": "<General><AllowMulticast>false</AllowMulticast></General>,<Discovery><Peers>"
      '<Peer address="localhost"/></Peers></Discovery>'}, "dds", "note", "another setting"),
    ({"CYCLONEDDS_URI": '<General><Interfaces><NetworkInterface name="lo"/></Interfaces></General>'}, "dds", "note",
     "loopback only"),
    ({"CYCLONEDDS_URI": '<?xml version="1.0"?><CycloneDDS xmlns="https://cdds.io/config"><Domain><General><Interfaces>'
      '<NetworkInterface name="eth0"/></Interfaces></General></Domain></CycloneDDS>'}, "dds", "note", "interface eth0"),
]  # fmt: skip


@pytest.mark.parametrize(("environment", "kind", "level", "words"), NETWORK)
def test_the_network(environment: dict[str, str], kind: Any, level: str, words: str) -> None:
    findings = list(check_network(environment, kind))
    worst = max((finding.level for finding in findings), key=["ok", "note", "warning", "problem"].index)
    assert worst == level and words in said(findings, level)


def test_a_file_of_settings(tmp_path: Path) -> None:
    file = tmp_path / "cyclone.xml"
    settings = (
        '<CycloneDDS><Domain id="any"><General><AllowMulticast>false</AllowMulticast></General></Domain></CycloneDDS>'
    )
    file.write_text(f'<?xml version="1.0" encoding="UTF-8" ?>\n{settings}', "utf-8")
    assert "no peers" in said(list(check_network({"CYCLONEDDS_URI": f"file://{file}"}, "dds")), "problem")


def test_which_transport_and_why(only: Any) -> None:
    kind, findings = computer.check_transport("auto")
    assert kind == "dds" and "rclpy is not here" in said(findings, "ok")
    only(rclpy="")
    assert computer.check_transport("auto")[0] == "rclpy" and computer.check_transport("dds")[0] == "dds"
    only(dds="it needs cyclonedds")
    kind, findings = computer.check_transport("auto")
    assert (
        kind is None and "rclpy is not here" in said(findings, "problem") and "cyclonedds" in said(findings, "problem")
    )


def test_the_interfaces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ours = {"rise_interfaces/msg/Record": "RIHS01_1", "rise_interfaces/action/DomainTask": "RIHS01_2"}
    monkeypatch.setattr(computer, "own_hashes", lambda environment: ours)
    monkeypatch.setattr(computer, "_is_importable", lambda package: False)  # also where a workspace is sourced
    assert "comes with" in said(list(computer.check_interfaces({}, "dds")), "ok")
    assert "colcon build" in said(list(computer.check_interfaces({}, "rclpy")), "problem")
    good = workspace(tmp_path / "good", interfaces=ours)
    assert "is the one of this program (2 types)" in said(list(computer.check_interfaces(good, "dds")), "ok")
    old = workspace(tmp_path / "old", interfaces={"rise_interfaces/msg/Record": "RIHS01_0"})
    problems = said(list(computer.check_interfaces(old, "dds")), "problem")
    assert "lacks action/DomainTask" in problems and "another version of msg/Record" in problems
    assert "does not find it" in said(list(computer.check_interfaces(good, "rclpy")), "problem")
    both = {**good, "AMENT_PREFIX_PATH": f"{tmp_path}/good{os.pathsep}{tmp_path}/old"}
    assert "2 times" in said(list(computer.check_interfaces(both, "dds")), "warning")
    monkeypatch.setattr(computer, "own_hashes", lambda environment: {})
    assert "cannot be checked" in said(list(computer.check_interfaces(good, "dds")), "note")


def test_our_own_hashes() -> None:
    pytest.importorskip("rosbags")
    ours = computer.own_hashes()
    assert {"rise_interfaces/action/DomainTask", "rise_interfaces/srv/GetMemory", "rise_interfaces/msg/Record"} <= set(
        ours
    )
    assert all(value.startswith("RIHS01_") for value in ours.values())


# --- the robot ----------------------------------------------------------------------------------------------------


class Lab:
    """A wire on which the doctor and some robots are."""

    def __init__(self) -> None:
        self.wire = MemoryWire(TYPES)
        self.loop = asyncio.get_running_loop()

    def node(self, name: str) -> MemoryTransport:
        return MemoryTransport(self.wire, self.loop, name)

    def speaks(self, node: str, type: str = SPEECH["type"], name: str = "/rise/robot/speech") -> ActionServer:
        clock = RealClock(self.loop)
        return ActionServer(self.node(node), name, type, lambda goal: goal.reject(), clock=clock)

    async def open(self, choice: str, arguments: Any = (), *, node: str, share: Any = ()) -> MemoryTransport:
        return self.node(f"/{node}")

    async def examined(self, robot: RobotProfile | None, seconds: float = 0.2) -> list[DoctorFinding]:
        return await examine("auto", robot, environment={}, seconds=seconds, open_transport=self.open)


async def test_a_robot_that_is_all_there(only: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(doctor_robot, "SETTLE_SECONDS", 0.05)
    lab = Lab()
    lab.speaks("/tin/mouth")
    lab.node("/tin/led").subscribe("/rise/robot/led", LED["type"], print)
    findings = await lab.examined(profile(Speech=SPEECH, Emotion=LED), 10)
    assert exit_status(findings) == 0, as_text(findings)
    assert "Speech: /rise/robot/speech is offered, as test_interfaces/action/Say" in said(findings, "ok")
    assert "Emotion: /rise/robot/led has 1 subscriber" in said(findings, "ok")
    assert "2 other nodes are seen: /tin/led, /tin/mouth" in said(findings, "ok")
    assert lab.node("/late").nodes() == ["/late", "/tin/led", "/tin/mouth"], "the doctor has gone"
    assert not lab.wire.messages("*send_goal*") and not lab.wire.messages("*cancel_goal*")


async def test_a_robot_that_is_not_there(only: Any) -> None:
    lab = Lab()
    findings = await lab.examined(profile(Speech=SPEECH, Animation=SPEECH | {"goal": {"text": "{value}"}}, Emotion=LED))
    assert exit_status(findings) == 1
    problems = said(findings, "problem")
    assert problems.startswith("nothing of tin is there: /rise/robot/speech, /rise/robot/led")
    assert "wrapper running" in problems
    assert "no other node is seen" in said(findings, "note")


async def test_a_robot_whose_node_is_not_active(only: Any) -> None:
    lab = Lab()
    lab.speaks("/tin/mouth")
    LifecycleNode(lab.wire.transports[-1])
    problems = said(await lab.examined(profile(Speech=SPEECH)), "problem")
    assert problems == "Speech: /tin/mouth is inactive activate it (ros2 lifecycle set /tin/mouth activate)"


async def test_who_else_moves_the_robot(only: Any) -> None:
    lab = Lab()
    lab.speaks("/tin/mouth")
    for node in ("/teleop", "/rise_doctor"):
        ActionClient(lab.node(node), SPEECH["action"], SPEECH["type"])
    notes = said(await lab.examined(profile(Speech=SPEECH)), "note")
    assert notes.count("may send goals") == 1
    assert "the node /teleop may send goals to /rise/robot/speech, too; the record of this session does not" in notes


@pytest.mark.parametrize(
    ("says", "level", "sentence"),
    [
        ((False,), "ok", "the emergency stop at /estop is heard, and is not pressed"),
        ((True,), "warning", "the emergency stop at /estop is pressed release it: nothing starts before that"),
        (
            (None,),
            "problem",
            "the emergency stop at /estop has said nothing yet, so whether it is pressed is not known",
        ),
        ((), "problem", "the emergency stop at /estop cannot be heard: nothing publishes it as std_msgs/msg/Bool"),
        ((False, True), "problem", "has several publishers (/button0, /button1): a message does not say who sent it"),
    ],
)
async def test_an_emergency_stop(only: Any, says: tuple[bool | None, ...], level: str, sentence: str) -> None:
    lab = Lab()
    lab.speaks("/tin/mouth")
    for number, pressed in enumerate(says):
        button = lab.node(f"/button{number}").publisher("/estop", "std_msgs/msg/Bool", STATUS)
        if pressed is not None:
            button.publish({"data": pressed})
    options = {"estop": {"topic": "/estop", "type": "std_msgs/msg/Bool", "when": {"data": True}}}
    found = await lab.examined(replace(profile(Speech=SPEECH), options=options))
    assert sentence in said(found, level), as_text(found)


async def test_a_robot_that_is_there_in_part(only: Any) -> None:
    lab = Lab()
    lab.speaks("/tin/mouth")
    findings = await lab.examined(profile(Speech=SPEECH, Emotion=LED))
    assert "Emotion: nothing listens to /rise/robot/led" in said(findings, "problem")
    lab = Lab()
    lab.node("/tin/led").subscribe("/rise/robot/led", LED["type"], print)
    findings = await lab.examined(profile(Speech=SPEECH, Emotion=LED))
    assert "Speech: nothing offers /rise/robot/speech" in said(findings, "problem")


async def test_a_robot_by_another_name(only: Any) -> None:
    lab = Lab()
    lab.node("/tin/led").subscribe("/tin/led", LED["type"], print)
    lab.speaks("/tin/mouth", name="/tin/speech")
    findings = await lab.examined(profile(Speech=SPEECH))
    assert "nothing offers /rise/robot/speech there is one of this type, by other names: /tin/speech;" in said(
        findings, "problem"
    )
    findings = await lab.examined(profile(Speech=SPEECH, Emotion=LED))
    assert "of their types there are, by other names: /tin/speech, /tin/led;" in said(findings, "problem")
    lab.node("/lab/rise").subscribe("/lab/rise/session", "std_msgs/msg/String", print)
    findings = await lab.examined(profile(Speech={"topic": "/voice/say", "type": "std_msgs/msg/String"}))
    assert "nothing listens to /voice/say is the robot's wrapper running" in said(findings, "problem")
    lab.node("/voice").subscribe("/voice/text", "std_msgs/msg/String", print)
    findings = await lab.examined(profile(Speech={"topic": "/voice/say", "type": "std_msgs/msg/String"}))
    assert "there is one of this type, by other names: /voice/text;" in said(findings, "problem")


async def test_two_robots_on_one_name(only: Any) -> None:
    lab = Lab()
    lab.speaks("/tin/mouth")
    lab.speaks("/tin/mouth")
    findings = await lab.examined(profile(Speech=SPEECH))
    assert "2 nodes offer /rise/robot/speech" in said(findings, "problem")
    assert "have the name /tin/mouth" in said(findings, "warning")


async def test_a_server_of_another_type(only: Any) -> None:
    lab = Lab()
    lab.speaks("/tin/mouth", "other_interfaces/action/Talk")
    findings = await lab.examined(profile(Speech=SPEECH))
    assert "is offered as other_interfaces/action/Talk, not as test_interfaces/action/Say" in said(findings, "problem")
    assert "nothing offers" not in said(findings, "problem")


async def test_a_server_of_another_version(only: Any) -> None:
    lab = Lab()
    lab.speaks("/tin/mouth")
    lab.wire.transports[0].hashes[f"{SPEECH['type']}_SendGoal_Request"] = "RIHS01_a"
    findings = await lab.examined(profile(Speech=SPEECH))
    assert "with another version of test_interfaces/action/Say" in said(findings, "problem")
    lab.wire.transports[0].hashes[f"{SPEECH['type']}_SendGoal_Request"] = ""
    findings = await lab.examined(profile(Speech=SPEECH))
    assert exit_status(findings) == 0, "what is unknown is no difference"
    assert "does not say which version of its types it has" in said(findings, "note")


async def test_who_does_not_hear_whom(only: Any) -> None:
    """Feature nodes, too: what they listen to may be published in another way, and nothing says so."""
    lab = Lab()
    lab.node("/cam").publisher("/gaze", LED["type"], QoS(reliable=False))
    lab.node("/gaze_trigger").subscribe("/gaze", LED["type"], print)
    lab.node("/words").publisher("/said", LED["type"])
    lab.node("/late").subscribe("/said", LED["type"], print, QoS(latched=True))
    other = lab.node("/other")
    other.subscribe("/said", LED["type"], print)
    other.hashes[LED["type"]] = "RIHS01_a"
    lab.node("/wrong").subscribe("/said", "std_msgs/msg/String", print)
    warnings = said(await lab.examined(None), "warning")
    assert "the node /cam publishes /gaze as best effort, and the node /gaze_trigger wants it reliably" in warnings
    assert "/words publishes /said as volatile, and the node /late wants it with what was said before" in warnings
    assert f"another version of {LED['type']} than the node /other listens for: the data is garbage" in warnings
    assert f"publishes /said as {LED['type']}, and the node /wrong listens for std_msgs/msg/String" in warnings
    assert warnings.count("publishes") == 4


async def test_a_profile_with_mistakes(only: Any) -> None:
    findings = await Lab().examined(profile(Speech=SPEECH | {"goal": {"txt": "x", "text": "{mesage}"}}))
    assert exit_status(findings) == 1
    assert "txt" in said(findings, "problem") and "mesage" in said(findings, "problem")


async def test_no_robot_and_one_without_ros(only: Any) -> None:
    assert "--robot NAME" in said(await Lab().examined(None), "note")
    assert "driver is 'simulated'" in said(await Lab().examined(profile("simulated")), "note")


async def test_other_peoples_nodes_and_a_lost_wire(only: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab()
    lab.node("/cam").vendor = "010f"
    warning = said(await lab.examined(None), "warning")
    assert "the node /cam uses eProsima Fast DDS (rmw_fastrtps_cpp): topics may arrive, services and" in warning
    assert (
        "What to do: start the robot's program with RMW_IMPLEMENTATION=rmw_cyclonedds_cpp on its computer, or"
        in warning
    )
    monkeypatch.setattr(MemoryTransport, "failure", lambda self: "the context was shut down")
    assert "the context was shut down" in said(await lab.examined(None), "problem")


@pytest.mark.parametrize("error", [AdapterError("one", "two"), PortError("one", "two")])
async def test_a_transport_that_does_not_open(only: Any, error: Exception) -> None:
    async def fails(choice: str, arguments: Any = (), *, node: str, share: Any = ()) -> MemoryTransport:
        raise error

    findings = await examine("dds", profile(Speech=SPEECH), environment={}, open_transport=fails)
    assert [f.sentence for f in findings if f.level == "problem"] == ["one", "two"]


async def test_nothing_to_connect_by(only: Any) -> None:
    only(dds="it needs cyclonedds")
    findings = await examine("auto", None, environment={}, open_transport=Lab().open)
    assert exit_status(findings) == 1 and not [f for f in findings if f.about == "graph"]
    assert [f.level for f in await examine("off")] == ["note"]


# --- how it is said -----------------------------------------------------------------------------------------------


def test_for_a_person_and_for_a_program() -> None:
    findings = [
        DoctorFinding("ok", "ros", "all is well"),
        DoctorFinding("warning", "network", "w " * 60, "do this"),
        DoctorFinding("problem", "robot", "it is not there", "start it"),
        DoctorFinding("problem", "robot", "nor this"),
    ]
    lines = as_text(findings, 60).splitlines()
    assert lines[0] == "ok       all is well" and lines[-1] == "2 problems, 1 warning"
    assert "         → start it" in lines and max(map(len, lines)) <= 60
    assert as_text(findings[:1]).endswith("no problems found\n")
    read = json.loads(as_json(findings))
    assert (read["problems"], read["warnings"]) == (2, 1)
    assert read["findings"][2] == {
        "level": "problem", "about": "robot", "sentence": "it is not there", "remedy": "start it",
    }  # fmt: skip
    assert (exit_status(findings), exit_status(findings[:2])) == (1, 0)
