"""One node of ROS on DDS: its participant, the writers and readers that it has, what it announces of them on
`ros_discovery_info` as every node of ROS does, and whom it sees."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Mapping
from typing import Any, TypeVar

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import DDSException
from cyclonedds.domain import DomainParticipant
from cyclonedds.qos import Policy, Qos
from cyclonedds.sub import DataReader

from rise_adapters.ros2.transport.dds import domain as domains
from rise_adapters.ros2.transport.dds import graph, names
from rise_adapters.ros2.transport.dds.entities import DdsWriter, dds_qos, delete_entity, make_reader
from rise_adapters.ros2.transport.dds.idl import IdlTypes
from rise_adapters.ros2.transport.dds.reader_thread import ReaderThread
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog
from rise_adapters.ros2.transport.port import Closable, PortError, QoS

_DISCOVERY_TOPIC = "ros_discovery_info"
_DISCOVERY_TYPE = "rmw_dds_common/msg/ParticipantEntitiesInfo"
_DISCOVERY_QOS = QoS(depth=1, latched=True)
_CLOSING_SECONDS = 1.0
"""How long closing waits for the reading thread at most."""


_Kept = TypeVar("_Kept", bound=Closable)


class DdsNode:
    """All methods belong to the loop's thread."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        name: str,
        types: InterfaceCatalog,
        *,
        domain: int,
        lease: float,
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        """`name`: the full name. `lease`: seconds without a sign of life after which others take this node for dead.
        Raises PortError when DDS does not start."""
        self.loop = loop
        self.name = name
        self.types = types
        self._idl = IdlTypes(types)
        self._domain = domain
        domains.acquire_domain(domain, lease, environment)
        try:
            self._participant = DomainParticipant(domain, Qos(Policy.Userdata(names.user_data({"enclave": "/"}))))
        except DDSException as error:
            domains.release_domain(domain)
            raise PortError(
                f"Cyclone DDS cannot start in ROS domain {domain}: {error}. Is there a network interface that it may "
                "use (CYCLONEDDS_URI), and are there fewer programs of ROS on this machine than it allows?"
            ) from None
        self._gid = self._participant.guid.bytes
        self.closed = False
        self._services = 0
        self._open: dict[Closable, None] = {}
        """What is to be closed with it."""
        self._reader_gids: dict[bytes, None] = {}
        self._writer_gids: dict[bytes, None] = {}
        self._announcing = False
        self.reader_thread = ReaderThread(loop, self._participant, f"dds {name}")
        self.graph = graph.DdsGraph(self._gid)
        self._watched: list[DataReader[Any]] = []
        self._watch_builtin_topics()
        self._watch_discovery_info()
        self._announce()

    def keep(self, one: _Kept) -> _Kept:
        """Have it closed with this node, unless it is given to `release` before."""
        self._open[one] = None
        return one

    def release(self, one: Closable, writer: DdsWriter | None, reader: DataReader[Any] | None) -> None:
        """For what is closed: delete its entities, and tell the others."""
        self._open.pop(one, None)
        if reader is not None:
            self._reader_gids.pop(reader.guid.bytes, None)
            delete_entity(reader)
        if writer is not None:
            self._writer_gids.pop(writer.gid, None)
            writer.close()
        self._announce_soon()

    def writer(
        self, topic: str, type: str, qos: QoS, user_data: Mapping[str, str] | None = None, *, headed: bool = False
    ) -> DdsWriter:
        """A writer of a DDS topic. `headed`: of requests or replies, which begin with whose and which they are.
        Raises PortError: the type is not known, DDS refuses, or this node is closed."""
        made = DdsWriter(
            self.loop, self._participant, topic, *self._described(type, qos, user_data, headed, reader=False)
        )
        self._writer_gids[made.gid] = None
        self._announce_soon()
        return made

    def reader(
        self, topic: str, type: str, qos: QoS, user_data: Mapping[str, str] | None = None, *, headed: bool = False
    ) -> DataReader[Any]:
        """As `writer`."""
        made = make_reader(self._participant, topic, *self._described(type, qos, user_data, headed, reader=True))
        self._reader_gids[made.guid.bytes] = None
        self._announce_soon()
        return made

    def new_service_id(self) -> str:
        """By which others see that a reader and a writer are two ends of one client or server."""
        self._services += 1
        return ".".join(f"{byte:x}" for byte in self._gid[:12] + self._services.to_bytes(4, "big"))

    def close(self) -> None:
        if self.closed:
            return
        self.closed = True
        for one in tuple(self._open):
            one.close()
        self._info.close()
        self.reader_thread.close(_CLOSING_SECONDS)
        for reader in self._watched:
            delete_entity(reader)
        delete_entity(self._participant)
        domains.release_domain(self._domain)

    def _described(
        self, type: str, qos: QoS, user_data: Mapping[str, str] | None, headed: bool, *, reader: bool
    ) -> tuple[Any, Qos]:
        if self.closed:
            raise PortError("the transport is closed")
        data = {**(user_data or {}), "typehash": self.types.type_hash(type)}
        return self._idl.get(type, headed), dds_qos(qos, data, reader=reader)

    # --- who is there ---------------------------------------------------------------------------------------------

    def _watch_builtin_topics(self) -> None:
        for topic, taken, take in (
            (BuiltinTopicDcpsParticipant, self.graph.update_participant, graph.take_participants),
            (BuiltinTopicDcpsSubscription, self.graph.update_reader, graph.take_endpoints),
            (BuiltinTopicDcpsPublication, self.graph.update_writer, graph.take_endpoints),
        ):
            reader = BuiltinDataReader(self._participant, topic)
            self.reader_thread.add(reader, taken, take)
            self._watched.append(reader)

    def _watch_discovery_info(self) -> None:
        self._codec = self.types.codec(_DISCOVERY_TYPE)
        idl, qos = self._described(_DISCOVERY_TYPE, _DISCOVERY_QOS, None, False, reader=False)
        self._info = DdsWriter(self.loop, self._participant, _DISCOVERY_TOPIC, idl, qos)
        _, qos = self._described(_DISCOVERY_TYPE, _DISCOVERY_QOS, None, False, reader=True)
        # All, because it has no key: the last of one participant must not replace that of another.
        qos = qos - Qos(Policy.History.KeepLast(1)) + Qos(Policy.History.KeepAll)
        reader = make_reader(self._participant, _DISCOVERY_TOPIC, idl, qos)
        self.reader_thread.add(reader, self._on_discovery_info)
        self._watched.append(reader)

    def _on_discovery_info(self, sample: tuple[bytes, Any]) -> None:
        data, info = sample
        if info.valid_data:
            message = self._codec.unpack(data)
            self.graph.set_nodes(
                message["gid"]["data"],
                [
                    (
                        f"{node['node_namespace'].rstrip('/')}/{node['node_name']}",
                        [gid["data"] for key in ("reader_gid_seq", "writer_gid_seq") for gid in node[key]],
                    )
                    for node in message["node_entities_info_seq"]
                ],
            )

    def _announce_soon(self) -> None:
        if not self._announcing and not self.closed:
            self._announcing = True
            self.loop.call_soon(self._announce)

    def _announce(self) -> None:
        self._announcing = False
        if self.closed:
            return
        namespace, _, name = self.name.rpartition("/")
        node = {
            "node_namespace": namespace or "/",
            "node_name": name,
            "reader_gid_seq": [{"data": gid} for gid in self._reader_gids],
            "writer_gid_seq": [{"data": gid} for gid in self._writer_gids],
        }
        self._info.write(self._codec.pack({"gid": {"data": self._gid}, "node_entities_info_seq": [node]}))
