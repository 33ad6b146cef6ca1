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

from rise_engine.base.errors import AdapterError

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
    program: bytes = b""
    """What tells the program that has it from all others, also from itself after a restart (12 bytes, the prefix of
    the DDS GUID); empty when that is not known."""


RELIABLE = QoS()
SENSOR = QoS(reliable=False)
"""For subscriptions: this takes from every publisher, those that promise nothing included (cameras, trackers,
recognisers), of whom a reliable subscription hears nothing, without a word. But what is lost on the way is lost."""
STATUS = QoS(depth=1, latched=True)
"""Of an action's status topic."""


class PortError(AdapterError):
    """Something cannot be had from this transport: a type that is not there, a message that does not fit, a profile
    that it cannot carry."""


class Closable(Protocol):
    """Something that is in use until it is closed."""

    def close(self) -> None:
        """Let go of it; no callback of it comes any more. Closing it twice does nothing."""
        ...


class Publisher(Closable, Protocol):
    """Sends messages of one type on one topic."""

    def publish(self, message: Message) -> None:
        """Send one message to all who subscribe now (latched: and later).

        :param message: the fields by name; those that are left out are zero.
        :raises PortError: it does not fit the type, and the sentence names the field; or the middleware refuses.
        """
        ...

    def count_subscribers(self) -> int:
        """Count the subscriptions that it reaches now: of its type, and asking for no more than it promises.

        :returns: how many.
        """
        ...


class Subscription(Closable, Protocol):
    """Hears the messages of one type on one topic."""

    def count_publishers(self) -> int:
        """Count the publishers that it hears now: of its type, and promising what it asks for.

        :returns: how many.
        """
        ...


class ServiceClient(Closable, Protocol):
    """Calls one service."""

    def count_servers(self) -> int:
        """Count the servers that would get a request now, and whose answer would arrive.

        :returns: how many; 0: a request would vanish.
        """
        ...

    def call(self, request: Message, on_response: Callable[[Message], None]) -> None:
        """Send a request.

        :param request: its fields by name, as of `Publisher.publish`.
        :param on_response: gets the response, if ever one comes; there is no deadline here.
        :raises PortError: as `Publisher.publish`.
        """
        ...


class Transport(Protocol):
    """One node on the wire: what it sends, hears, offers and calls, and what it sees of other nodes.

    What it gives out (publishers, subscriptions, services, clients) is closed with it, if not before.
    """

    @property
    def kind(self) -> Literal["rclpy", "dds", "memory"]:
        """Which transport it is; `memory` is the one of the tests."""
        ...

    about: str
    """For a person: `rclpy, rmw_cyclonedds_cpp, domain 0`."""
    node: str
    """The node's full name, `/rise/engine`."""
    vendor: str
    """Whose software carries its messages, as in `RemoteEndpoint`; empty when that says nothing about who can talk to
    whom."""

    # --- what this node has -------------------------------------------------------------------------------------

    def resolve(self, name: str) -> str:
        """Apply the node's namespace and remappings to a name.

        :param name: of a topic, a service or an action, as ROS takes it: absolute, relative, or private (`~/x`).
        :returns: the full name, which begins with `/`.
        :raises PortError: it can be no name of ROS.
        """
        ...

    def publisher(self, topic: str, type: str, qos: QoS = RELIABLE) -> Publisher:
        """Publish on a topic, until what is returned is closed.

        :param topic: its name, which is resolved.
        :param type: of the messages, `PKG/msg/NAME`.
        :param qos: what the publisher promises.
        :raises PortError: there is no such name or type, the middleware refuses, or the transport is closed.
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
        """Hear a topic, until what is returned is closed.

        :param topic: its name, which is resolved.
        :param type: of the messages, `PKG/msg/NAME`.
        :param on_message: called with each message. One that cannot be read is reported to the loop's exception handler
            and left out.
        :param qos: what the subscription asks for; publishers that promise less are not heard.
        :param pause: seconds for which nothing is read after something was. Then the newest messages are read, as many
            as the depth. What is published a thousand times a second costs no more than that.
        :raises PortError: as `publisher`.
        """
        ...

    def serve(self, name: str, type: str, on_request: Callable[[Message, SendReply], None]) -> Closable:
        """Offer a service, until what is returned is closed.

        :param name: of the service, which is resolved.
        :param type: of the service, `PKG/srv/NAME`.
        :param on_request: called with each request and with what sends the answer to it, at once or later. One that
            cannot be read is reported as in `subscribe`, and has no answer.
        :raises PortError: as `publisher`.
        """
        ...

    def client(self, name: str, type: str) -> ServiceClient:
        """Use a service, until what is returned is closed. It need not be there.

        :param name: of the service, which is resolved.
        :param type: of the service, `PKG/srv/NAME`.
        :raises PortError: as `publisher`.
        """
        ...

    # --- types --------------------------------------------------------------------------------------------------

    def fields(self, type: str) -> Mapping[str, str]:
        """List the fields of a message type.

        :param type: `PKG/msg/NAME`; of an action `PKG/action/NAME_Goal`, `_Result` or `_Feedback`; of a service
            `PKG/srv/NAME_Request` or `_Response`.
        :returns: by name, in the order of the definition, the type as ROS writes it: `string`, `float64[3]`,
            `geometry_msgs/msg/Point`, `string[]`.
        :raises PortError: the type is not there; the sentence names what is missing and from where it could come.
        """
        ...

    def type_hash(self, type: str) -> str:
        """Give the hash of a type as ROS announces it.

        :param type: as for `fields`; for an action and a service also that of the whole.
        :returns: `RIHS01_...` (REP-2016); empty when it is not known.
        """
        ...

    # --- what others have ---------------------------------------------------------------------------------------

    def graph_version(self) -> int | None:
        """Tell whether what the following calls answer may have changed.

        :returns: a number that grows with every change of what is seen; None: this transport cannot tell, look again.
        """
        ...

    def publisher_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        """List what other nodes have that publishes on a topic.

        :param topic: its name, which is resolved.
        :raises PortError: it can be no name of ROS.
        """
        ...

    def subscriber_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        """List what other nodes have that subscribes to a topic.

        :param topic: its name, which is resolved.
        :raises PortError: it can be no name of ROS.
        """
        ...

    def server_endpoints(self, service: str) -> list[RemoteEndpoint]:
        """List what other nodes have that takes the requests of a service, and what they have that answers.

        :param service: its name, which is resolved.
        :returns: two for each server. Where the middleware does not list these, one, without more than its type.
        :raises PortError: it can be no name of ROS.
        """
        ...

    def topics(self, ending: str = "") -> list[str]:
        """List the topics that other nodes publish on or subscribe to.

        :param ending: of their names; empty: all of them.
        :returns: full names.
        """
        ...

    def programs_of_other_vendors(self) -> list[tuple[str, str]]:
        """List the programs that other software than this one's carries.

        :returns: of each the full name of its node (or whatever is known of it), and the vendor, as in
            `RemoteEndpoint`.
        """
        ...

    def nodes(self) -> list[str]:
        """List all nodes that are seen, also this one, by full name; a name that is there twice comes twice."""
        ...

    def client_nodes(self, service: str) -> list[str]:
        """List the other nodes that are seen to use a service; each may call it at any moment. (Whose request one is,
        ROS does not tell a server.)

        :param service: its name, which is resolved.
        :returns: full names, each once.
        :raises PortError: it can be no name of ROS.
        """
        ...

    # --- its life -----------------------------------------------------------------------------------------------

    def failure(self) -> str:
        """Say why the transport works no more (the middleware was shut down, or it was closed).

        :returns: a sentence for a person; empty while it works.
        """
        ...

    def close(self) -> None:
        """Close everything that it gave out, and wait (shortly) for threads of its own. No callback comes after this.
        Closing it twice does nothing."""
        ...


SEND_GOAL, CANCEL_GOAL, GET_RESULT = "send_goal", "cancel_goal", "get_result"
FEEDBACK, STATUS_TOPIC = "feedback", "status"

CANCEL_TYPE = "action_msgs/srv/CancelGoal"
STATUS_TYPE = "action_msgs/msg/GoalStatusArray"


def action_topic(action: str, part: str) -> str:
    """The full name of a hidden topic or service of an action.

    :param action: the action's full name, resolved already.
    :param part: `SEND_GOAL`, `CANCEL_GOAL`, `GET_RESULT`, `FEEDBACK` or `STATUS_TOPIC`.
    """
    return f"{action}/_action/{part}"


def action_types(type: str) -> dict[str, str]:
    """The types that an action type implies.

    :param type: of the action, `PKG/action/NAME`.
    :returns: by part (`SEND_GOAL`, ..., `STATUS_TOPIC`), the type of that service or topic.
    """
    return {
        SEND_GOAL: f"{type}_SendGoal",
        GET_RESULT: f"{type}_GetResult",
        CANCEL_GOAL: CANCEL_TYPE,
        FEEDBACK: f"{type}_FeedbackMessage",
        STATUS_TOPIC: STATUS_TYPE,
    }
