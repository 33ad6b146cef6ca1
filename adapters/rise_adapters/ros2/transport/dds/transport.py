"""ROS 2 without a ROS installation: the port over Cyclone DDS (the `cyclonedds` wheel), compatible with rmw_cyclonedds.

Nodes on the other side must use `RMW_IMPLEMENTATION=rmw_cyclonedds_cpp`. With another, topics may arrive, but services
and actions do not (`DdsTransport.programs_of_other_vendors` lists such programs).

Each program announces the time until its death is noticed. This transport has a lease of one second (`domain`). Other
programs need `<Discovery><LeaseDuration>1s</LeaseDuration></Discovery>` in their own CYCLONEDDS_URI, or it takes 10
seconds. A program that ends in order announces its end.

It also reads the arguments after `--ros-args`: remappings, as in every ROS 2 program
(https://design.ros2.org/articles/ros_command_line_arguments.html). The rclpy transport leaves this to rclpy.
"""

from __future__ import annotations

import asyncio
import logging
import os
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal

from msgspec import Struct

from rise_adapters.ros2.transport import vendors
from rise_adapters.ros2.transport.dds import graph, names
from rise_adapters.ros2.transport.dds.domain import read_domain_id
from rise_adapters.ros2.transport.dds.names import dds_topic
from rise_adapters.ros2.transport.dds.node import DdsNode
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog
from rise_adapters.ros2.transport.names import NameResolver
from rise_adapters.ros2.transport.port import RELIABLE, Message, PortError, QoS, RemoteEndpoint, SendReply

# --- arguments of ROS -------------------------------------------------------------------------------------------------

# Arguments that are valid for ROS and have no effect here: logging, and parameters, which `parameters` has read.
_WITH_VALUE = {"--params-file", "--log-level", "--log-config-file", "--log-file-name", "-e", "--enclave"}
_FLAGS = {
    *("--disable-stdout-logs", "--enable-stdout-logs", "--disable-rosout-logs", "--enable-rosout-logs"),
    *("--disable-external-lib-logs", "--enable-external-lib-logs"),
}


class RosArguments(Struct, frozen=True):
    node: str
    namespace: str = "/"
    remaps: tuple[tuple[str, str], ...] = ()
    """The replacements for that node's topics, services and actions. The first match counts."""


def parse_ros_arguments(arguments: Sequence[str], node: str) -> RosArguments:
    """Read the arguments, with or without a leading `--ros-args` and a closing `--`. `node` is the program's own name
    for its node, for rules such as `rise:__ns:=/lab`. Raises PortError with a sentence."""
    remaps: list[tuple[str, str, str]] = []
    special: dict[str, str] = {}
    rest = iter(arguments)
    for argument in rest:
        if argument in ("--ros-args", "--", *_FLAGS):
            continue
        if argument in ("-r", "--remap"):
            only_for, source, target = _parse_remap(_next_value(argument, rest))
            if source not in ("__ns", "__node", "__name"):
                remaps.append((only_for, source, target))
            elif only_for in ("", node):
                special.setdefault("__node" if source == "__name" else source, target)
        elif argument in ("-p", "--param"):
            value = _next_value(argument, rest)
            if ":=" not in value:
                raise PortError(f"--ros-args: {value!r} is not a parameter; one looks like name:=value")
        elif argument in _WITH_VALUE:
            _next_value(argument, rest)
        else:
            hint = "; did you forget -r before it?" if ":=" in argument else ""
            raise PortError(f"--ros-args: {argument!r} is not understood{hint}")
    namespace = special.get("__ns", "/")
    if not namespace.startswith("/"):
        raise PortError(f"--ros-args: the namespace {namespace!r} must begin with a slash")
    name = special.get("__node", node)
    return RosArguments(name, namespace, tuple((source, to) for only, source, to in remaps if only in ("", name)))


def _next_value(option: str, rest: Iterator[str]) -> str:
    value = next(rest, None)
    if value is None:
        raise PortError(f"--ros-args: something must follow {option}")
    return value


def _parse_remap(rule: str) -> tuple[str, str, str]:
    """Parse `[node:]from:=to` into the node (empty: all), from, to."""
    source, separator, target = rule.partition(":=")
    if not separator or not source or not target:
        raise PortError(f"--ros-args: {rule!r} is not a remapping; one looks like from:=to")
    node, _, name = source.rpartition(":")
    if "://" in source:
        raise PortError(f"--ros-args: {rule!r}: remappings of rostopic:// and rosservice:// are not supported")
    return node, name, target


# --- topics -----------------------------------------------------------------------------------------------------------


class DdsPublisher:
    """Implements `port.Publisher`."""

    def __init__(self, node: DdsNode, topic: str, type: str, qos: QoS) -> None:
        """`topic`: the full name. Raises PortError like `DdsNode.open_writer`."""
        self._node = node
        self._codec = node.types.codec(type)
        self._writer = node.open_writer(dds_topic(topic), type, qos)

    def publish(self, message: Message) -> None:
        self._writer.write(self._codec.pack(message))

    def count_subscribers(self) -> int:
        return len(self._writer.matched_readers())

    def close(self) -> None:
        self._node.release(self._writer)


class DdsSubscription:
    """Implements `port.Subscription`."""

    def __init__(
        self, node: DdsNode, topic: str, type: str, on_message: Callable[[Message], None], qos: QoS, pause: float
    ) -> None:
        """Like `DdsPublisher`."""
        self._node = node
        self._codec = node.types.codec(type)
        self._on_message = on_message
        self._reader = node.open_reader(dds_topic(topic), type, qos, self._on_sample, pause=pause)

    def count_publishers(self) -> int:
        return len(self._reader.matched_writers())

    def close(self) -> None:
        self._node.release(self._reader)

    def _on_sample(self, sample: tuple[bytes, Any]) -> None:
        data, info = sample
        if info.valid_data:
            self._on_message(self._codec.unpack(data))


class DdsTransport:
    """Implements `port.Transport`. All methods belong to the loop's thread."""

    kind: Literal["dds"] = "dds"

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        *,
        node: str,
        arguments: Sequence[str] = (),
        share: Sequence[str | Path] = (),
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        """`node`: its name, unless `arguments` (those after `--ros-args`) set another. `share`: additional folders of
        definitions. Raises PortError with a sentence."""
        given = parse_ros_arguments(arguments, node)
        self._names = NameResolver(given.node, given.namespace, given.remaps)
        self._types = InterfaceCatalog(share, environment)
        self.node = self._names.node
        self.vendor = vendors.CYCLONE
        domain = read_domain_id(environment)
        self.about = f"dds, Cyclone DDS {version('cyclonedds')} without ROS, domain {domain}"
        self._dds = DdsNode(loop, self.node, self._types, domain, environment)

    # --- topics and services ------------------------------------------------------------------------------------

    def publisher(self, topic: str, type: str, qos: QoS = RELIABLE) -> DdsPublisher:
        return DdsPublisher(self._dds, self.resolve(topic), type, qos)

    def subscribe(
        self,
        topic: str,
        type: str,
        on_message: Callable[[Message], None],
        qos: QoS = RELIABLE,
        pause: float = 0.0,
    ) -> DdsSubscription:
        return DdsSubscription(self._dds, self.resolve(topic), type, on_message, qos, pause)

    def serve(self, name: str, type: str, on_request: Callable[[Message, SendReply], None]) -> DdsServer:
        return DdsServer(self._dds, self.resolve(name), type, on_request)

    def client(self, name: str, type: str) -> DdsClient:
        return DdsClient(self._dds, self.resolve(name), type)

    # --- the graph ----------------------------------------------------------------------------------------------

    def resolve(self, name: str) -> str:
        return self._names.resolve(name)

    def fields(self, type: str) -> dict[str, str]:
        return self._types.fields(type)

    def type_hash(self, type: str) -> str:
        try:
            return self._types.type_hash(type)
        except PortError:
            return ""

    def graph_version(self) -> int:
        return self._dds.graph.version

    def publisher_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        return self._dds.graph.find_writers(names.dds_topic(self.resolve(topic)))

    def subscriber_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        return self._dds.graph.find_readers(names.dds_topic(self.resolve(topic)))

    def server_endpoints(self, service: str) -> list[RemoteEndpoint]:
        full = self.resolve(service)
        return [
            *self._dds.graph.find_readers(names.request_topic(full)),
            *self._dds.graph.find_writers(names.reply_topic(full)),
        ]

    def topics(self, ending: str = "") -> list[str]:
        return self._dds.graph.topics(ending)

    def nodes(self) -> list[str]:
        return self._dds.graph.nodes()

    def programs_of_other_vendors(self) -> list[tuple[str, str]]:
        return self._dds.graph.programs_of_other_vendors()

    def client_nodes(self, service: str) -> list[str]:
        return self._dds.graph.find_writer_nodes(names.request_topic(self.resolve(service)))

    def failure(self) -> str:
        return "the transport is closed" if self._dds.closed else self._dds.reader_thread.failure

    def close(self) -> None:
        self._dds.close()


# --- services ---------------------------------------------------------------------------------------------------------

# As in rmw_cyclonedds: a topic for requests and one for replies. Every message begins with its client's id and a
# number. Ids in the user data pair writers and readers.


_HEADER = struct.Struct("<Qq")
_BODY = 4 + _HEADER.size
_QOS = QoS(depth=1000)
"""For requests and replies. ROS has a depth of 10; this affects only this side's memory."""
_UNANSWERED = 10_000
"""Maximum number of requests that wait for answers. Beyond this, the oldest is forgotten."""
_ANSWER_KEPT_SECONDS = 1.0
"""Seconds that an answer waits for a client whose reader is not visible yet."""
_RETRY_SECONDS = 0.005
_LOG = logging.getLogger(__name__)


class DdsClient:
    """Implements `port.ServiceClient`."""

    def __init__(self, node: DdsNode, name: str, type: str) -> None:
        """`name`: the full name. Raises PortError like `DdsNode.open_writer`."""
        self._node = node
        self._request = node.types.codec(f"{type}_Request")
        self._response = node.types.codec(f"{type}_Response")
        self._waiting: dict[int, Callable[[Message], None]] = {}
        self._number = 0
        self._matched_handles: tuple[list[int], list[int]] | None = None
        """The other ends at the last check, if all were known."""
        self._count = 0
        ids = {"clientid": node.new_service_id()}
        self._reader = node.open_reader(names.reply_topic(name), self._response.type, _QOS, self._on_sample, ids)
        self._writer = node.open_writer(names.request_topic(name), self._request.type, _QOS, ids)

    def count_servers(self) -> int:
        handles = taking, answering = self._writer.matched_readers(), self._reader.matched_writers()
        if handles != self._matched_handles:
            takers = [graph.find_matched_reader(self._writer.handle, handle) for handle in taking]
            answerers = [graph.find_matched_writer(self._reader.handle, handle) for handle in answering]
            self._count = _count_pairs(
                _list_service_ids(takers, self._request.type), _list_service_ids(answerers, self._response.type)
            )
            # This is called before each goal, and rarely changes. Unknown ends are looked up again.
            self._matched_handles = handles if None not in (*takers, *answerers) else None
        return self._count

    def call(self, request: Message, on_response: Callable[[Message], None]) -> None:
        self._number += 1
        data = self._request.pack(request, _HEADER.pack(self._writer.instance, self._number))
        if len(self._waiting) >= _UNANSWERED:
            del self._waiting[next(iter(self._waiting))]
        self._waiting[self._number] = on_response
        self._writer.write(data)

    def close(self) -> None:
        self._waiting.clear()
        self._node.release(self._writer, self._reader)

    def _on_sample(self, sample: tuple[bytes, Any]) -> None:
        data, info = sample
        if not info.valid_data or len(data) < _BODY:
            return
        client, number = _HEADER.unpack_from(data, 4)
        if client == self._writer.instance and (on_response := self._waiting.pop(number, None)):
            on_response(self._response.unpack(data, _BODY))


def _list_service_ids(ends: list[graph.DdsEndpoint | None], type: str) -> list[str]:
    """The service ids of the ends with this type. Types with one structure match each other, whatever their names."""
    return [end.user_data.get("serviceid", "") for end in ends if end and end.is_cyclone and end.type == type]


def _count_pairs(takers: list[str], answerers: list[str]) -> int:
    """The number of servers that these ends form, by their ids. Ends without an id count as pairs."""
    return len({*takers} & {*answerers} - {""}) + min(takers.count(""), answerers.count(""))


class DdsServer:
    """Serves one service."""

    def __init__(self, node: DdsNode, name: str, type: str, on_request: Callable[[Message, SendReply], None]) -> None:
        """Like `DdsClient`."""
        self._node = node
        self._name = name
        self._request = node.types.codec(f"{type}_Request")
        self._response = node.types.codec(f"{type}_Response")
        self._on_request = on_request
        self._reachable: set[int] = set()
        """Writers of requests (by handle) whose readers of replies were seen."""
        ids = {"serviceid": node.new_service_id()}
        self._writer = node.open_writer(names.reply_topic(name), self._response.type, _QOS, ids)
        self._reader = node.open_reader(names.request_topic(name), self._request.type, _QOS, self._on_sample, ids)

    def close(self) -> None:
        self._node.release(self._writer, self._reader)

    def _on_sample(self, sample: tuple[bytes, Any]) -> None:
        data, info = sample
        if not info.valid_data or len(data) < _BODY:
            return
        head, client = data[4:_BODY], info.publication_handle
        answered = False

        def reply(response: Message) -> None:
            nonlocal answered
            if not answered and self._reader.is_open:
                answer = self._response.pack(response, head)
                answered = True
                self._send_answer(client, answer, self._node.loop.time() + _ANSWER_KEPT_SECONDS)

        self._on_request(self._request.unpack(data, _BODY), reply)

    def _send_answer(self, client: int, data: bytes, until: float) -> None:
        """Send an answer when its client's reader is known. Before that, DDS would drop it."""
        if not self._reader.is_open:
            return
        if client not in self._reachable:
            listens = self._client_listens(client)
            if listens is None:
                return
            if not listens and self._node.loop.time() < until:
                self._node.loop.call_later(_RETRY_SECONDS, self._send_answer, client, data, until)
                return
            if not listens:
                _LOG.warning("%s: an answer could not be sent: the client is not seen to listen", self._name)
                return
            if len(self._reachable) > 1000:
                self._reachable.clear()
            self._reachable.add(client)
        self._writer.write(data)

    def _client_listens(self, client: int) -> bool | None:
        """Whether the reader of a client exists; None: no part of the client does."""
        writer = graph.find_matched_writer(self._reader.handle, client)
        if writer is None:
            return None
        id = writer.user_data.get("clientid")
        if id is None:
            return True
        readers = (graph.find_matched_reader(self._writer.handle, handle) for handle in self._writer.matched_readers())
        return any(end is not None and end.user_data.get("clientid") == id for end in readers)
