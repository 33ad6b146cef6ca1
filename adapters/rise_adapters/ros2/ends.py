"""Whether what a robot has on ROS fits what a carrier says: one answer, in one set of sentences, for the session
(before every goal, and while it looks after the robot), for `rise-engine doctor`, and for whoever asks next.

ROS 2 itself says nothing when the two ends of a name do not fit. Another version of a type is filled with whatever
bytes come; another quality of service, another type or another vendor's middleware is silence, although the other
program can be seen. So each end that somebody has on the names of a carrier is compared with this side's: its type
by name and by hash (REP-2016), whose software carries it, and its quality of service.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from msgspec import Struct

from rise_adapters.ros2 import vendors
from rise_adapters.ros2.port import (
    CANCEL_GOAL,
    FEEDBACK,
    GET_RESULT,
    SEND_GOAL,
    STATUS_TOPIC,
    End,
    QoS,
    Transport,
    action_topic,
    action_types,
)

if TYPE_CHECKING:
    from rise_adapters.ros2.carriers import Carrier

OTHER_TYPE, OTHER_VERSION, OTHER_MIDDLEWARE, OTHER_QUALITY = (
    "other-type",
    "other-version",
    "other-middleware",
    "other-quality",
)
"""Words that a reason begins with (docs/explanation/ros2.md)."""
IN_SHORT = {
    OTHER_TYPE: "offers other types than its profile names",
    OTHER_VERSION: "has other versions of types; build both anew",
    OTHER_MIDDLEWARE: "uses other middleware; set RMW_IMPLEMENTATION",
    OTHER_QUALITY: "wants another quality of service",
}
"""What a whole robot is or does of which nothing fits, as short as a small screen needs it."""
WORDS = tuple(IN_SHORT)

_SAME_RELEASE = "build its interface package from the same release on both sides, and start both again"


class Misfit(Struct, frozen=True):
    """Something of the other side that does not fit."""

    word: str
    name: str
    """What it is about, the full name of an action or topic, with which the sentence begins."""
    says: str
    """The rest of the sentence, without a full stop."""
    remedy: str

    @property
    def sentence(self) -> str:
        return f"{self.name} {self.says}"


class Look(Struct, frozen=True):
    """What was found of one carrier's other side."""

    wrong: tuple[Misfit, ...] = ()
    """Because of these nothing may be sent to it, or nothing sent would arrive."""
    unheard: tuple[Misfit, ...] = ()
    """Because of these some of what it says would not be heard; what is sent arrives."""
    seen: tuple[str, ...] = ()
    """Whose programs have any of it, for a person; empty when nobody has."""
    unannounced: bool = False
    """It does not say which version of its types it has, or that is not known of this side's: nobody can compare."""
    whole: bool = False
    """Everything that it must have to be of use has been seen, and so was compared. (Discovery brings one after the
    other, and the middleware may let messages pass before it lists who they come from.)"""

    @property
    def all(self) -> tuple[Misfit, ...]:
        return self.wrong + self.unheard


NOTHING = Look()


def look(wire: Transport, carrier: Carrier) -> Look:
    """Compare what is there now with what the carrier says."""
    found = _action(wire, carrier) if carrier.kind == "action" else _topic(wire, carrier)
    return Look(
        tuple(dict.fromkeys(found.wrong)),
        tuple(dict.fromkeys(found.unheard)),
        tuple(map(_node, found.nodes)),
        found.unannounced,
        found.whole,
    )


def nothing(look: Look, carrier: Carrier, full: str) -> str:
    """Why nothing of a carrier can be reached, where `look` found nothing wrong: the sentence, which names `full`."""
    if look.seen:
        return f"{full} is seen at {_listed(look.seen)}, and cannot be reached: {_cannot_be_reached(carrier)}"
    return f"nothing {'offers' if carrier.kind == 'action' else 'listens to'} {full}"


def elsewhere(wire: Transport, carrier: Carrier) -> list[str]:
    """The full names under which others offer an action of the carrier's type (listen to a topic of it)."""
    own = wire.resolve(carrier.name)
    names: list[str] = []
    for topic in wire.topics():
        if carrier.kind == "action":
            name = topic.removesuffix(action_topic("", FEEDBACK))
            found = wire.publisher_ends(topic) if name != topic else []
        else:
            name, found = topic, wire.subscriber_ends(topic)
        if name != own and any(_whole(end.type) == carrier.type for end in found):
            names.append(name)
    return names


def several(count: int, full: str) -> str:
    """The sentence about an action that is offered more than once."""
    return f"{count} nodes offer {full}, so the robot would do everything {count} times"


def uncompared(full: str) -> str:
    """The sentence about an other side that does not say what its types are."""
    return f"{full} does not say which version of its types it has, so nobody can tell whether it is that of this side"


def together(misfits: Iterable[Misfit]) -> str:
    """One text for a person of what is wrong, each cause once, with what to do."""
    names: dict[tuple[str, str], list[str]] = {}
    for misfit in misfits:
        names.setdefault((misfit.says, misfit.remedy), []).append(misfit.name)
    return "; ".join(
        f"{first} {says}{f' (and so with {_listed(more)})' if more else ''}; {remedy}"
        for (says, remedy), (first, *more) in names.items()
    )


def strangers(wire: Transport) -> list[str]:
    """A sentence about each program that can be seen but not be talked to as ROS wants it."""
    return [
        f"{_node(who)} uses {vendors.called(vendor)}: topics may arrive, services and actions "
        f"{'do' if vendors.services_cross(wire.vendor, vendor) == 'no' else 'may'} not. "
        f"What to do: {_one_middleware(wire, vendor)}"
        for who, vendor in wire.strangers()
    ]


def other_versions(wire: Transport, topic: str, type: str) -> list[str]:
    """Who publishes a topic with another version of `type` than this side's: a sentence for each."""
    own, full = wire.type_hash(type), wire.resolve(topic)
    return [
        f"{_node(end.node)} publishes {full} with another version of {type} than this node listens for: what arrives "
        f"would be garbage. What to do: {_SAME_RELEASE}"
        for end in wire.publisher_ends(topic)
        if end.type == type and own and end.hash and end.hash != own
    ]


def topic_misfits(wire: Transport, topic: str) -> list[str]:
    """Of what other nodes have on one topic, who does not hear whom, and who would hear garbage: a sentence for each
    pair."""
    found: dict[str, None] = {}
    for publisher in wire.publisher_ends(topic):
        for listener in wire.subscriber_ends(topic):
            who, whom = _node(publisher.node), _node(listener.node)
            if publisher.type != listener.type:
                if publisher.type and listener.type:
                    what = f"{who} publishes {topic} as {publisher.type}, and {whom} listens for {listener.type}"
                    found[f"{what}: nothing arrives"] = None
            elif publisher.hash and listener.hash and publisher.hash != listener.hash:
                what = f"{who} publishes {topic} with another version of {publisher.type} than {whom} listens for"
                found[f"{what}: what arrives is garbage"] = None
            elif lacks := _lacks(publisher.qos, listener.qos):
                found[f"{who} publishes {topic} {lacks[0]}, and {whom} wants it {lacks[1]}: nothing arrives"] = None
    return list(found)


# --- comparing ----------------------------------------------------------------------------------------------------


class _Found:
    def __init__(self, full: str, verb: str) -> None:
        self.full = full
        self.verb = verb
        """What the other side does with it: it is `offered` or `taken`."""
        self.wrong: list[Misfit] = []
        self.unheard: list[Misfit] = []
        self.unannounced = False
        self.whole = False
        self.nodes: dict[str, None] = {}


def _action(wire: Transport, carrier: Carrier) -> _Found:
    full = wire.resolve(carrier.name)
    found, types = _Found(full, "offered"), action_types(carrier.type)
    services = (SEND_GOAL, GET_RESULT, CANCEL_GOAL)
    seen: set[tuple[str, bool]] = set()
    for part in services:
        asked, answered = f"{types[part]}_Request", f"{types[part]}_Response"
        for end in wire.server_ends(action_topic(full, part)):
            found.nodes[end.node] = None
            answers = end.type.endswith("_Response")
            seen.add((part, answers))
            misfit = _other_middleware(wire, full, end) or _other_type(
                wire, found, carrier.type, end, answered if answers else asked
            )
            if misfit is None and (lacks := _lacks(end.qos, QoS()) if answers else _lacks(QoS(), end.qos)):
                does = f"answers {lacks[0]}" if answers else f"wants goals {lacks[1]}"
                misfit = Misfit(OTHER_QUALITY, full, f"{does}, which no service of ROS is", "correct it in the wrapper")
            if misfit is not None:
                found.wrong.append(misfit)
    takes, answers_all = (all((part, answers) in seen for part in services) for answers in (False, True))
    found.whole = takes and (answers_all or not any(answers for _, answers in seen))
    for part, wanted in ((FEEDBACK, carrier.feedback_qos), (STATUS_TOPIC, carrier.status_qos)):
        for end in wire.publisher_ends(action_topic(full, part)):
            misfit = _other_type(wire, found, carrier.type, end, types[part])
            if misfit is not None:
                found.wrong.append(misfit)
            elif lacks := _lacks(end.qos, wanted):
                says = f"publishes its {part} {lacks[0]}, and here it is wanted {lacks[1]}"
                found.unheard.append(_quality(full, says, f"qos.{part}", lacks[2]))
    return found


def _topic(wire: Transport, carrier: Carrier) -> _Found:
    full = wire.resolve(carrier.name)
    found = _Found(full, "taken")
    misfits: list[Misfit] = []
    fits = False
    for end in wire.subscriber_ends(full):
        found.nodes[end.node] = None
        misfit = _other_type(wire, found, carrier.type, end, carrier.type)
        if misfit is None and (lacks := _lacks(carrier.topic_qos, end.qos)):
            says = f"is wanted {lacks[1]}{_by(end)}, and is published here {lacks[0]}"
            misfit = _quality(full, says, "qos", lacks[3])
        if misfit is None:
            fits = True
        elif misfit.word == OTHER_VERSION:
            found.wrong.append(misfit)
        else:
            misfits.append(misfit)
    found.whole = bool(found.nodes)
    if not fits:  # else these are somebody's who listens, too, as `ros2 topic echo` does
        found.wrong += misfits
    return found


def _other_middleware(wire: Transport, full: str, end: End) -> Misfit | None:
    if vendors.services_cross(wire.vendor, end.vendor) != "no":
        return None
    says = (
        f"is offered{_by(end)} over {vendors.called(end.vendor)}, and this program uses "
        f"{vendors.called(wire.vendor)}: services and actions do not cross from one to the other"
    )
    return Misfit(OTHER_MIDDLEWARE, full, says, _one_middleware(wire, end.vendor))


def _one_middleware(wire: Transport, other: str) -> str:
    """What to do about two vendors."""
    own, theirs = vendors.rmw(wire.vendor), vendors.rmw(other)
    there = f"start the robot's program with RMW_IMPLEMENTATION={own} on its computer" if own else ""
    if not theirs:
        return there or "use the same middleware on both sides"
    rclpy = "--ros rclpy and " if wire.kind == "dds" else ""
    here = f"start this program with {rclpy}RMW_IMPLEMENTATION={theirs} on this one"
    return f"{there}, or {here}" if there else here


def _other_type(wire: Transport, found: _Found, named: str, end: End, wanted: str) -> Misfit | None:
    """`named`: as the profile names the type; `wanted`: what of it this end has to carry."""
    if end.type != wanted:
        there = _whole(end.type) or "something that is no type of ROS"
        remedy = "correct `carrier.type` in the robot's profile, or start the wrapper that fits it"
        return Misfit(OTHER_TYPE, found.full, f"is {found.verb} as {there}, not as {named}", remedy)
    own = wire.type_hash(wanted)
    if not own or not end.hash:
        found.unannounced = True
    elif end.hash not in (own, wire.type_hash(_service(wanted))):  # some middleware announces that of the service
        what = named if wanted.startswith(named) else _whole(wanted)
        says = f"is {found.verb}{_by(end)} with another version of {what}"
        return Misfit(OTHER_VERSION, found.full, says, _SAME_RELEASE)
    return None


def _service(type: str) -> str:
    """The service that this is the request or the response of; other types as they are."""
    return type.removesuffix("_Request").removesuffix("_Response")


def _whole(type: str) -> str:
    """Of a part of an action or service, the type that people write."""
    type = _service(type)
    for ending in ("_SendGoal", "_GetResult", "_FeedbackMessage"):
        type = type.removesuffix(ending)
    return type


def _lacks(offered: QoS | None, wanted: QoS | None) -> tuple[str, str, str, str] | None:
    """Why a reader that wants `wanted` hears nothing of a writer that offers `offered`: how the one offers it and how
    the other wants it, in words; and what to write on the reader's and on the writer's side. None: it hears."""
    if offered is None or wanted is None:
        return None
    if wanted.reliable and not offered.reliable:
        return "as best effort", "reliably", 'reliability = "best_effort"', 'reliability = "reliable"'
    if wanted.latched and not offered.latched:
        return (
            "as volatile",
            "with what was said before (transient local)",
            'durability = "volatile"',
            'durability = "transient_local"',
        )
    return None


def _quality(full: str, says: str, key: str, setting: str) -> Misfit:
    remedy = f"write `{key} = {{ {setting} }}` into the carrier in the robot's profile, or change it in the wrapper"
    return Misfit(OTHER_QUALITY, full, says, remedy)


# --- words --------------------------------------------------------------------------------------------------------


def _cannot_be_reached(carrier: Carrier) -> str:
    if carrier.kind == "action":
        return "one of its services is missing, or has a deadline or liveliness that this program does not promise"
    return "it wants a deadline or liveliness that this program does not promise"


def _node(name: str) -> str:
    if name.startswith("/"):
        return f"the node {name}"
    return f"a program {name or 'whose node is not known'}"


def _by(end: End) -> str:
    """Whose it is. (That is announced separately, and may come later or never.)"""
    return f" by {_node(end.node)}" if end.node else ""


def _listed(names: Iterable[str]) -> str:
    return " and ".join(_with_commas(list(names)))


def _with_commas(names: list[str]) -> Iterator[str]:
    if len(names) > 1:
        yield ", ".join(names[:-1])
    yield from names[-1:]
