"""Whether a robot on ROS fits its profile: one answer for the session (before every goal, and while it watches the
robot) and for `rise-engine doctor`.

ROS 2 itself does not report that the two ends of a name do not fit. Another version of a type is filled with whatever
bytes arrive. With another quality of service, type or vendor, nothing arrives, although the other program is visible.
So this module compares each end of an action's names with this side: its type by name and hash (REP-2016), its vendor's
software, and its quality of service.
"""

from __future__ import annotations

from collections.abc import Iterable

from msgspec import Struct

from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.transport import vendors
from rise_adapters.ros2.transport.port import (
    CANCEL_GOAL,
    FEEDBACK,
    GET_RESULT,
    SEND_GOAL,
    STATUS_TOPIC,
    QoS,
    RemoteEndpoint,
    Transport,
    action_topic,
    action_types,
)

OTHER_TYPE, OTHER_VERSION = "other-type", "other-version"
OTHER_MIDDLEWARE, OTHER_QUALITY = "other-middleware", "other-quality"
"""The first words of a reason (docs/explanation/ros2.md)."""
MISMATCH_WORDS = {
    OTHER_TYPE: "offers other types than its profile names",
    OTHER_VERSION: "has other versions of types; rebuild both",
    OTHER_MIDDLEWARE: "uses other middleware; set RMW_IMPLEMENTATION",
    OTHER_QUALITY: "wants another quality of service",
}
"""The mismatch of a whole robot, short enough for a small screen."""
MISMATCH_KINDS = tuple(MISMATCH_WORDS)

SAME_RELEASE = "build its interface package from the same release on both sides, and start both again"


class Mismatch(Struct, frozen=True):
    """A difference of the other side that does not fit."""

    kind: str
    name: str
    """The full name of an action or topic, with which the sentence begins."""
    statement: str
    """The rest of the sentence, without a full stop."""
    remedy: str

    @property
    def sentence(self) -> str:
        return f"{self.name} {self.statement}"


class EndpointComparison(Struct):
    """The result for one action of a profile."""

    unusable: list[Mismatch] = []
    """Mismatches that forbid sending, or prevent everything sent from arriving."""
    unheard: list[Mismatch] = []
    """Mismatches that prevent some of its messages from arriving here. Sent messages do arrive."""
    seen: list[str] = []
    """The programs that have any part of it, for a person; empty: none."""
    programs: frozenset[bytes] = frozenset()
    """The programs that offer a part of an action (`RemoteEndpoint.program`), as far as they can be distinguished."""
    unannounced: bool = False
    """Whether the types cannot be compared: it does not announce their version, or this side's is unknown."""
    complete: bool = False
    """Whether every part was seen and compared. (Discovery finds them one by one, and messages may come before
    that.)"""

    @property
    def mismatches(self) -> list[Mismatch]:
        return self.unusable + self.unheard


def compare(transport: Transport, mapping: ActionMapping) -> EndpointComparison:
    """Compare the present endpoints with the profile's statements about one action."""
    found = _compare_topic(transport, mapping) if mapping.kind == "topic" else _compare_servers(transport, mapping)
    found.unusable, found.unheard = list(dict.fromkeys(found.unusable)), list(dict.fromkeys(found.unheard))
    found.seen = list(dict.fromkeys(found.seen))
    return found


def describe_absence(comparison: EndpointComparison, mapping: ActionMapping, full: str) -> str:
    """Why an action cannot be reached although `compare` found no mismatch: a sentence that names `full`."""
    if comparison.seen:
        return f"{full} is seen at {_join_names(comparison.seen)}, and cannot be reached: {_why_unreachable(mapping)}"
    return f"nothing {'listens to' if mapping.kind == 'topic' else 'offers'} {full}"


def describe_several_servers(count: int, full: str) -> str:
    """The sentence about an action that is offered more than once."""
    return f"{count} nodes offer {full}, so the robot would do everything {count} times"


def describe_uncompared(full: str) -> str:
    """The sentence about a side that does not announce its types."""
    return f"{full} does not say which version of its types it has, so the two sides cannot be compared"


def describe_mismatches(mismatches: Iterable[Mismatch]) -> str:
    """One text for a person about all mismatches, each cause once, with its remedy."""
    names: dict[tuple[str, str], list[str]] = {}
    for mismatch in mismatches:
        names.setdefault((mismatch.statement, mismatch.remedy), []).append(mismatch.name)
    return "; ".join(
        f"{first} {statement}{f' (and so with {_join_names(more)})' if more else ''}; {remedy}"
        for (statement, remedy), (first, *more) in names.items()
    )


# --- comparing ----------------------------------------------------------------------------------------------------


def _compare_servers(transport: Transport, mapping: ActionMapping) -> EndpointComparison:
    """Compare an action's three services and two topics, or one service."""
    full, is_action = transport.resolve(mapping.name), mapping.kind == "action"
    found = EndpointComparison()
    types = action_types(mapping.type) if is_action else {}
    services = {full: mapping.type}
    if is_action:
        services = {action_topic(full, part): types[part] for part in (SEND_GOAL, GET_RESULT, CANCEL_GOAL)}
    seen: set[tuple[str, bool]] = set()
    for service, type in services.items():
        for end in transport.server_endpoints(service):
            found.seen.append(describe_node(end.node))
            found.programs |= {end.program} - {b""}
            answers = end.type.endswith("_Response")
            seen.add((service, answers))
            wanted_type = f"{type}_{'Response' if answers else 'Request'}"
            mismatch = _middleware_mismatch(transport, full, end)
            mismatch = mismatch or _type_mismatch(transport, mapping, full, end, wanted_type, found)
            conflict = qos_conflict(end.qos, QoS()) if answers else qos_conflict(QoS(), end.qos)
            if mismatch is None and conflict is not None:
                does = (
                    f"answers {conflict.offered}"
                    if answers
                    else f"wants {'goals' if is_action else 'calls'} {conflict.wanted}"
                )
                mismatch = Mismatch(
                    OTHER_QUALITY, full, f"{does}, which no ROS service is", "correct it in the wrapper"
                )
            if mismatch is not None:
                found.unusable.append(mismatch)
    takes, answers_all = (all((service, answers) in seen for service in services) for answers in (False, True))
    found.complete = takes and (answers_all or not any(answers for _, answers in seen))
    topics = ((FEEDBACK, mapping.feedback_wanted), (STATUS_TOPIC, mapping.status_qos))
    for part, wanted in topics if is_action else ():
        for end in transport.publisher_endpoints(action_topic(full, part)):
            mismatch = _type_mismatch(transport, mapping, full, end, types[part], found)
            if mismatch is not None:
                found.unusable.append(mismatch)
            elif wanted is not None and (conflict := qos_conflict(end.qos, wanted)):
                statement = f"publishes its {part} {conflict.offered}, and this program wants it {conflict.wanted}"
                found.unheard.append(_qos_mismatch(full, statement, f"qos.{part}", conflict.for_reader))
    return found


def is_observer(node: str) -> bool:
    """Whether a node only records or shows messages: one of a bag, or a hidden one, such as `ros2 topic echo`."""
    return node.rpartition("/")[2].startswith(("rosbag2_", "_"))


def _compare_topic(transport: Transport, mapping: ActionMapping) -> EndpointComparison:
    full = transport.resolve(mapping.name)
    found = EndpointComparison()
    mismatches: list[Mismatch] = []
    fits = False
    for end in transport.subscriber_endpoints(full):
        if is_observer(end.node):
            continue
        found.seen.append(describe_node(end.node))
        mismatch = _type_mismatch(transport, mapping, full, end, mapping.type, found)
        if mismatch is None and (conflict := qos_conflict(mapping.topic_qos, end.qos)):
            statement = f"is wanted {conflict.wanted}{_describe_owner(end)}, and is published here {conflict.offered}"
            mismatch = _qos_mismatch(full, statement, "qos", conflict.for_writer)
        if mismatch is None:
            fits = True
        elif mismatch.kind == OTHER_VERSION:
            found.unusable.append(mismatch)
        else:
            mismatches.append(mismatch)
    found.complete = bool(found.seen)
    if not fits:  # otherwise these only listen
        found.unusable += mismatches
    return found


def _middleware_mismatch(transport: Transport, full: str, end: RemoteEndpoint) -> Mismatch | None:
    if vendors.services_cross(transport.vendor, end.vendor) != "no":
        return None
    statement = (
        f"is offered{_describe_owner(end)} over {vendors.vendor_name(end.vendor)}, and this program uses "
        f"{vendors.vendor_name(transport.vendor)}: services and actions do not cross from one to the other"
    )
    return Mismatch(OTHER_MIDDLEWARE, full, statement, same_middleware_remedy(transport, end.vendor))


def same_middleware_remedy(transport: Transport, other: str) -> str:
    """The remedy for two vendors."""
    own, theirs = vendors.rmw_of_vendor(transport.vendor), vendors.rmw_of_vendor(other)
    there = f"start the robot's program with RMW_IMPLEMENTATION={own} on its computer" if own else ""
    if not theirs:
        return there or "use the same middleware on both sides"
    rclpy = "--ros rclpy and " if transport.kind == "dds" else ""
    here = f"start this program with {rclpy}RMW_IMPLEMENTATION={theirs} on this one"
    return f"{there}, or {here}" if there else here


def _type_mismatch(
    transport: Transport,
    mapping: ActionMapping,
    full: str,
    end: RemoteEndpoint,
    wanted: str,
    found: EndpointComparison,
) -> Mismatch | None:
    """Compare one end's type with `wanted`, and note missing announcements in `found`. `full`: the mapping's full
    name."""
    verb = "taken" if mapping.kind == "topic" else "offered"
    if end.type != wanted:
        there = ros_type(end.type) or "something that is not a ROS type"
        remedy = "correct `carrier.type` in the robot's profile, or start the wrapper that fits it"
        return Mismatch(OTHER_TYPE, full, f"is {verb} as {there}, not as {mapping.type}", remedy)
    own = transport.type_hash(wanted)
    if not own or not end.hash:
        found.unannounced = True
    elif end.hash not in (own, transport.type_hash(_service_of(wanted))):  # some announce the service's hash
        what = mapping.type if wanted.startswith(mapping.type) else ros_type(wanted)
        statement = f"is {verb}{_describe_owner(end)} with another version of {what}"
        return Mismatch(OTHER_VERSION, full, statement, SAME_RELEASE)
    return None


def _service_of(type: str) -> str:
    """The service of this request or response; other types unchanged."""
    return type.removesuffix("_Request").removesuffix("_Response")


def ros_type(type: str) -> str:
    """The type in people's spelling, for a part of an action or service."""
    type = _service_of(type)
    for ending in ("_SendGoal", "_GetResult", "_FeedbackMessage"):
        type = type.removesuffix(ending)
    return type


class QosConflict(Struct, frozen=True):
    """Why a reader receives nothing from a writer."""

    offered: str
    """The writer's offer in words."""
    wanted: str
    """The reader's request in words."""
    for_reader: str
    """The remedy on the reader's side."""
    for_writer: str
    """The remedy on the writer's side."""


_BEST_EFFORT = QosConflict("as best effort", "reliably", 'reliability = "best_effort"', 'reliability = "reliable"')
_LATCHED = "with what was said before (transient local)"
_VOLATILE = QosConflict("as volatile", _LATCHED, 'durability = "volatile"', 'durability = "transient_local"')


def qos_conflict(offered: QoS | None, wanted: QoS | None) -> QosConflict | None:
    """Why a reader that requests `wanted` gets nothing from a writer that offers `offered`; None: it does, or
    unknown."""
    if offered is None or wanted is None:
        return None
    if wanted.reliable and not offered.reliable:
        return _BEST_EFFORT
    return _VOLATILE if wanted.latched and not offered.latched else None


def _qos_mismatch(full: str, statement: str, key: str, setting: str) -> Mismatch:
    remedy = f"write `{key} = {{ {setting} }}` into the carrier in the robot's profile, or change it in the wrapper"
    return Mismatch(OTHER_QUALITY, full, statement, remedy)


# --- words --------------------------------------------------------------------------------------------------------


def _why_unreachable(mapping: ActionMapping) -> str:
    if mapping.kind == "action":
        return "one of its services is missing, or has a deadline or liveliness that this program does not promise"
    if mapping.kind == "service":
        return "it has a deadline or liveliness that this program does not promise"
    return "it wants a deadline or liveliness that this program does not promise"


def describe_node(name: str) -> str:
    if name.startswith("/"):
        return f"the node {name}"
    return f"a program {name or 'whose node is not known'}"


def _describe_owner(end: RemoteEndpoint) -> str:
    """The owner, which is announced separately, and perhaps later or never."""
    return f" by {describe_node(end.node)}" if end.node else ""


def _join_names(names: Iterable[str]) -> str:
    *others, last = names
    return f"{', '.join(others)} and {last}" if others else last
