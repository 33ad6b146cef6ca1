"""Checks whether each action of the robot is offered once, and as its profile says.

It also compares a profile's joints and coordinate frames with those that the robot publishes on `joint_states`, `/tf`
and `/tf_static`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from rise_adapters.ros2 import compatibility, graph_checks
from rise_adapters.ros2.actions.client import ActionClient
from rise_adapters.ros2.doctor.finding import DoctorFinding
from rise_adapters.ros2.mapping import ActionMapping, mapping_findings, read_mappings, read_options
from rise_adapters.ros2.mapping.field_sources import (
    NO_VALUE,
    FieldSource,
    FixedSource,
    ListSource,
    MessageSource,
    ParameterSource,
    SpecialSource,
)
from rise_adapters.ros2.mapping.options import DRIVER
from rise_adapters.ros2.mapping.poses import PlaceSource
from rise_adapters.ros2.robot.estop_input import EstopInput
from rise_adapters.ros2.robot.lifecycle import LifecycleWatch
from rise_adapters.ros2.session_node import neighbours
from rise_adapters.ros2.transport.port import SENSOR, Message, PortError, QoS, Subscription, Transport
from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.model import RobotProfile

# --- joints and frames ------------------------------------------------------------------------------------------------

JOINT_STATES, TRANSFORMS = "joint_states", ("/tf", "/tf_static")
_STATIC = QoS(depth=100, latched=True)
_JOINT_FIELDS, _FRAME_FIELDS = ("joint_names",), ("frame_id", "child_frame_id", "frame")


class LiveNames:
    """The robot's joints and frames, collected while the doctor listens."""

    def __init__(self, transport: Transport, profile: RobotProfile, mappings: Mapping[str, ActionMapping]) -> None:
        self._wanted: dict[str, dict[str, str]] = {"joint": {}, "frame": {}}
        """The names in the profile by kind, each with an action that needs it."""
        self._seen: dict[str, set[str]] = {"joint": set(), "frame": set()}
        self._deaf: list[str] = []
        """Why a topic cannot be listened to."""
        self._subscriptions: list[Subscription] = []
        for action, mapping in mappings.items():
            for source in (mapping.message, mapping.reset):
                if source is not None:
                    self._collect(source, action, read_options(profile).frame)
        if self._wanted["joint"]:
            self._listen(transport, JOINT_STATES, "sensor_msgs/msg/JointState", self._take_joints, SENSOR)
        if self._wanted["frame"]:
            for topic in TRANSFORMS:
                qos = _STATIC if topic.endswith("static") else SENSOR
                self._listen(transport, topic, "tf2_msgs/msg/TFMessage", self._take_transforms, qos)

    def are_complete(self) -> bool:
        """Whether every name was seen, so that listening can stop."""
        return bool(self._deaf) or all(names.keys() <= self._seen[kind] for kind, names in self._wanted.items())

    def findings(self) -> Iterator[DoctorFinding]:
        for sentence in dict.fromkeys(self._deaf):
            yield DoctorFinding("note", "robot", sentence)
        heard = {"joint": JOINT_STATES, "frame": " and ".join(TRANSFORMS)}
        for kind, wanted in self._wanted.items() if not self._deaf else ():
            seen = self._seen[kind]
            missing = {name: action for name, action in wanted.items() if name not in seen}
            if wanted and not seen:
                names = in_backquotes(wanted)
                what = f"nothing was heard on {heard[kind]}, so the {kind}s {names} of the profile were not compared"
                yield DoctorFinding("note", "robot", what)
            elif wanted and not missing:
                yield DoctorFinding(
                    "ok", "robot", f"the {kind}s of the profile are the robot's: {in_backquotes(wanted)}"
                )
            for name, action in missing.items() if seen else ():
                sentence = f"{action}: the robot has no {kind} `{name}`{did_you_mean(name, seen)}"
                yield DoctorFinding("problem", "robot", sentence, "correct the name in the profile")

    def close(self) -> None:
        for subscription in self._subscriptions:
            subscription.close()

    # --- the profile's names --------------------------------------------------------------------------------------

    def _collect(self, source: FieldSource, action: str, frame: str, field: str = "") -> None:
        """Note the joints and frames that a source adds to a message."""
        if isinstance(source, MessageSource):
            for name, inside in source.fields.items():
                self._collect(inside, action, frame, name)
        elif isinstance(source, ListSource):
            for item in source.items:
                self._collect(item, action, frame, field)
        elif isinstance(source, FixedSource) and isinstance(source.value, str) and source.value:
            self._require(field, source.value, action)
        elif (isinstance(source, SpecialSource) and source.name == "frame") or (
            isinstance(source, ParameterSource | PlaceSource) and source.special == "frame"
        ):
            self._require(_FRAME_FIELDS[0], frame, action)
        if isinstance(source, PlaceSource) and source.key == "frame":
            values = dict.fromkeys(source.values.values())
            if source.places - source.values.keys() and source.absent is not NO_VALUE:
                values[source.absent] = None
            for value in values:
                self._require(_FRAME_FIELDS[0], str(value), action)

    def _require(self, field: str, name: str, action: str) -> None:
        if field in _JOINT_FIELDS:
            self._wanted["joint"].setdefault(name, action)
        elif field in _FRAME_FIELDS:
            self._wanted["frame"].setdefault(name.removeprefix("/"), action)

    # --- the robot's names ----------------------------------------------------------------------------------------

    def _listen(self, transport: Transport, topic: str, type: str, take: Callable[[Message], None], qos: QoS) -> None:
        try:
            self._subscriptions.append(transport.subscribe(topic, type, take, qos))
        except PortError as error:
            self._deaf.append(f"the names of the profile cannot be compared with the robot's: {error}")

    def _take_joints(self, message: Message) -> None:
        self._seen["joint"].update(message["name"])

    def _take_transforms(self, message: Message) -> None:
        for transform in message["transforms"]:
            for name in (transform["header"]["frame_id"], transform["child_frame_id"]):
                self._seen["frame"].add(name.removeprefix("/"))


SEARCH_SECONDS = 3.0
"""Seconds to search for the robot's servers. Discovery takes milliseconds on one machine, and longer on Wi-Fi."""
SETTLE_SECONDS = 0.5
"""Seconds to continue after all were found, because a second server may follow."""
_POLL_SECONDS = 0.05
_MAX_NAMES = 8


async def check_robot(
    transport: Transport, profile: RobotProfile | None, seconds: float = SEARCH_SECONDS
) -> list[DoctorFinding]:
    """Check whether each of the robot's actions is offered once, and as the profile says (`compatibility`)."""
    if profile is None:
        return [DoctorFinding("note", "robot", "no robot was named, so none was examined", "add --robot NAME")]
    if profile.driver != DRIVER:
        return [
            DoctorFinding(
                "note",
                "robot",
                f"the robot {profile.name} was not examined: its driver is {profile.driver!r}, which is not on ROS",
            )
        ]
    findings = mapping_findings(profile, transport.fields)
    try:
        mappings = read_mappings(profile, transport.fields)
    except PortError:
        return [DoctorFinding("problem" if each.refuses else "warning", "robot", each.sentence) for each in findings]
    warnings = [DoctorFinding("warning", "robot", each.sentence) for each in findings]
    expected: list[_ExpectedEndpoint] = []
    live: LiveNames | None = None
    estop: EstopInput | None = None
    try:
        live = LiveNames(transport, profile, mappings)
        for name, mapping in _by_route(mappings).items():
            expected.append(_ExpectedEndpoint(transport, name, mapping))
        if (named := read_options(profile).estop) is not None and named.type:
            estop = EstopInput(named, transport, asyncio.get_running_loop().time, lambda report: None)
        await _wait_for(expected, estop, live, seconds)
        if len(expected) > 1 and not any(each.is_seen() for each in expected):
            names = ", ".join(each.full for each in expected)
            others = list(dict.fromkeys(name for each in expected for name in each.names_elsewhere()))
            remedy = _advise_renaming("these", others) if others else _advise_start("these")
            return [DoctorFinding("problem", "robot", f"nothing of {profile.name} is there: {names}", remedy)]
        found = [finding for each in expected for finding in each.findings()]
        found += live.findings()
        return [*found, *_describe_estop(estop), *_describe_clients(transport, expected), *warnings]
    except PortError as error:
        return [DoctorFinding("problem", "robot", str(error))]
    finally:
        for each in expected:
            each.close()
        if live is not None:
            live.close()
        if estop is not None:
            estop.close()


def _describe_estop(estop: EstopInput | None) -> Iterator[DoctorFinding]:
    """Report the state of the emergency stop in the profile."""
    if estop is None:
        return
    what = f"the emergency stop at {estop.name}"
    if estop.fault:
        remedy = "nothing begins until its state is known; see `options.estop` in the profile"
        yield DoctorFinding("problem", "robot", estop.trouble, remedy)
    elif estop.pressed:
        yield DoctorFinding("warning", "robot", f"{what} is pressed", "release it: nothing starts before that")
    else:
        yield DoctorFinding("ok", "robot", f"{what} is heard, and is not pressed")


def _describe_clients(transport: Transport, expected: Sequence[_ExpectedEndpoint]) -> Iterator[DoctorFinding]:
    """Report other nodes that may move the robot. A session is named like any node."""
    reported: set[str] = set()
    for each in expected:
        for node in graph_checks.other_clients(transport, each.full) if each.is_action else ():
            if node not in reported:
                reported.add(node)
                yield DoctorFinding("note", "robot", graph_checks.describe_other_client(node, each.full))


def _by_route(mappings: Mapping[str, ActionMapping]) -> dict[str, ActionMapping]:
    """Group actions with the same route: `Emotion, SocialExpression`."""
    names: dict[tuple[str, str, str], list[str]] = {}
    for name, mapping in mappings.items():
        names.setdefault(mapping.route, []).append(name)
    return {", ".join(each): mappings[each[0]] for each in names.values()}


async def _wait_for(
    expected: Sequence[_ExpectedEndpoint], estop: EstopInput | None, live: LiveNames, seconds: float
) -> None:
    loop = asyncio.get_running_loop()
    until = loop.time() + seconds
    complete: float | None = None
    while loop.time() < until and (complete is None or loop.time() < complete + SETTLE_SECONDS):
        for each in expected:
            each.poll()
        if estop is not None:
            estop.poll()
        heard = live.are_complete() and (estop is None or estop.pressed is not None)
        if complete is None and heard and all(each.is_complete() for each in expected):
            complete = loop.time()
        await asyncio.sleep(_POLL_SECONDS)


class _ExpectedEndpoint:
    """The endpoint that carries one or several actions of the robot."""

    def __init__(self, transport: Transport, name: str, mapping: ActionMapping) -> None:
        self._transport = transport
        self._name = name
        self._mapping = mapping
        self.full = transport.resolve(mapping.name)
        self.is_action = mapping.kind == "action"
        self._lifecycle = LifecycleWatch(transport, asyncio.get_running_loop().time)
        if mapping.kind == "action":
            client = ActionClient(
                transport, mapping.name, mapping.type, feedback=mapping.feedback_wanted, status=mapping.status_qos
            )
            self.count_receivers, self._close = client.count_servers, client.close
        elif mapping.kind == "service":
            service = transport.client(mapping.name, mapping.type)
            self.count_receivers, self._close = service.count_servers, service.close
        else:
            publisher = transport.publisher(mapping.name, mapping.type, mapping.topic_qos)
            self.count_receivers, self._close = publisher.count_subscribers, publisher.close

    def close(self) -> None:
        self._lifecycle.close()
        self._close()

    def poll(self) -> None:
        """Ask its node for its state, if it is a lifecycle node."""
        if self.is_action:
            self._lifecycle.follow_server(self.full)
            self._lifecycle.poll()

    def is_complete(self) -> bool:
        """Whether every part of it exists, and can be compared."""
        return self.count_receivers() > 0 and compatibility.compare(self._transport, self._mapping).complete

    def is_seen(self) -> bool:
        """Whether anything with that name exists, even if it does not fit."""
        return self.count_receivers() > 0 or bool(compatibility.compare(self._transport, self._mapping).seen)

    def names_elsewhere(self) -> list[str]:
        """Other names with its type. Sessions, which listen to one another, are not robots."""
        others = graph_checks.names_elsewhere(self._transport, self._mapping)
        return [name for name in others if not name.endswith(f"/{neighbours.TOPIC}")]

    def findings(self) -> Iterator[DoctorFinding]:
        number, name, full = self.count_receivers(), self._name, self.full
        is_served = self._mapping.kind != "topic"
        lifecycle = self._lifecycle
        found = compatibility.compare(self._transport, self._mapping)
        for mismatch in found.mismatches:
            yield DoctorFinding("problem", "robot", f"{name}: {mismatch.sentence}", mismatch.remedy)
        if number > 1 and is_served:
            several = compatibility.describe_several_servers(number, full)
            yield DoctorFinding("problem", "robot", f"{name}: {several}", "end all but one of them")
        elif lifecycle.sentence and not found.mismatches:
            yield DoctorFinding("problem", "robot", f"{name}: {lifecycle.sentence}", lifecycle.remedy)
        elif number and not found.mismatches:
            listens = f"has {number} subscriber{'s' if number > 1 else ''}"
            yield DoctorFinding(
                "ok", "robot", f"{name}: {full} {f'is offered, as {self._mapping.type}' if is_served else listens}"
            )
        elif not found.mismatches:
            others = self.names_elsewhere()
            remedy = "" if found.seen else _advise_renaming(full, others) if others else _advise_start(full)
            yield DoctorFinding(
                "problem", "robot", f"{name}: {compatibility.describe_absence(found, self._mapping, full)}", remedy
            )
        if found.unannounced:
            yield DoctorFinding("note", "robot", f"{name}: {compatibility.describe_uncompared(full)}")


def _advise_renaming(name: str, others: Sequence[str]) -> str:
    are = "there is one of this type" if name.startswith("/") else "of their types there are"
    names = ", ".join(others[:_MAX_NAMES]) + (", ..." if len(others) > _MAX_NAMES else "")
    return f"{are}, by other names: {names}; correct the names in the profile, or start with --ros-args -r FROM:=TO"


def _advise_start(name: str) -> str:
    names = f"is {name} the name" if name.startswith("/") else f"are {name} the names"
    return (
        f"is the robot's wrapper running, in the same ROS domain, and {names} that it uses "
        "(else: --ros-args -r FROM:=TO)?"
    )


def definition_folders(profile: RobotProfile | None) -> list[Path]:
    """Folders with the definitions that the robot needs."""
    if profile is None or profile.driver != DRIVER:
        return []
    try:
        return [Path(folder) for folder in read_options(profile).share]
    except PortError:  # reported with all other errors in the profile
        return []
