"""A robot that is there and is not what the profile says: another version of a type, another type, another vendor's
middleware, another quality of service. Nothing is sent to what cannot understand it, and everybody says the same about
it (`rise_adapters.ros2.compatibility`)."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace
from rise_adapters.ros2 import bridge as bridges
from rise_adapters.ros2 import compatibility, doctor, profile_check
from rise_adapters.ros2.actions.server import ActionServer
from rise_adapters.ros2.bridge import Ros2Bridge
from rise_adapters.ros2.mapping import ActionMapping, read_mappings
from rise_adapters.ros2.profile_check import check_profile
from rise_adapters.ros2.robot import Ros2Robot
from rise_adapters.ros2.transport import selection, vendors
from rise_adapters.ros2.transport.port import FEEDBACK, STATUS_TOPIC, QoS, RemoteEndpoint, Transport, action_types

from rise_engine.base.errors import AdapterError
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, Submit
from rise_engine.kernel.records import ActionRecord, AnyRecord, RobotRecord
from rise_engine.ports.bridge import RosConnection
from rise_engine.ports.robot import RobotReport
from rise_engine.run.engine.clock import RealClock, VirtualClock
from rise_engine.run.engine.drivers import make_robot, open_bridge
from rise_engine.run.engine.engine import Engine
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import RobotProfile, Scenario
from rise_engine.scenario.reading.action_declarations import core_actions
from tests.ros.badrobot import Plan
from tests.ros.bench import GAZE, SPEECH, TYPES, Bench
from tests.ros.memory import ClockLoop, MemoryTransport, MemoryWire
from tests.ros.session_node_bench import until

pytest.importorskip("rosbags")

TASK = "2/1"
OTHER = "RIHS01_other"
PARTS = [
    type
    for part, whole in action_types(TYPES[SPEECH]).items()
    for type in ([whole] if part in (FEEDBACK, STATUS_TOPIC) else [f"{whole}_Request", f"{whole}_Response"])
]
"""The types of everything that an action is made of."""


def of_speech(robot: RobotProfile) -> ActionMapping:
    return read_mappings(robot)["Speech"]


# --- versions ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("type", PARTS, ids=[type.rpartition("/")[2] for type in PARTS])
def test_e1_nothing_is_sent_to_another_version(type: str) -> None:
    """Whichever part of the action it is that differs: a goal, a result and an answer to a cancel all travel."""
    bench = Bench(robot=False)
    bench.robot_appears(SPEECH).hashes[type] = OTHER
    bench.robot_appears(GAZE, node="/head")
    bench.run(0.5)
    bench.act()
    bench.run(10)
    assert bench.speech.received == []
    assert bench.ended_at(TASK) == pytest.approx(0.5), "at once"
    what = TYPES[SPEECH] if type.startswith(TYPES[SPEECH]) else type.removesuffix("_Request").removesuffix("_Response")
    sentence = f"{SPEECH} is offered by the node /robot with another version of {what}"
    assert bench.ending(TASK).startswith(f"failed: other-version: {sentence}; build its interface package")
    (told,) = bench.of(RobotRecord)
    assert told.status == "degraded" and told.detail.startswith(sentence)
    bench.act("Look")
    bench.run(20)
    assert bench.task("Look") == "SUCCEEDED", "the rest of the robot is as it should be"
    bench.check()


def test_e1_a_robot_of_another_version_is_not_connected_until_the_right_one_comes() -> None:
    bench = Bench(robot=False)
    for type in PARTS:
        bench.robot_appears().hashes[type] = OTHER
        bench.robot_leaves()
    bench.robot_appears().hashes.update({type: OTHER for name in TYPES for type in types_of(TYPES[name])})
    bench.run(6)
    (told,) = bench.of(RobotRecord)
    assert told.status == "lost" and told.detail.startswith(
        "other-version: Pepper has other versions of types; rebuild both (/pepper/rise/speech is offered by"
    )
    bench.act()
    bench.run(7)
    assert "other-version" in bench.ending(TASK)
    assert not bench.wire.messages("*/send_goal")
    bench.robot_leaves()
    bench.robot_appears()
    bench.run(20)
    bench.act()
    bench.run(30)
    assert bench.task() == "SUCCEEDED" and bench.robot_statuses()[-1] == "connected"
    bench.check()


def test_e1_a_server_is_compared_whenever_it_appears_also_between_two_looks() -> None:
    """A wrapper that is restarted quickly is there at each look, and is another one."""
    bench = Bench()
    bench.run(3.0)
    assert bench.robot_statuses() == ["connected"]
    bench.robot_leaves()
    bench.robot_appears().hashes[f"{TYPES[SPEECH]}_SendGoal_Request"] = OTHER
    bench.act()
    assert bench.ending(TASK).startswith("failed: other-version"), "before the next look"
    assert bench.speech.received == []
    bench.robot_leaves()
    bench.robot_appears().hashes[f"{TYPES[SPEECH]}_SendGoal_Request"] = OTHER
    bench.run(9)
    assert bench.robot_statuses()[-1] == "degraded"
    assert "another version of rise_interfaces/action/Speech" in bench.of(RobotRecord)[-1].detail
    bench.check()


def test_e1_what_runs_is_not_lost_because_somebody_else_appears() -> None:
    bench = Bench([Plan(seconds=4)])
    bench.run(1)
    bench.act()
    bench.run(2)
    twin = MemoryTransport(bench.wire, bench.loop, "/twin")
    for name in TYPES:
        twin.serve(f"{name}/_action/send_goal", "lab_msgs/action/Say_SendGoal", lambda request, reply: None)
    bench.run(20)
    assert bench.ending(TASK) == "succeeded"
    statuses = bench.robot_statuses()
    assert list(dict.fromkeys(statuses)) == ["connected", "degraded", "lost"], "lost only when nothing runs any more"
    bench.act()
    assert bench.task() == "ABORTED" and len(bench.speech.executed) == 1
    bench.check()


def test_e1_versions_that_are_not_announced_are_said_once() -> None:
    bench = Bench(robot=False)
    bench.robot_appears().hashes.update(dict.fromkeys(PARTS, ""))
    bench.run(6)
    bench.act()
    bench.run(20)
    bench.act()
    bench.run(30)
    assert bench.task() == "SUCCEEDED" and len(bench.speech.executed) == 2
    assert bench.robot_statuses() == ["connected"]
    assert bench.notes() == [compatibility.describe_uncompared(SPEECH), compatibility.describe_uncompared(GAZE)]
    bench.check()


def test_a_middleware_that_lists_no_ends_is_trusted_after_a_second(monkeypatch: pytest.MonkeyPatch) -> None:
    """What it does not list cannot be compared; it may only not have come to it yet."""
    monkeypatch.setattr(MemoryTransport, "server_endpoints", lambda self, service: [])
    bench = Bench()
    bench.act()
    bench.run(0.9)
    assert bench.speech.received == []
    bench.run(20)
    assert bench.task() == "SUCCEEDED" and bench.robot_statuses() == ["connected"]
    assert bench.notes() == [compatibility.describe_uncompared(SPEECH), compatibility.describe_uncompared(GAZE)]
    bench.check()


def test_a_middleware_that_announces_the_hashes_of_services() -> None:
    """Instead of those of their requests and responses."""
    bench = Bench(robot=False)
    node = bench.robot_appears()
    for type in [type for name in TYPES for type in types_of(TYPES[name]) if type.endswith(("_Request", "_Response"))]:
        node.hashes[type] = node.type_hash(type.removesuffix("_Request").removesuffix("_Response"))
    bench.act()
    bench.run(20)
    assert bench.task() == "SUCCEEDED" and bench.robot_statuses() == ["connected"] and bench.notes() == []
    bench.check()


def test_a_middleware_that_only_names_types_is_noted(monkeypatch: pytest.MonkeyPatch) -> None:
    """As rmw_zenoh, of which rclpy knows no more of a service."""
    listed = MemoryTransport.server_endpoints
    monkeypatch.setattr(
        MemoryTransport,
        "server_endpoints",
        lambda self, service: [
            RemoteEndpoint(end.node, end.type) for end in listed(self, service) if "_Request" in end.type
        ],
    )
    bench = Bench()
    bench.act()
    bench.run(20)
    assert bench.task() == "SUCCEEDED" and bench.robot_statuses() == ["connected"]
    assert bench.notes() == [compatibility.describe_uncompared(SPEECH), compatibility.describe_uncompared(GAZE)]
    bench.check()


def types_of(action: str) -> list[str]:
    return [type.replace(TYPES[SPEECH], action) for type in PARTS]


# --- the middleware ---------------------------------------------------------------------------------------------------


def test_e2_services_do_not_cross_from_vendor_to_vendor() -> None:
    """The other side can be seen, is of the right types, and understands no request."""
    bench = Bench(robot=False)
    bench.robot_appears().vendor = vendors.FAST
    bench.act()
    bench.run(20)
    assert not bench.wire.messages("*/send_goal")
    assert bench.ending(TASK).startswith(
        f"failed: other-middleware: {SPEECH} is offered by the node /robot over eProsima Fast DDS (rmw_fastrtps_cpp), "
        "and this program uses Cyclone DDS (rmw_cyclonedds_cpp)"
    )
    assert "start the robot's program with RMW_IMPLEMENTATION=rmw_cyclonedds_cpp" in bench.ending(TASK)
    (told,) = bench.of(RobotRecord)
    assert told.status == "lost" and f"(and so with {GAZE})" in told.detail
    bench.check()


@pytest.mark.parametrize(
    ("one", "other", "cross"),
    [
        (vendors.CYCLONE, vendors.CYCLONE, "yes"),
        (vendors.CYCLONE, vendors.FAST, "no"),
        (vendors.FAST, vendors.CYCLONE, "no"),
        (vendors.CYCLONE, "0199", "no"),
        (vendors.CYCLONE, vendors.CONNEXT, "unknown"),
        (vendors.FAST, vendors.CONNEXT, "unknown"),
        (vendors.FAST, "", "yes"),
        ("", vendors.FAST, "yes"),
    ],
)
def test_which_vendors_services_cross(one: str, other: str, cross: str) -> None:
    assert vendors.services_cross(one, other) == cross


def test_rmw_names() -> None:
    assert (
        vendors.vendor_of_rmw("rmw_fastrtps_cpp") == vendors.vendor_of_rmw("rmw_fastrtps_dynamic_cpp") == vendors.FAST
    )
    assert vendors.vendor_of_rmw("rmw_zenoh_cpp") == "", "the ids of Zenoh say nothing of vendors"


# --- quality of service -----------------------------------------------------------------------------------------------


def test_feedback_that_would_not_be_heard_is_said_and_goals_are_sent() -> None:
    bench = Bench(robot=False, feedback=30)
    node = bench.robot_appears()
    for publisher in node.publishers:
        if publisher.topic.endswith("/feedback"):
            publisher.qos = QoS(reliable=False)
    bench.run(6)
    (told,) = bench.of(RobotRecord)
    assert told.status == "degraded"
    assert f"{SPEECH} publishes its feedback as best effort, and this program wants it reliably" in told.detail
    assert 'write `qos.feedback = { reliability = "best_effort" }` into the carrier' in told.detail
    bench.act()
    bench.run(20)
    assert bench.task() == "SUCCEEDED"


def test_the_carrier_says_how_an_actions_topics_are_listened_to() -> None:
    robot, heard = (
        Direct(
            action="lab/wave",
            type="lab_msgs/action/Wave",
            deadlines={"feedback": 30},
            qos={"feedback": {"reliability": "best_effort", "depth": 20}, "status": {"durability": "volatile"}},
        ),
        {FEEDBACK: QoS(20, reliable=False), STATUS_TOPIC: QoS(1)},
    )
    assert {
        part: each.qos for part in heard for each in robot.transport.subscriptions if each.topic.endswith(part)
    } == heard


def test_feedback_that_nobody_waits_for_is_not_listened_to() -> None:
    robot = Direct(action="lab/wave", type="lab_msgs/action/Wave")
    assert not [each for each in robot.transport.subscriptions if each.topic.endswith(FEEDBACK)]


def test_the_carrier_says_how_a_topic_is_published() -> None:
    robot = Direct(topic="lab/led", type="lab_msgs/msg/Led", qos={"durability": "transient_local", "depth": 1})
    assert [each.qos for each in robot.transport.publishers] == [QoS(1, latched=True)]
    robot = Direct(topic="lab/led", type="lab_msgs/msg/Led")
    robot.node.subscribe("/lab/led", "lab_msgs/msg/Led", print, QoS(latched=True))
    robot.start()
    assert robot.ending().startswith("other-quality: /lab/led is wanted with what was said before (transient local)")
    assert 'write `qos = { durability = "transient_local" }` into the carrier' in robot.ending()
    robot.node.subscribe("/lab/led", "lab_msgs/msg/Led", print)
    robot.start()
    assert robot.sent() == 1, "who listens besides may want it as they like"


def test_a_topic_of_another_version_gets_nothing() -> None:
    robot = Direct(topic="lab/led", type="lab_msgs/msg/Led")
    robot.node.hashes["lab_msgs/msg/Led"] = OTHER
    robot.node.subscribe("/lab/led", "lab_msgs/msg/Led", print)
    robot.start()
    assert robot.ending().startswith("other-version: /lab/led is taken by the node /robot with another version")
    assert robot.sent() == 0


def test_what_is_seen_and_cannot_be_reached_is_not_called_missing() -> None:
    robot = Direct(action="lab/wave", type="lab_msgs/action/Wave", deadlines={"server": 1})
    for part in ("send_goal", "cancel_goal"):
        whole = action_types("lab_msgs/action/Wave")[part]
        robot.node.serve(f"/lab/wave/_action/{part}", whole, lambda request, reply: None)
    robot.start()
    assert robot.ending() == (
        "server-missing: /lab/wave is seen at the node /robot, and cannot be reached: one of its services is missing, "
        "or has a deadline or liveliness that this program does not promise"
    )


@pytest.mark.parametrize(("key", "value"), [("qos", {"depth": 1}), ("reset", {"level": 1}), ("reset", {})])
def test_actions_that_go_one_way_have_one_quality_of_service_and_one_reset(key: str, value: Any) -> None:
    carrier = {"topic": "lab/led", "type": "lab_msgs/msg/Led"}
    specs = core_actions()
    actions = {
        "Emotion": replace(specs["Emotion"], carrier=carrier),
        "SocialExpression": replace(specs["SocialExpression"], carrier={**carrier, key: value}),
    }
    assert bridges.mapping_problems(RobotProfile("tin", "Tin", "ros2", actions)) == [
        f"robot tin: `actions.SocialExpression.carrier.{key}` differs from that of Emotion, which goes to lab/led too; "
        "give both the same"
    ]


class Direct:
    """A robot with one action, Emotion, without a session around it."""

    def __init__(self, **carrier: Any) -> None:
        self.clock = VirtualClock()
        self.wire = MemoryWire(
            {
                "lab_msgs/msg/Led": {},
                **{f"lab_msgs/action/Wave_{part}": {} for part in ("Goal", "Result", "Feedback")},
            }
        )
        loop = ClockLoop(self.clock)
        self.transport, self.node = (MemoryTransport(self.wire, loop, name) for name in ("/engine", "/robot"))
        actions = {"Emotion": replace(core_actions()["Emotion"], carrier=carrier)}
        which = RobotProfile("tin", "Tin", "ros2", actions)
        # Names of the profile without a slash belong to the node's namespace, `/`.
        self.robot = Ros2Robot(which, self.clock, self.transport, read_mappings(which, self.transport.fields))
        self.reports: list[RobotReport] = []
        self.robot.connect(self.reports.append)

    def start(self) -> None:
        self.robot.start(StartAction(action="1/1", type="Emotion", parameters={"value": "happy"}, expected=1.0))
        until = self.clock.now() + 8
        while (due := self.clock.next_at) is not None and due <= until:
            self.clock.advance()

    def ending(self) -> str:
        """Why the last action did not succeed."""
        return next(each.reason for each in reversed(self.reports) if isinstance(each, ActionReport))

    def sent(self) -> int:
        return len(self.wire.messages("/lab/led"))


# --- everybody says the same ------------------------------------------------------------------------------------------

TIN = """\
driver = "ros2"
[actions.Speech.carrier]
action = "tin/speech"
type = "lab_msgs/action/Say"
goal = { text = "{message}" }
deadlines.feedback = 30
"""
SAY = "string text\n---\nstring reason\n---\nfloat32 progress\n"

STATIC = {
    "an unknown type": (
        TIN.replace("action/Say", "action/Shout"),
        SAY,
        "`actions.Speech.carrier.type` cannot be used here: the type lab_msgs/action/Shout_Goal is not known",
    ),
    "a missing field": (
        TIN.replace("text =", "txet ="),
        SAY,
        "`actions.Speech.carrier.goal.txet` is not a field of lab_msgs/action/Say_Goal; did you mean `text`?",
    ),
    "a quality of service that is none": (
        TIN + 'qos.feedback.reliability = "best-effort"\n',
        SAY,
        "`actions.Speech.carrier.qos.feedback.reliability` is `reliable` or `best_effort`; did you mean `best_effort`?",
    ),
    "a text of wide letters": (
        TIN,
        SAY.replace("string reason", "Note note"),
        "the field note.inner of lab_msgs/action/Say_Result is a wstring (a text of wide letters), which the "
        "transport `dds` cannot carry; make it a string, or use --ros rclpy",
    ),
}
"""What shows in the files: the profile, the definition of its type, and the sentence."""

LIVE: dict[str, tuple[Callable[[MemoryTransport], None], str]] = {
    "nothing there": (lambda node: node.close(), "nothing offers /tin/speech"),
    "another type": (
        lambda node: serve(node, "lab_msgs/action/Talk"),
        "/tin/speech is offered as lab_msgs/action/Talk, not as lab_msgs/action/Say",
    ),
    "another version": (
        lambda node: serve(node).hashes.update({"lab_msgs/action/Say_GetResult_Response": OTHER}),
        "/tin/speech is offered by the node /mouth with another version of lab_msgs/action/Say",
    ),
    "another middleware": (
        lambda node: setattr(serve(node), "vendor", vendors.FAST),
        "/tin/speech is offered by the node /mouth over eProsima Fast DDS (rmw_fastrtps_cpp), and this program uses "
        "Cyclone DDS (rmw_cyclonedds_cpp): services and actions do not cross from one to the other",
    ),
    "another quality of service": (
        lambda node: unheard(serve(node)),
        "/tin/speech publishes its feedback as best effort, and this program wants it reliably",
    ),
    "two of it": (
        lambda node: (serve(node), serve(node)),  # type: ignore[dict-item,return-value]
        "2 nodes offer /tin/speech, so the robot would do everything 2 times",
    ),
}
"""What shows on the wire: how to bring it about, and the sentence."""


def serve(node: MemoryTransport, type: str = "lab_msgs/action/Say") -> MemoryTransport:
    ActionServer(node, "/tin/speech", type, lambda goal: goal.accept() and goal.succeed({}), clock=RealClock(node.loop))  # type: ignore[arg-type]
    return node


def unheard(node: MemoryTransport) -> None:
    for publisher in node.publishers:
        if publisher.topic.endswith(FEEDBACK):
            publisher.qos = QoS(reliable=False)


class Lab:
    """A folder with a study and a definition, and a wire in memory that stands in for whatever transport is opened."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch, robot: str = TIN, definition: str = SAY) -> None:
        share = folder / "share"
        for name, text in (
            ("action/Say.action", definition),
            ("action/Talk.action", SAY),
            ("msg/Note.msg", "wstring inner\n"),
        ):
            (share / "lab_msgs" / name).parent.mkdir(parents=True, exist_ok=True)
            (share / "lab_msgs" / name).write_text(text, "utf-8")
        (folder / "robots").mkdir()
        (folder / "robots/tin.toml").write_text(
            f'{robot}\n[options]\nshare = ["{share}"]\ndeadlines.server = 0.5\ndeadlines.acceptance = 20\n'
        )
        (folder / "acts").mkdir()
        (folder / "acts/a.xml").write_text(
            '<Dialog name="A"><Speech><actionID>1</actionID><message>x</message></Speech></Dialog>', "utf-8"
        )
        (folder / "scenario.toml").write_text('robot = "tin"\nmode = "real"\n', "utf-8")
        loaded = load(folder)
        assert loaded.scenario is not None, loaded.diagnostics
        self.scenario: Scenario = loaded.scenario
        self.wire = MemoryWire()
        self.loop = asyncio.get_running_loop()
        monkeypatch.setattr(selection, "why_unavailable", lambda: {"rclpy": "rclpy is not here", "dds": ""})
        monkeypatch.setattr(profile_check, "why_unavailable", selection.why_unavailable)
        monkeypatch.setattr(bridges, "open_transport", self.open)

    async def open(
        self, choice: str = "auto", arguments: Sequence[str] = (), *, node: str, share: Sequence[Path] = ()
    ) -> Transport:
        from rise_adapters.ros2.transport.interfaces import InterfaceCatalog

        made = MemoryTransport(self.wire, self.loop, f"/{node}")
        made.fields = InterfaceCatalog(share).fields  # type: ignore[method-assign]
        return made

    async def doctor(self) -> list[str]:
        found = await doctor.examine("dds", self.scenario.robot, environment={}, seconds=0.3, open_transport=self.open)
        assert doctor.exit_status(found) == 1
        return [each.sentence for each in found if each.level == "problem" and each.about == "robot"]

    async def session(self) -> list[AnyRecord]:
        """The records of a session in which the act A was submitted; raises AdapterError when it is refused."""
        bridge = await open_bridge(RosConnection("dds"), self.scenario.robot, "real")
        assert isinstance(bridge, Ros2Bridge)
        clock = RealClock(self.loop, 1.0, 0.0)
        robot = make_robot(self.scenario.robot, "real", clock, 1, (), bridge)
        records: list[AnyRecord] = []
        engine = Engine(self.scenario, robot, clock, 1, sinks=[records.append])
        engine.start()
        await until(lambda: any(isinstance(each, RobotRecord) for each in records))
        engine.accept(Submit(function="startCommunicationRobotAct", behavior="A"))
        await until(lambda: engine.idle)
        engine.end("over")
        await until(lambda: engine.ended)
        await bridge.close()
        return records


@pytest.mark.parametrize("fault", STATIC)
async def test_check_doctor_and_session_say_the_same_about_a_profile(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str
) -> None:
    robot, definition, sentence = STATIC[fault]
    lab = Lab(tmp_path, monkeypatch, robot, definition)
    (checked,) = check_profile(lab.scenario.robot)
    assert sentence in checked.sentence
    assert await lab.doctor() == [checked.sentence]
    with pytest.raises(AdapterError) as refused:
        await lab.session()
    assert refused.value.lines == (checked.sentence,)
    assert not lab.wire.messages("/tin/*")


@pytest.mark.parametrize("fault", LIVE)
async def test_doctor_and_session_say_the_same_about_a_robot(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str
) -> None:
    prepare, sentence = LIVE[fault]
    lab = Lab(tmp_path, monkeypatch)
    assert check_profile(lab.scenario.robot) == [], "the files are as they should be"
    prepare(MemoryTransport(lab.wire, lab.loop, "/mouth"))
    assert await lab.doctor() == [f"Speech: {sentence}"]
    records = await lab.session()
    told = [each for each in records if isinstance(each, RobotRecord)]
    assert told and all(each.status != "connected" for each in told)
    assert sentence in told[0].detail
    (ended,) = [each for each in records if isinstance(each, ActionRecord) and each.status in ("failed", "succeeded")]
    if fault == "another quality of service":
        assert ended.status == "succeeded", "what is sent arrives"
    else:
        assert sentence in ended.reason and not lab.wire.messages("*/send_goal")


async def test_nothing_is_wrong_with_the_right_robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lab = Lab(tmp_path, monkeypatch, TIN + 'qos.feedback.reliability = "best_effort"\n')
    unheard(serve(MemoryTransport(lab.wire, lab.loop, "/mouth")))
    found = await doctor.examine("dds", lab.scenario.robot, environment={}, seconds=2, open_transport=lab.open)
    assert doctor.exit_status(found) == 0 and any(
        "is offered, as lab_msgs/action/Say" in each.sentence for each in found
    )
    records = await lab.session()
    assert [each.status for each in records if isinstance(each, RobotRecord)] == ["connected"]
    assert [each.status for each in records if isinstance(each, ActionRecord)][-1] == "succeeded"
