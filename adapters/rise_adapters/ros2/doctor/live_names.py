"""Whether the joints and the coordinate frames that a profile names are those of the robot: they are compared with what
it says on `joint_states`, `/tf` and `/tf_static`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from rise_adapters.ros2.doctor.finding import DoctorFinding
from rise_adapters.ros2.mapping import ActionMapping, read_options
from rise_adapters.ros2.mapping.field_sources import (
    NO_VALUE,
    FieldSource,
    FixedSource,
    ListSource,
    MessageSource,
    ParameterSource,
    SpecialSource,
)
from rise_adapters.ros2.mapping.poses import PlaceSource
from rise_adapters.ros2.transport.port import SENSOR, Message, PortError, QoS, Subscription, Transport
from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.model import RobotProfile

JOINT_STATES, TRANSFORMS = "joint_states", ("/tf", "/tf_static")
_STATIC = QoS(depth=100, latched=True)
_JOINT_FIELDS, _FRAME_FIELDS = ("joint_names",), ("frame_id", "child_frame_id", "frame")


class LiveNames:
    """What the robot calls its joints and frames, for as long as it is listened to."""

    def __init__(self, transport: Transport, profile: RobotProfile, mappings: Mapping[str, ActionMapping]) -> None:
        self._wanted: dict[str, dict[str, str]] = {"joint": {}, "frame": {}}
        """By what they are, the names that the profile has, with an action that needs them."""
        self._seen: dict[str, set[str]] = {"joint": set(), "frame": set()}
        self._deaf: list[str] = []
        """Why something cannot be listened to."""
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
        """Whether every name was seen, so that nothing more needs to be heard."""
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

    # --- what the profile names -----------------------------------------------------------------------------------

    def _collect(self, source: FieldSource, action: str, frame: str, field: str = "") -> None:
        """Note the joints and frames that a source puts into a message by itself."""
        if isinstance(source, MessageSource):
            for name, inside in source.fields.items():
                self._collect(inside, action, frame, name)
        elif isinstance(source, ListSource):
            for item in source.items:
                self._collect(item, action, frame, field)
        elif isinstance(source, FixedSource) and isinstance(source.value, str) and source.value:
            self._want(field, source.value, action)
        elif (isinstance(source, SpecialSource) and source.name == "frame") or (
            isinstance(source, ParameterSource | PlaceSource) and source.special == "frame"
        ):
            self._want(_FRAME_FIELDS[0], frame, action)
        if isinstance(source, PlaceSource) and source.key == "frame":
            values = dict.fromkeys(source.values.values())
            if source.places - source.values.keys() and source.absent is not NO_VALUE:
                values[source.absent] = None
            for value in values:
                self._want(_FRAME_FIELDS[0], str(value), action)

    def _want(self, field: str, name: str, action: str) -> None:
        if field in _JOINT_FIELDS:
            self._wanted["joint"].setdefault(name, action)
        elif field in _FRAME_FIELDS:
            self._wanted["frame"].setdefault(name.removeprefix("/"), action)

    # --- what the robot says --------------------------------------------------------------------------------------

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
