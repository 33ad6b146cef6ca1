"""The narrow port between RISE and the middleware of ROS 2 (docs/explanation/ros2.md).

Below it is a transport: `rclpy` with a ROS installation, `dds` (the Cyclone DDS wheel) without one. Both only move
messages, as plain values, on topics and services. The code above the port implements actions once (goal ids, deadlines,
cancelling, one ending for each goal), on the three services and two topics of a ROS 2 action
(https://design.ros2.org/articles/actions.html).

Types have ROS's names, `std_msgs/msg/String`, and so do those that an action implies: `PKG/action/NAME_SendGoal` and
`PKG/action/NAME_GetResult` are services, `PKG/action/NAME_FeedbackMessage` is a message.

Names are those of ROS: relative ones get the node's namespace. Remappings apply to all of them, also to the name of an
action, before `action_topic` adds `/_action/...` to it.

Threads: every method belongs to the thread of the asyncio loop that the transport was opened on, and returns
immediately. Every callback runs on that thread, never inside a call of the port.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal, Protocol, TypeAlias

from msgspec import Struct

from rise_engine.base.errors import AdapterError

Message: TypeAlias = dict[str, Any]
"""A message by field name: numbers, texts and booleans; nested messages as dicts; arrays and sequences as lists, those
of `uint8` and `byte` as `bytes`. In a sent message, missing fields are zero (defaults of the definition have no
effect). Received messages are complete."""

SendReply: TypeAlias = Callable[[Message], None]
"""Sends the answer to a request, now or later. Only the first call counts; one that raises PortError does not."""


class QoS(Struct, frozen=True):
    """A topic's guarantees (the part of ROS's quality of service that is used here)."""

    depth: int = 10
    reliable: bool = True
    latched: bool = False
    """Transient local: later subscribers get the last `depth` messages."""


class RemoteEndpoint(Struct, frozen=True):
    """An endpoint of another node on a topic or a service, as announced."""

    node: str = ""
    """The full name of the node; empty: unknown (yet)."""
    type: str = ""
    """The type's name in ROS; empty: no type of ROS. For a service, `PKG/srv/NAME_Request` for the endpoint that
    receives requests and `PKG/srv/NAME_Response` for the one that answers."""
    hash: str = ""
    """The hash of that type, `RIHS01_...`; empty: not announced."""
    vendor: str = ""
    """The vendor of its software, by DDS's number (`0110`); empty: unknown."""
    qos: QoS | None = None
    """Its offer or request; None: unknown. (The depth is never announced.)"""
    program: bytes = b""
    """The id of its program, different after a restart (12 bytes, the prefix of the DDS GUID); empty: unknown."""


RELIABLE = QoS()
SENSOR = QoS(reliable=False)
"""For subscriptions: accepts every publisher, including unreliable ones (cameras, trackers, recognisers). A reliable
subscription would receive nothing from them, without an error. But lost messages stay lost."""
STATUS = QoS(depth=1, latched=True)
"""For an action's status topic."""


class PortError(AdapterError):
    """The transport cannot do this: a type is missing, a message does not fit, or a profile is not supported."""


class Closable(Protocol):
    """Something that is in use until it is closed."""

    def close(self) -> None:
        """Close it. No callback of it runs after that. A second call has no effect."""
        ...


class Publisher(Closable, Protocol):
    """Sends messages of one type on one topic."""

    def publish(self, message: Message) -> None:
        """Send one message to all present subscribers (latched: also to later ones).

        :param message: the fields by name; missing ones are zero.
        :raises PortError: it does not fit the type (the sentence names the field), or the middleware refuses.
        """
        ...

    def count_subscribers(self) -> int:
        """Count the subscriptions that it reaches now: of its type, and requesting no more than it guarantees.

        :returns: the number.
        """
        ...


class Subscription(Closable, Protocol):
    """Receives the messages of one type on one topic."""

    def count_publishers(self) -> int:
        """Count the publishers that reach it now: of its type, and with the guarantees that it requests.

        :returns: the number.
        """
        ...


class ServiceClient(Closable, Protocol):
    """Calls one service."""

    def count_servers(self) -> int:
        """Count the servers that would get a request now, and whose answer would arrive.

        :returns: the number; 0: a request would be lost.
        """
        ...

    def call(self, request: Message, on_response: Callable[[Message], None]) -> None:
        """Send a request.

        :param request: its fields by name, as for `Publisher.publish`.
        :param on_response: receives the response, if one arrives; there is no deadline.
        :raises PortError: as for `Publisher.publish`.
        """
        ...


class Transport(Protocol):
    """One node on the wire: its topics and services, and the visible parts of other nodes.

    Its publishers, subscriptions, services and clients are closed with it, if not before.
    """

    @property
    def kind(self) -> Literal["rclpy", "dds", "memory"]:
        """The kind of transport; `memory` is for tests."""
        ...

    about: str
    """For a person: `rclpy, rmw_cyclonedds_cpp, domain 0`."""
    node: str
    """The node's full name, `/rise/engine`."""
    vendor: str
    """The vendor of its software, as in `RemoteEndpoint`; empty: the vendor does not limit reachability."""

    # --- this node's endpoints ----------------------------------------------------------------------------------

    def resolve(self, name: str) -> str:
        """Apply the node's namespace and remappings to a name.

        :param name: the name of a topic, a service or an action in ROS's form: absolute, relative, or private (`~/x`).
        :returns: the full name, which begins with `/`.
        :raises PortError: it is not a valid ROS name.
        """
        ...

    def publisher(self, topic: str, type: str, qos: QoS = RELIABLE) -> Publisher:
        """Publish on a topic, until the returned publisher is closed.

        :param topic: its name, which is resolved.
        :param type: the type of the messages, `PKG/msg/NAME`.
        :param qos: the publisher's guarantees.
        :raises PortError: the name or type does not exist, the middleware refuses, or the transport is closed.
        """
        ...

    def subscribe(
        self,
        topic: str,
        type: str,
        on_message: Callable[[Message], None],
        qos: QoS = RELIABLE,
        pause: float = 0.0,
    ) -> Subscription:
        """Listen to a topic, until the returned subscription is closed.

        :param topic: its name, which is resolved.
        :param type: the type of the messages, `PKG/msg/NAME`.
        :param on_message: called with each message. An unreadable one is reported to the loop's exception handler and
            omitted.
        :param qos: the requested guarantees; publishers that guarantee less do not reach it.
        :param pause: seconds after reading in which nothing more is read. Then the newest messages are read, as many as
            the depth. This limits the cost of fast topics.
        :raises PortError: as `publisher`.
        """
        ...

    def serve(self, name: str, type: str, on_request: Callable[[Message, SendReply], None]) -> Closable:
        """Offer a service, until the returned object is closed.

        :param name: the service's name, which is resolved.
        :param type: the service's type, `PKG/srv/NAME`.
        :param on_request: called with each request and a function that sends its answer, now or later. An unreadable
            request is reported as in `subscribe`, and gets no answer.
        :raises PortError: as `publisher`.
        """
        ...

    def client(self, name: str, type: str) -> ServiceClient:
        """Use a service, until the returned client is closed. The service need not exist yet.

        :param name: the service's name, which is resolved.
        :param type: the service's type, `PKG/srv/NAME`.
        :raises PortError: as for `publisher`.
        """
        ...

    # --- types --------------------------------------------------------------------------------------------------

    def fields(self, type: str) -> Mapping[str, str]:
        """List the fields of a message type.

        :param type: `PKG/msg/NAME`; of an action `PKG/action/NAME_Goal`, `_Result` or `_Feedback`; of a service
            `PKG/srv/NAME_Request` or `_Response`.
        :returns: the type of each field by name, in the order of the definition and in ROS's spelling: `string`,
            `float64[3]`, `geometry_msgs/msg/Point`, `string[]`.
        :raises PortError: the type is not available; the sentence names the missing package and its possible source.
        """
        ...

    def type_hash(self, type: str) -> str:
        """Return the hash of a type as ROS announces it.

        :param type: as for `fields`, and also a whole action or service.
        :returns: `RIHS01_...` (REP-2016); empty when unknown.
        """
        ...

    # --- other nodes' endpoints ---------------------------------------------------------------------------------

    def graph_version(self) -> int | None:
        """Return whether the answers of the following calls may have changed.

        :returns: a number that increases with every visible change; None: unknown on this transport, so ask again.
        """
        ...

    def publisher_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        """List the endpoints of other nodes that publish on a topic.

        :param topic: its name, which is resolved.
        :raises PortError: it is not a valid ROS name.
        """
        ...

    def subscriber_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        """List the endpoints of other nodes that subscribe to a topic.

        :param topic: its name, which is resolved.
        :raises PortError: it is not a valid ROS name.
        """
        ...

    def server_endpoints(self, service: str) -> list[RemoteEndpoint]:
        """List the endpoints of other nodes that receive a service's requests, and those that answer.

        :param service: its name, which is resolved.
        :returns: two for each server. If the middleware does not list them, one with only its type.
        :raises PortError: it is not a valid ROS name.
        """
        ...

    def topics(self, ending: str = "") -> list[str]:
        """List the topics that other nodes publish on or subscribe to.

        :param ending: the ending of their names; empty: all topics.
        :returns: full names.
        """
        ...

    def programs_of_other_vendors(self) -> list[tuple[str, str]]:
        """List the programs that use another vendor's software.

        :returns: for each, the full name of its node (as far as known), and the vendor, as in `RemoteEndpoint`.
        """
        ...

    def nodes(self) -> list[str]:
        """List the full names of all visible nodes, including this one. A name that exists twice is listed twice."""
        ...

    def client_nodes(self, service: str) -> list[str]:
        """List the other nodes that visibly use a service; each may call it at any moment. (A request does not name its
        sender.)

        :param service: its name, which is resolved.
        :returns: full names, each once.
        :raises PortError: it is not a valid ROS name.
        """
        ...

    # --- lifetime -----------------------------------------------------------------------------------------------

    def failure(self) -> str:
        """Return why the transport no longer works (the middleware was shut down, or it was closed).

        :returns: a sentence for a person; empty while it works.
        """
        ...

    def close(self) -> None:
        """Close everything, and wait briefly for its own threads. No callback runs after this. A second call has no
        effect."""
        ...


SEND_GOAL, CANCEL_GOAL, GET_RESULT = "send_goal", "cancel_goal", "get_result"
FEEDBACK, STATUS_TOPIC = "feedback", "status"

CANCEL_TYPE = "action_msgs/srv/CancelGoal"
STATUS_TYPE = "action_msgs/msg/GoalStatusArray"


def action_topic(action: str, part: str) -> str:
    """Return the full name of a hidden topic or service of an action.

    :param action: the action's full name, already resolved.
    :param part: `SEND_GOAL`, `CANCEL_GOAL`, `GET_RESULT`, `FEEDBACK` or `STATUS_TOPIC`.
    """
    return f"{action}/_action/{part}"


def action_types(type: str) -> dict[str, str]:
    """Return the types that an action type implies.

    :param type: the action's type, `PKG/action/NAME`.
    :returns: by part (`SEND_GOAL`, ..., `STATUS_TOPIC`), the type of that service or topic.
    """
    return {
        SEND_GOAL: f"{type}_SendGoal",
        GET_RESULT: f"{type}_GetResult",
        CANCEL_GOAL: CANCEL_TYPE,
        FEEDBACK: f"{type}_FeedbackMessage",
        STATUS_TOPIC: STATUS_TYPE,
    }
