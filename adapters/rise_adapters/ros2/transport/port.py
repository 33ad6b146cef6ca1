"""The narrow port between what RISE does on ROS 2 and the middleware that carries it (docs/explanation/ros2.md).

Below it stands a transport: `rclpy` where ROS is installed, `dds` (the Cyclone DDS wheel) where it is not. Both move
messages, as plain values, on topics and services; nothing else. Everything that is hard about actions (goal ids,
deadlines, cancelling, one ending for each goal) is written once, above the port, on the three services and two topics
that make up a ROS 2 action (https://design.ros2.org/articles/actions.html).

Types are named as ROS names them, `std_msgs/msg/String`, and so are those that an action implies:
`PKG/action/NAME_SendGoal` and `PKG/action/NAME_GetResult` are services, `PKG/action/NAME_FeedbackMessage` is a message.

Names are given as ROS takes them: relative ones get the node's namespace, and remappings apply to all of them, also to
the name of an action, before `/_action/...` is added to it (`action_topic` does that).

Threads: every method belongs to the thread of the asyncio loop that the transport was opened on, returns at once, and
every callback comes on that thread, never inside a call of the port.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal, Protocol, TypeAlias

from msgspec import Struct

from rise_engine.errors import RiseError

Message: TypeAlias = dict[str, Any]
"""A message by field name: numbers, texts and booleans; nested messages as dicts; arrays and sequences as lists, those
of `uint8` and `byte` as `bytes`. Fields that are left out of one that is sent have their zero value (the default of the
definition does not count). Received ones are complete."""

SendReply: TypeAlias = Callable[[Message], None]
"""Sends the answer to a request, at once or later; only the first call counts, and one that raises PortError does not
count."""


class QoS(Struct, frozen=True):
    """What a topic promises (the part of ROS's quality of service that is used here)."""

    depth: int = 10
    reliable: bool = True
    latched: bool = False
    """Transient local: who subscribes later gets the last `depth` messages."""


class RemoteEndpoint(Struct, frozen=True):
    """What another node has on a topic or a service, as it announces it to everybody."""

    node: str = ""
    """The full name of the node; empty when it is not known (yet)."""
    type: str = ""
    """As ROS names it; empty when it is no type of ROS. Of a service, `PKG/srv/NAME_Request` for what takes its
    requests and `PKG/srv/NAME_Response` for what answers."""
    hash: str = ""
    """Of that type, `RIHS01_...`; empty when it does not say."""
    vendor: str = ""
    """Whose software carries it, by the number that DDS gives out (`0110`); empty when that is not known."""
    qos: QoS | None = None
    """What it promises, or asks for; None: not known. (Of the depth others know nothing.)"""


RELIABLE = QoS()
SENSOR = QoS(reliable=False)
"""For subscriptions: this takes from every publisher, those that promise nothing included (cameras, trackers,
recognisers), of whom a reliable subscription hears nothing, without a word. But what is lost on the way is lost."""
STATUS = QoS(depth=1, latched=True)
"""Of an action's status topic."""


class PortError(RiseError):
    """Something cannot be had from this transport: a type that is not there, a message that does not fit. A sentence
    for a person."""


class Closable(Protocol):
    def close(self) -> None: ...


class Publisher(Protocol):
    def publish(self, message: Message) -> None:
        """Send. Raises PortError when the message does not fit its type."""
        ...

    def count_subscribers(self) -> int:
        """How many there are that take it."""
        ...

    def close(self) -> None: ...


class Subscription(Closable, Protocol):
    def publishers(self) -> int:
        """How many there are that it takes from: of its type, and promising what it asks for."""
        ...


class ServiceClient(Protocol):
    """Calls one service."""

    def count_servers(self) -> int:
        """How many offer it and could answer now; 0: a request would vanish."""
        ...

    def call(self, request: Message, answer: Callable[[Message], None]) -> None:
        """Send a request; `answer` gets what comes back, if anything ever does. Raises PortError as `publish` does."""
        ...

    def close(self) -> None:
        """No answers come any more."""
        ...


class Transport(Protocol):
    """One node on the wire."""

    @property
    def kind(self) -> Literal["rclpy", "dds", "memory"]: ...

    about: str
    """For a person: `rclpy, rmw_cyclonedds_cpp, domain 0`."""
    node: str
    """The node's full name, `/rise/engine`."""
    vendor: str
    """Whose software carries its messages, as in `End`; empty when that says nothing about who can talk to whom."""

    def resolve(self, name: str) -> str:
        """The full name that `name` (of a topic, service or action) has after namespace and remappings. Raises
        PortError for one that cannot be."""
        ...

    def publisher(self, topic: str, type: str, qos: QoS = RELIABLE) -> Publisher:
        """Publish messages of `type` on `topic`, until it is closed. Raises PortError: the name or the type cannot be,
        the middleware refuses, or the transport is closed. The same holds for the next three."""
        ...

    def subscribe(self, topic: str, type: str, taken: Callable[[Message], None], qos: QoS = RELIABLE) -> Subscription:
        """Have `taken` called with each message of `type` that comes on `topic`, until what is returned is closed. One
        that cannot be read is reported (to the loop's exception handler) and left out."""
        ...

    def serve(self, name: str, type: str, asked: Callable[[Message, SendReply], None]) -> Closable:
        """Offer the service `name` of `type`, `PKG/srv/NAME`, until what is returned is closed: `asked` gets each
        request, and with what to answer it, at once or later."""
        ...

    def client(self, name: str, type: str) -> ServiceClient:
        """Use the service `name` of `type`."""
        ...

    def fields(self, type: str) -> Mapping[str, str]:
        """A message type's fields and their types as ROS writes them (`string`, `float64[3]`,
        `geometry_msgs/msg/Point`, `string[]`). For an action, ask for `PKG/action/NAME_Goal`, `_Result` or `_Feedback`;
        for a service, `PKG/srv/NAME_Request` or `_Response`. Raises PortError, naming what is missing and from where it
        could come."""
        ...

    def type_hash(self, type: str) -> str:
        """The type's `RIHS01_...` (REP-2016), for an action and a service that of the whole; empty when not known."""
        ...

    def publisher_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        """What other nodes have that publishes on a topic."""
        ...

    def subscriber_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        """What other nodes have that listens to a topic."""
        ...

    def server_endpoints(self, service: str) -> list[RemoteEndpoint]:
        """What other nodes have that takes the requests of a service, and what they have that answers: two for each
        server. (Where the middleware does not list these, one, without more than its type.)"""
        ...

    def topics(self) -> list[str]:
        """The full names of the topics that other nodes publish on or listen to."""
        ...

    def programs_of_other_vendors(self) -> list[tuple[str, str]]:
        """Programs that other software than this one's carries: the node's full name (or whatever is known of it), and
        the vendor, as in `End`."""
        ...

    def nodes(self) -> list[str]:
        """Full names of all nodes that are seen, also this one."""
        ...

    def client_nodes(self, service: str) -> list[str]:
        """Full names of the other nodes that are seen to call a service; each may do so at any moment. (Whose request
        one is, ROS does not tell a server.)"""
        ...

    def failure(self) -> str:
        """Why the transport works no more (the middleware was shut down); empty while it does."""
        ...

    def close(self) -> None:
        """Let go of everything, and wait (shortly) for threads of its own. No callbacks after this."""
        ...


SEND_GOAL, CANCEL_GOAL, GET_RESULT = "send_goal", "cancel_goal", "get_result"
FEEDBACK, STATUS_TOPIC = "feedback", "status"

CANCEL_TYPE = "action_msgs/srv/CancelGoal"
STATUS_TYPE = "action_msgs/msg/GoalStatusArray"


def action_topic(action: str, part: str) -> str:
    """The hidden topic or service of an action. `action` must be resolved already."""
    return f"{action}/_action/{part}"


def action_types(type: str) -> dict[str, str]:
    """By part, the types that an action type `PKG/action/NAME` implies."""
    return {
        SEND_GOAL: f"{type}_SendGoal",
        GET_RESULT: f"{type}_GetResult",
        CANCEL_GOAL: CANCEL_TYPE,
        FEEDBACK: f"{type}_FeedbackMessage",
        STATUS_TOPIC: STATUS_TYPE,
    }
