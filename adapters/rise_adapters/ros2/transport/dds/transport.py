"""ROS 2 without a ROS installation: the port over Cyclone DDS (the `cyclonedds` wheel), as rmw_cyclonedds speaks it.

Nodes on the other side must use `RMW_IMPLEMENTATION=rmw_cyclonedds_cpp`. With another, topics may arrive, but services,
and with them actions, do not (`DdsTransport.programs_of_other_vendors` says who does).

How fast a death is noticed is announced by the one who may die: the nodes of this transport do it with `lease`; others
need `<Discovery><LeaseDuration>1s</LeaseDuration></Discovery>` in their own CYCLONEDDS_URI, or it takes 10 seconds. One
that ends in order says so at once.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Literal

from rise_adapters.ros2.transport import vendors
from rise_adapters.ros2.transport.dds import domain as domains
from rise_adapters.ros2.transport.dds import names, ros_arguments
from rise_adapters.ros2.transport.dds.node import DdsNode
from rise_adapters.ros2.transport.dds.services import DdsClient, DdsServer
from rise_adapters.ros2.transport.dds.topics import DdsPublisher, DdsSubscription
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog, MessageCodec
from rise_adapters.ros2.transport.names import NameResolver
from rise_adapters.ros2.transport.port import RELIABLE, Message, PortError, QoS, RemoteEndpoint, SendReply


class DdsTransport:
    """Implements `port.Transport`. All methods belong to the loop's thread."""

    kind: Literal["dds"] = "dds"

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        *,
        node: str = "rise",
        namespace: str = "/",
        domain: int | None = None,
        remaps: Mapping[str, str] | None = None,
        arguments: Sequence[str] = (),
        share: Sequence[str | Path] = (),
        lease: float = 1.0,
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        """`domain`: None takes `ROS_DOMAIN_ID`. `remaps`: full or relative names by those that they replace.
        `arguments`: what stands behind `--ros-args`; it counts more than `node`, `namespace` and `remaps`. `share`:
        further folders of definitions. `lease`: seconds without a sign of life after which others take this node for
        dead (CYCLONEDDS_URI can say otherwise).

        Raises PortError with a sentence."""
        given = ros_arguments.parse_ros_arguments(arguments, node)
        name = given.node or node
        # What comes first counts, also where two ways to write a name mean the same.
        rules = [*given.remaps_for(name).items(), *(remaps or {}).items()]
        self._names = NameResolver(name, given.namespace or namespace, rules)
        self._types = InterfaceCatalog(share, environment)
        self.domain = domains.domain_id(environment) if domain is None else domains.check_domain_id(domain)
        self.node = self._names.node
        self.vendor = vendors.CYCLONE
        self.about = f"dds, Cyclone DDS {version('cyclonedds')} without ROS, domain {self.domain}"
        self._dds = DdsNode(loop, self.node, self._types, domain=self.domain, lease=lease, environment=environment)

    # --- topics -------------------------------------------------------------------------------------------------

    def publisher(self, topic: str, type: str, qos: QoS = RELIABLE) -> DdsPublisher:
        """As the port says; raises PortError for names and types."""
        codec = self._types.codec(type)
        writer = self._dds.writer(names.topic(self.resolve(topic)), type, qos)
        return self._dds.keep(DdsPublisher(self._dds, writer, codec))

    def subscribe(
        self, topic: str, type: str, taken: Callable[[Message], None], qos: QoS = RELIABLE
    ) -> DdsSubscription:
        """As the port says; raises PortError for names and types."""
        codec = self._types.codec(type)
        reader = self._dds.reader(names.topic(self.resolve(topic)), type, qos)
        return self._dds.keep(DdsSubscription(self._dds, reader, codec, taken))

    # --- services -----------------------------------------------------------------------------------------------

    def serve(self, name: str, type: str, asked: Callable[[Message, SendReply], None]) -> DdsServer:
        """As the port says; raises PortError for names and types."""
        full = self.resolve(name)
        return self._dds.keep(DdsServer(self._dds, full, *self._service_codecs(type), asked))

    def client(self, name: str, type: str) -> DdsClient:
        """As the port says; raises PortError for names and types."""
        full = self.resolve(name)
        return self._dds.keep(DdsClient(self._dds, full, *self._service_codecs(type)))

    def _service_codecs(self, type: str) -> tuple[MessageCodec, MessageCodec]:
        return self._types.codec(f"{type}_Request"), self._types.codec(f"{type}_Response")

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
        return self._dds.graph.writers(names.topic(self.resolve(topic)))

    def subscriber_endpoints(self, topic: str) -> list[RemoteEndpoint]:
        return self._dds.graph.readers(names.topic(self.resolve(topic)))

    def server_endpoints(self, service: str) -> list[RemoteEndpoint]:
        full = self.resolve(service)
        return [*self._dds.graph.readers(names.request(full)), *self._dds.graph.writers(names.reply(full))]

    def topics(self) -> list[str]:
        return self._dds.graph.topics()

    def nodes(self) -> list[str]:
        return self._dds.graph.nodes()

    def programs_of_other_vendors(self) -> list[tuple[str, str]]:
        return self._dds.graph.programs_of_other_vendors()

    def client_nodes(self, service: str) -> list[str]:
        return self._dds.graph.writer_nodes(names.request(self.resolve(service)))

    def failure(self) -> str:
        return "the transport is closed" if self._dds.closed else self._dds.reader_thread.failure

    def close(self) -> None:
        self._dds.close()
