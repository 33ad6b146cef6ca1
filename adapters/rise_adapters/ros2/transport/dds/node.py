"""One ROS node on DDS: its participant, writers and readers, their announcement on `ros_discovery_info`, and the other
visible nodes.

It also makes the type descriptions that Cyclone DDS needs for each topic, from ROS definitions. `interfaces.cdr` makes
the bytes. Cyclone checks incoming messages against the description, and sends it along for nodes that read types (ROS
nodes do not).
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopicDcpsParticipant,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import DDSException
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, make_idl_struct
from cyclonedds.idl import types as idl
from cyclonedds.qos import Policy, Qos

from rise_adapters.ros2.transport.dds import domain as domains
from rise_adapters.ros2.transport.dds import graph, names
from rise_adapters.ros2.transport.dds.names import dds_type
from rise_adapters.ros2.transport.dds.reader_thread import (
    DdsReader,
    DdsWriter,
    HandleSample,
    ReaderThread,
    dds_qos,
    delete_entity,
    make_reader,
)
from rise_adapters.ros2.transport.interfaces import InterfaceCatalog, InterfaceDefinition, InterfaceFieldType
from rise_adapters.ros2.transport.interfaces.definitions import INTEGER_RANGES, PLACEHOLDER_FIELD
from rise_adapters.ros2.transport.port import PortError, QoS

# --- types of the wire ------------------------------------------------------------------------------------------------

_PRIMITIVES: dict[str, Any] = {
    "bool": bool,
    "string": str,
    "byte": idl.byte,
    **{name: getattr(idl, name) for name in (*INTEGER_RANGES, "float32", "float64")},
}
_LARGEST_BOUND = 65535
"""The largest bound in Cyclone's descriptions. A sequence with a larger one is described as unbounded."""
_HEADER = {"rmw_writer_guid": idl.uint64, "rmw_sequence_number": idl.int64}


class IdlTypes:
    """Types for Cyclone DDS, made at their first use."""

    def __init__(self, types: InterfaceCatalog) -> None:
        self._types = types
        self._made: dict[tuple[str, bool], type[IdlStruct]] = {}

    def find_or_make(self, type: str, headed: bool = False) -> type[IdlStruct]:
        """The description of a message. `headed`: of a request or reply, which begins with a client's id and number."""
        found = self._made.get((type, headed))
        if found is None:
            definition = self._types.message_definition(type)
            found = self._made[type, headed] = self._make_type(definition, _HEADER if headed else {})
        return found

    def _make_type(self, definition: InterfaceDefinition, header: dict[str, Any]) -> type[IdlStruct]:
        fields = {field.name: self._field_type(field.type) for field in definition.fields}
        return make_idl_struct(
            definition.name.replace("/", "_"),
            dds_type(definition.name),
            {**header, **(fields or {PLACEHOLDER_FIELD: idl.uint8})},
            dataclassify=False,
        )

    def _field_type(self, type: InterfaceFieldType) -> Any:
        element = self.find_or_make(type.base) if type.is_nested else _PRIMITIVES[type.base]
        if type.length:
            element = idl.bounded_str[type.length]  # type: ignore[misc]
        if type.container == "array":
            return idl.array[element, type.count]  # type: ignore[misc]
        if type.container == "bounded" and type.count <= _LARGEST_BOUND:
            return idl.sequence[element, type.count]  # type: ignore[misc]
        return idl.sequence[element] if type.container else element  # type: ignore[misc]


_DISCOVERY_TOPIC = "ros_discovery_info"
_DISCOVERY_TYPE = "rmw_dds_common/msg/ParticipantEntitiesInfo"
_DISCOVERY_QOS = QoS(depth=1, latched=True)
_CLOSING_SECONDS = 1.0
"""Maximum seconds that closing waits for the reading thread."""


class DdsNode:
    """All methods belong to the loop's thread."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        name: str,
        types: InterfaceCatalog,
        domain: int,
        environment: Mapping[str, str],
    ) -> None:
        """`name`: the full name. Raises PortError if DDS does not start."""
        self.loop = loop
        self.name = name
        self.types = types
        self._idl = IdlTypes(types)
        self._domain = domain
        domains.acquire_domain(domain, environment)
        try:
            self._participant = DomainParticipant(
                domain, Qos(Policy.Userdata(names.encode_user_data({"enclave": "/"})))
            )
        except DDSException as error:
            domains.release_domain(domain)
            raise PortError(
                f"Cyclone DDS cannot start in ROS domain {domain}: {error}. Is there a network interface that it may "
                "use (CYCLONEDDS_URI), and are there fewer programs of ROS on this machine than it allows?"
            ) from None
        self._gid = self._participant.guid.bytes
        self.closed = False
        self._services = 0
        self._gids: dict[DdsReader | DdsWriter, bytes] = {}
        """The ids of its open readers and writers."""
        self._announcing = False
        self.reader_thread = ReaderThread(loop, self._participant, f"dds {name}")
        self.graph = graph.DdsGraph(self._gid)
        self._watch_builtin_topics()
        self._watch_discovery_info()
        self._announce()

    def open_writer(self, topic: str, type: str, qos: QoS, ids: Mapping[str, str] | None = None) -> DdsWriter:
        """Open a writer of a DDS topic, for the caller to `release`. `ids`: the announcement of one end of a service,
        whose messages begin with their client's id and a number. Raises PortError."""
        settings = self._make_settings(type, qos, ids, reader=False)
        writer = DdsWriter(self.loop, self._participant, topic, *settings)
        self._gids[writer] = writer.gid
        self._announce_soon()
        return writer

    def open_reader(
        self,
        topic: str,
        type: str,
        qos: QoS,
        on_sample: HandleSample,
        ids: Mapping[str, str] | None = None,
        pause: float = 0.0,
    ) -> DdsReader:
        """Like `open_writer`. `on_sample` receives pairs of bytes and `SampleInfo`; `pause`: see `port.Transport`."""
        settings = self._make_settings(type, qos, ids, reader=True, pauses=bool(pause))
        reader = make_reader(self._participant, topic, *settings)
        watched = self.reader_thread.add(reader, on_sample, pause=pause)
        self._gids[watched] = reader.guid.bytes
        self._announce_soon()
        return watched

    def release(self, *entities: DdsReader | DdsWriter) -> None:
        """Close readers and writers of this node, and announce it. (The node closes the rest.)"""
        for entity in entities:
            entity.close()
            self._gids.pop(entity, None)
        self._announce_soon()

    def new_service_id(self) -> str:
        """Return an id that marks a reader and a writer as the two ends of one client or server."""
        self._services += 1
        return ".".join(f"{byte:x}" for byte in self._gid[:12] + self._services.to_bytes(4, "big"))

    def close(self) -> None:
        if self.closed:
            return
        self.closed = True
        for entity in (*self._gids, self._info):
            entity.close()
        self.reader_thread.close(_CLOSING_SECONDS)
        delete_entity(self._participant)
        domains.release_domain(self._domain)

    def _make_settings(
        self, type: str, qos: QoS, ids: Mapping[str, str] | None = None, *, reader: bool, pauses: bool = False
    ) -> tuple[Any, Qos]:
        if self.closed:
            raise PortError("the transport is closed")
        data = {**(ids or {}), "typehash": self.types.type_hash(type)}
        return self._idl.find_or_make(type, headed=bool(ids)), dds_qos(qos, data, reader=reader, pauses=pauses)

    # --- the graph ------------------------------------------------------------------------------------------------

    def _watch_builtin_topics(self) -> None:
        for topic, update, take in (
            (BuiltinTopicDcpsParticipant, self.graph.update_participant, graph.take_participants),
            (BuiltinTopicDcpsSubscription, self.graph.update_reader, graph.take_endpoints),
            (BuiltinTopicDcpsPublication, self.graph.update_writer, graph.take_endpoints),
        ):
            self.reader_thread.add(BuiltinDataReader(self._participant, topic), update, take)

    def _watch_discovery_info(self) -> None:
        self._codec = self.types.codec(_DISCOVERY_TYPE)
        idl, qos = self._make_settings(_DISCOVERY_TYPE, _DISCOVERY_QOS, reader=False)
        self._info = DdsWriter(self.loop, self._participant, _DISCOVERY_TOPIC, idl, qos)
        _, qos = self._make_settings(_DISCOVERY_TYPE, _DISCOVERY_QOS, reader=True)
        # Keep all, because the topic has no key: one participant's last message must not replace another's.
        qos = qos - Qos(Policy.History.KeepLast(1)) + Qos(Policy.History.KeepAll)
        self.reader_thread.add(make_reader(self._participant, _DISCOVERY_TOPIC, idl, qos), self._on_discovery_info)

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
            "reader_gid_seq": [{"data": gid} for entity, gid in self._gids.items() if isinstance(entity, DdsReader)],
            "writer_gid_seq": [{"data": gid} for entity, gid in self._gids.items() if isinstance(entity, DdsWriter)],
        }
        self._info.write(self._codec.pack({"gid": {"data": self._gid}, "node_entities_info_seq": [node]}))
