"""The port over rclpy (Jazzy, 7.1 or newer), with any RMW: for machines on which ROS is installed.

One thread spins the node (`node`). It takes messages, turns them into plain values (`conversion`), and hands them to
the asyncio loop (`inbox`). Sending, making and looking is done on the loop's thread.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import Literal

from rise_adapters.ros2.transport import vendors
from rise_adapters.ros2.transport.port import RELIABLE, Message, PortError, QoS, RemoteEndpoint, SendReply
from rise_adapters.ros2.transport.rclpy.graph import RclpyGraph
from rise_adapters.ros2.transport.rclpy.installation import first_line
from rise_adapters.ros2.transport.rclpy.node import SpinningNode
from rise_adapters.ros2.transport.rclpy.services import RclpyClient, RclpyServer
from rise_adapters.ros2.transport.rclpy.topics import RclpyPublisher, RclpySubscription
from rise_adapters.ros2.transport.rclpy.types import InstalledTypes


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
        """Make the node `node` and begin to spin. Must be called on the thread of `loop`.

        `arguments` are those of `--ros-args` (remappings, parameters, enclave, log levels), with or without the flag
        itself. Raises PortError when rclpy cannot be used or refuses them.
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

    # --- what is known --------------------------------------------------------------------------------------------

    def resolve(self, name: str) -> str:
        # A rule for topics only (`rostopic://a:=b`) or services only names the other kind not at all, so the first one
        # that applies is meant. An action's name is resolved before `/_action/...` is added, so all its parts follow.
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
        """rclpy does not tell that the graph has changed."""

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
