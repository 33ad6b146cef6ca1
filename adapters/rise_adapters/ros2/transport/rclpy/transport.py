"""The port over rclpy (Jazzy, 7.1 or newer), with any RMW, for machines with a ROS installation.

One thread spins the node (`node`). It takes messages, converts them to plain values (`conversion`), and passes them to
the asyncio loop (`inbox`). The loop's thread sends, creates and looks up.
"""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal

from rise_adapters.ros2.transport import vendors
from rise_adapters.ros2.transport.port import RELIABLE, Message, PortError, QoS, RemoteEndpoint, SendReply
from rise_adapters.ros2.transport.rclpy.entities import RclpyClient, RclpyPublisher, RclpyServer, RclpySubscription
from rise_adapters.ros2.transport.rclpy.installation import first_line
from rise_adapters.ros2.transport.rclpy.node import SpinningNode
from rise_adapters.ros2.transport.rclpy.types import InstalledTypes

# --- the graph --------------------------------------------------------------------------------------------------------

_log = logging.getLogger(__name__)

_UNKNOWN = "_UNKNOWN_"
"""Part of the name of a node that ROS does not know (yet): `_NODE_NAME_UNKNOWN_`."""


class RclpyGraph:
    """The other nodes, by full names. Empty when the node has ended."""

    def __init__(self, node: SpinningNode, vendor: str) -> None:
        """`vendor`: the vendor of this node's software, as in `RemoteEndpoint`."""
        self._spinning = node
        self._node: Any = node.rclpy_node
        self._vendor = vendor

    def find_publishers(self, topic: str) -> list[RemoteEndpoint]:
        return self._find_endpoints(self._node.get_publishers_info_by_topic, topic)

    def find_subscribers(self, topic: str) -> list[RemoteEndpoint]:
        return self._find_endpoints(self._node.get_subscriptions_info_by_topic, topic)

    def find_servers(self, service: str) -> list[RemoteEndpoint]:
        # RMWs on DDS carry a service on two topics: servers read one and write the other.
        found = [
            *self._find_endpoints(self._node.get_subscriptions_info_by_topic, f"rq{service}Request", no_mangle=True),
            *self._find_endpoints(self._node.get_publishers_info_by_topic, f"rr{service}Reply", no_mangle=True),
        ]
        return found or self._find_servers_by_node(service)

    def find_clients(self, service: str) -> list[str]:
        """The nodes that call a service."""
        # As in `find_servers`: on DDS, clients of the service write this topic.
        infos = self._look_up(self._node.get_publishers_info_by_topic, f"rq{service}Request", no_mangle=True)
        return sorted({_full_name(info) for info in infos} - {self._spinning.name})

    def topics(self, ending: str) -> list[str]:
        names = [name for name, _ in self._look_up(self._node.get_topic_names_and_types) if name.endswith(ending)]
        return [name for name in names if self.find_publishers(name) or self.find_subscribers(name)]

    def nodes(self) -> list[str]:
        return self._look_up(self._node.get_fully_qualified_node_names)

    def programs_of_other_vendors(self) -> list[tuple[str, str]]:
        """As `port.Transport.programs_of_other_vendors`."""
        if not self._vendor:
            return []
        # From their endpoints, because nothing else shows a program's vendor.
        found = {
            (end.node, end.vendor)
            for name, _ in self._look_up(self._node.get_topic_names_and_types, no_demangle=True)
            for list_infos in (self._node.get_publishers_info_by_topic, self._node.get_subscriptions_info_by_topic)
            for end in self._find_endpoints(list_infos, name, no_mangle=True)
            if end.vendor != self._vendor
        }
        named = {vendor for node, vendor in found if node}  # their unnamed ends are the middleware's own
        return sorted((node or "without a name", vendor) for node, vendor in found if node or vendor not in named)

    def _look_up(self, question: Callable[..., Any], *about: str, **more: bool) -> list[Any]:
        """Return rclpy's list; empty if rclpy cannot look something up, such as a node that has just gone."""
        if self._spinning.failure():
            return []
        try:
            return list(question(*about, **more))
        except Exception as error:  # rclpy and its C code raise many kinds
            _log.debug("%s cannot be looked up: %s", " ".join(about), first_line(error))
            return []

    def _find_endpoints(self, list_infos: Callable[..., Any], name: str, **more: bool) -> list[RemoteEndpoint]:
        """The endpoints of other nodes under a name."""
        infos = self._look_up(list_infos, name, **more)
        return [self._make_endpoint(info) for info in infos if _full_name(info) != self._spinning.name]

    def _make_endpoint(self, info: Any) -> RemoteEndpoint:
        node = _full_name(info)
        return RemoteEndpoint(
            "" if _UNKNOWN in node else node,
            _demangle_type(info.topic_type),
            _read_hash(info.topic_type_hash),
            bytes(info.endpoint_gid[:2]).hex() if self._vendor else "",
            self._spinning.read_profile(info.qos_profile),
            bytes(info.endpoint_gid[:12]) if self._vendor else b"",
        )

    def _find_servers_by_node(self, service: str) -> list[RemoteEndpoint]:
        """A service's endpoints at the nodes that are known to offer it."""
        found: list[RemoteEndpoint] = []
        for name, namespace in self._look_up(self._node.get_node_names_and_namespaces):
            node = f"{namespace.rstrip('/')}/{name}"
            if node != self._spinning.name:
                offered = self._look_up(self._node.get_service_names_and_types_by_node, name, namespace)
                found += [
                    RemoteEndpoint(node, f"{type}_Request")
                    for full, types in offered
                    if full == service
                    for type in types
                ]
        return found


def _full_name(info: Any) -> str:
    return f"{info.node_namespace.rstrip('/')}/{info.node_name}"


def _read_hash(value: Any) -> str:
    """The type hash of an endpoint; empty: not announced (`INVALID` in rclpy)."""
    text = "" if value is None else str(value)
    return text if text.startswith("RIHS") else ""


def _demangle_type(name: str) -> str:
    """`std_srvs::srv::dds_::Trigger_Request_` -> `std_srvs/srv/Trigger_Request`."""
    match = re.fullmatch(r"(\w+)::(\w+)::dds_::(\w+)_", name)
    return "/".join(match.groups()) if match else name


class RclpyTransport:
    """Implements `port.Transport`."""

    kind: Literal["rclpy"] = "rclpy"

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        *,
        node: str,
        arguments: Sequence[str] = (),
    ) -> None:
        """Create the node `node` and begin to spin. Must be called on the thread of `loop`.

        `arguments` are those of `--ros-args` (remappings, parameters, enclave, log levels), with or without the flag
        itself. Raises PortError if rclpy cannot be used or refuses them.
        """
        self._node = SpinningNode(loop, node, arguments)
        self._types = InstalledTypes()
        self.node = self._node.name
        self.vendor = vendors.vendor_of_rmw(self._node.rmw)
        self.about = f"rclpy, {self._node.rmw}, domain {self._node.domain}"
        self._graph = RclpyGraph(self._node, self.vendor)

    # --- topics and services --------------------------------------------------------------------------------------

    def publisher(self, topic: str, type: str, qos: QoS = RELIABLE) -> RclpyPublisher:
        return RclpyPublisher(self._node, topic, *self._types.find_message(type), qos)

    def subscribe(
        self,
        topic: str,
        type: str,
        on_message: Callable[[Message], None],
        qos: QoS = RELIABLE,
        pause: float = 0.0,
    ) -> RclpySubscription:
        return RclpySubscription(self._node, topic, *self._types.find_message(type), on_message, qos, pause)

    def serve(self, name: str, type: str, on_request: Callable[[Message, SendReply], None]) -> RclpyServer:
        return RclpyServer(self._node, name, type, *self._types.find_service(type), on_request)

    def client(self, name: str, type: str) -> RclpyClient:
        return RclpyClient(self._node, name, type, *self._types.find_service(type))

    # --- the graph ------------------------------------------------------------------------------------------------

    def resolve(self, name: str) -> str:
        # A rule for topics only (`rostopic://a:=b`) or services only does not affect the other kind, so the first rule
        # that applies counts. An action's name is resolved before `/_action/...` is added, so all its parts follow.
        node = self._node.rclpy_node
        try:
            plain: str = node.resolve_topic_name(name, only_expand=True)
            topic: str = node.resolve_topic_name(name)
            return topic if topic != plain else str(node.resolve_service_name(name))
        except Exception as error:  # as in `RclpyEntity`
            raise PortError(f"{name!r} cannot be the name of a topic or service: {first_line(error)}") from error

    def fields(self, type: str) -> Mapping[str, str]:
        return self._types.fields(type)

    def type_hash(self, type: str) -> str:
        return self._types.find_hash(type)

    def graph_version(self) -> None:
        """None, because rclpy does not report changes of the graph."""

    def publisher_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        return self._graph.find_publishers(self.resolve(topic))

    def subscriber_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        return self._graph.find_subscribers(self.resolve(topic))

    def server_endpoints(self, service: str) -> list[RemoteEndpoint]:
        return self._graph.find_servers(self.resolve(service))

    def topics(self, ending: str = "") -> list[str]:
        return self._graph.topics(ending)

    def programs_of_other_vendors(self) -> list[tuple[str, str]]:
        return self._graph.programs_of_other_vendors()

    def nodes(self) -> list[str]:
        return self._graph.nodes()

    def client_nodes(self, service: str) -> list[str]:
        return self._graph.find_clients(self.resolve(service))

    def failure(self) -> str:
        return self._node.failure()

    def close(self) -> None:
        self._node.close()
