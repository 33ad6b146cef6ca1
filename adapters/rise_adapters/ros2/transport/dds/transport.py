"""ROS 2 without a ROS installation: the port over Cyclone DDS (the `cyclonedds` wheel), as rmw_cyclonedds speaks it.

Nodes on the other side must use `RMW_IMPLEMENTATION=rmw_cyclonedds_cpp`. With another, topics may arrive, but services,
and with them actions, do not (`DdsTransport.programs_of_other_vendors` says who does).

How fast a death is noticed is announced by the one who may die: this transport has a lease of one second (`domain`);
others need `<Discovery><LeaseDuration>1s</LeaseDuration></Discovery>` in their own CYCLONEDDS_URI, or it takes 10
seconds. One that ends in order says so at once.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Literal

from rise_adapters.ros2.transport import vendors
from rise_adapters.ros2.transport.dds import names, ros_arguments
from rise_adapters.ros2.transport.dds.domain import read_domain_id
from rise_adapters.ros2.transport.dds.node import DdsNode
from rise_adapters.ros2.transport.dds.services import DdsClient, DdsServer
from rise_adapters.ros2.transport.dds.topics import DdsPublisher, DdsSubscription
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog
from rise_adapters.ros2.transport.names import NameResolver
from rise_adapters.ros2.transport.port import RELIABLE, Message, PortError, QoS, RemoteEndpoint, SendReply


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
        """`node`: its name, unless `arguments` (what stands behind `--ros-args`) say another. `share`: further folders
        of definitions. Raises PortError with a sentence."""
        given = ros_arguments.parse_ros_arguments(arguments, node)
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

    # --- what is known ------------------------------------------------------------------------------------------

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
