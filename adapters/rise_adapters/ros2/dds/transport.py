"""ROS 2 without a ROS installation: the port over Cyclone DDS (the `cyclonedds` wheel), as rmw_cyclonedds speaks it.

Nodes on the other side must use `RMW_IMPLEMENTATION=rmw_cyclonedds_cpp`. With another, topics may arrive, but services,
and with them actions, do not (`DdsTransport.strangers` says who does).

How fast a death is noticed is announced by the one who may die: the nodes of this transport do it with `lease`; others
need `<Discovery><LeaseDuration>1s</LeaseDuration></Discovery>` in their own CYCLONEDDS_URI, or it takes 10 seconds. One
that ends in order says so at once.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, TypeVar

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

from rise_adapters.ros2 import ros_args, vendors
from rise_adapters.ros2.dds import domain as domains
from rise_adapters.ros2.dds import graph, names
from rise_adapters.ros2.dds.entities import Writer, delete, make_reader, policies
from rise_adapters.ros2.dds.idl import IdlTypes
from rise_adapters.ros2.dds.reading import Reading
from rise_adapters.ros2.dds.services import DdsClient, DdsServer
from rise_adapters.ros2.names import Names
from rise_adapters.ros2.port import RELIABLE, End, Message, PortError, QoS, Reply
from rise_adapters.ros2.types import Codec, Types

_T = TypeVar("_T")
_SERVICE = QoS(depth=1000)
"""Of requests and replies. ROS has a depth of 10; only this side's own memory is meant."""
_DISCOVERY = "ros_discovery_info"
_DISCOVERY_TYPE = "rmw_dds_common/msg/ParticipantEntitiesInfo"
_LAST = 1.0
"""Seconds that closing waits for the reading thread at most."""


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
        self.loop = loop
        given = ros_args.parse(arguments, node)
        name = given.node or node
        # What comes first counts, also where two ways to write a name mean the same.
        rules = [*given.names(name).items(), *(remaps or {}).items()]
        self._names = Names(name, given.namespace or namespace, rules)
        self.types = Types(share, environment)
        self._idl = IdlTypes(self.types)
        number = domains.domain_id(environment) if domain is None else domains.check_domain_id(domain)
        self.domain = number
        domains.acquire(number, lease, environment)
        try:
            self._participant = DomainParticipant(number, Qos(Policy.Userdata(names.user_data({"enclave": "/"}))))
        except DDSException as error:
            domains.release(number)
            raise PortError(
                f"Cyclone DDS cannot start in ROS domain {number}: {error}. Is there a network interface that it may "
                "use (CYCLONEDDS_URI), and are there fewer programs of ROS on this machine than it allows?"
            ) from None
        self.node = self._names.node
        self.vendor = vendors.CYCLONE
        self.about = f"dds, Cyclone DDS {version('cyclonedds')} without ROS, domain {number}"
        self._gid = self._participant.guid.bytes
        self._closed = False
        self._count = 0
        self._open: list[Any] = []
        """What is to be closed with it."""
        self._gids: tuple[dict[bytes, None], dict[bytes, None]] = ({}, {})
        """Ids of this node's readers and writers."""
        self._announcing = False
        self.reading = Reading(loop, self._participant, f"dds {self.node}")
        self._graph = graph.Graph(self._gid)
        self._watch()
        self._announce()

    # --- topics -------------------------------------------------------------------------------------------------

    def publisher(self, topic: str, type: str, qos: QoS = RELIABLE) -> DdsPublisher:
        """As the port says; raises PortError for names and types."""
        codec = self.types.codec(type)
        data = {"typehash": self.types.type_hash(type)}
        writer = self._writer(names.topic(self.resolve(topic)), type, policies(qos, data, reader=False))
        return self._kept(DdsPublisher(self, writer, codec))

    def subscribe(
        self, topic: str, type: str, taken: Callable[[Message], None], qos: QoS = RELIABLE
    ) -> DdsSubscription:
        """As the port says; raises PortError for names and types."""
        codec = self.types.codec(type)
        data = {"typehash": self.types.type_hash(type)}
        reader = self._reader(names.topic(self.resolve(topic)), type, policies(qos, data, reader=True))
        return self._kept(DdsSubscription(self, reader, codec, taken))

    # --- services -----------------------------------------------------------------------------------------------

    def serve(self, name: str, type: str, asked: Callable[[Message, Reply], None]) -> DdsServer:
        """As the port says; raises PortError for names and types."""
        request, response = self._codecs(type)
        full, id = self.resolve(name), {"serviceid": self._new_id()}
        writer = self._service_writer(names.reply(full), response.type, id)
        reader = self._service_reader(names.request(full), request.type, id)
        return self._kept(DdsServer(self, full, reader, writer, request, response, asked))

    def client(self, name: str, type: str) -> DdsClient:
        """As the port says; raises PortError for names and types."""
        request, response = self._codecs(type)
        full, id = self.resolve(name), {"clientid": self._new_id()}
        reader = self._service_reader(names.reply(full), response.type, id)
        writer = self._service_writer(names.request(full), request.type, id)
        return self._kept(DdsClient(self, full, writer, reader, request, response))

    # --- what is known ------------------------------------------------------------------------------------------

    def resolve(self, name: str) -> str:
        return self._names.resolve(name)

    def fields(self, type: str) -> dict[str, str]:
        return self.types.fields(type)

    def type_hash(self, type: str) -> str:
        try:
            return self.types.type_hash(type)
        except PortError:
            return ""

    def publisher_ends(self, topic: str) -> list[End]:
        return self._graph.writers(names.topic(self.resolve(topic)))

    def subscriber_ends(self, topic: str) -> list[End]:
        return self._graph.readers(names.topic(self.resolve(topic)))

    def server_ends(self, service: str) -> list[End]:
        full = self.resolve(service)
        return [*self._graph.readers(names.request(full)), *self._graph.writers(names.reply(full))]

    def topics(self) -> list[str]:
        return self._graph.topics()

    def nodes(self) -> list[str]:
        return self._graph.nodes()

    def strangers(self) -> list[tuple[str, str]]:
        return self._graph.strangers()

    def clients_of(self, service: str) -> list[str]:
        return self._graph.writing(names.request(self.resolve(service)))

    def lost(self) -> str:
        return "the transport is closed" if self._closed else self.reading.failed

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        for one in tuple(self._open):
            one.close()
        self._info.close()
        self.reading.close(_LAST)
        for reader in self._watched:
            delete(reader)
        delete(self._participant)
        domains.release(self.domain)

    def forget(self, one: object, writer: Writer | None, reader: DataReader[Any] | None) -> None:
        """For what is closed: let go of its entities, and tell the others."""
        with suppress(ValueError):
            self._open.remove(one)
        if reader is not None:
            self._gids[0].pop(reader.guid.bytes, None)
            delete(reader)
        if writer is not None:
            self._gids[1].pop(writer.gid, None)
            writer.close()
        self._changed()

    # --- entities -----------------------------------------------------------------------------------------------

    def _kept(self, one: _T) -> _T:
        self._open.append(one)
        return one

    def _codecs(self, type: str) -> tuple[Codec, Codec]:
        return self.types.codec(f"{type}_Request"), self.types.codec(f"{type}_Response")

    def _service_writer(self, topic: str, type: str, id: dict[str, str]) -> Writer:
        data = {**id, "typehash": self.types.type_hash(type)}
        return self._writer(topic, type, policies(_SERVICE, data, reader=False), headed=True)

    def _service_reader(self, topic: str, type: str, id: dict[str, str]) -> DataReader[Any]:
        data = {**id, "typehash": self.types.type_hash(type)}
        return self._reader(topic, type, policies(_SERVICE, data, reader=True), headed=True)

    def _writer(self, topic: str, type: str, qos: Qos, headed: bool = False) -> Writer:
        self._check_open()
        writer = Writer(self.loop, self._participant, topic, self._idl.get(type, headed), qos)
        self._gids[1][writer.gid] = None
        self._changed()
        return writer

    def _reader(self, topic: str, type: str, qos: Qos, headed: bool = False) -> DataReader[Any]:
        self._check_open()
        reader = make_reader(self._participant, topic, self._idl.get(type, headed), qos)
        self._gids[0][reader.guid.bytes] = None
        self._changed()
        return reader

    def _check_open(self) -> None:
        if self._closed:
            raise PortError("the transport is closed")

    def _new_id(self) -> str:
        self._count += 1
        return ".".join(f"{byte:x}" for byte in self._gid[:12] + self._count.to_bytes(4, "big"))

    # --- the graph ----------------------------------------------------------------------------------------------

    def _watch(self) -> None:
        self._watched: list[DataReader[Any]] = []
        for topic, taken, take in (
            (BuiltinTopicDcpsParticipant, self._graph.participant, graph.take_participants),
            (BuiltinTopicDcpsSubscription, self._graph.reader, graph.take_endpoints),
            (BuiltinTopicDcpsPublication, self._graph.writer, graph.take_endpoints),
        ):
            reader = BuiltinDataReader(self._participant, topic)
            self.reading.add(reader, taken, take)
            self._watched.append(reader)
        codec = self.types.codec(_DISCOVERY_TYPE)
        data = {"typehash": self.types.type_hash(_DISCOVERY_TYPE)}
        latched = QoS(depth=1, latched=True)
        idl = self._idl.get(_DISCOVERY_TYPE)
        self._info = Writer(self.loop, self._participant, _DISCOVERY, idl, policies(latched, data, reader=False))
        self._info_codec = codec
        # All, because it has no key: the last of one participant must not replace that of another.
        qos = policies(latched, data, reader=True) - Qos(Policy.History.KeepLast(1)) + Qos(Policy.History.KeepAll)
        info = make_reader(self._participant, _DISCOVERY, idl, qos)
        self.reading.add(info, self._named)
        self._watched.append(info)

    def _named(self, one: tuple[bytes, Any]) -> None:
        data, info = one
        if info.valid_data:
            message = self._info_codec.unpack(data)
            self._graph.named(
                message["gid"]["data"],
                [
                    (
                        f"{node['node_namespace'].rstrip('/')}/{node['node_name']}",
                        [gid["data"] for key in ("reader_gid_seq", "writer_gid_seq") for gid in node[key]],
                    )
                    for node in message["node_entities_info_seq"]
                ],
            )

    def _changed(self) -> None:
        if not self._announcing and not self._closed:
            self._announcing = True
            self.loop.call_soon(self._announce)

    def _announce(self) -> None:
        """Say on `ros_discovery_info` what this node has, as every node of ROS does."""
        self._announcing = False
        if self._closed:
            return
        namespace, _, name = self.node.rpartition("/")
        readers, writers = ([{"data": gid} for gid in gids] for gids in self._gids)
        node = {
            "node_namespace": namespace or "/",
            "node_name": name,
            "reader_gid_seq": readers,
            "writer_gid_seq": writers,
        }
        self._info.write(self._info_codec.pack({"gid": {"data": self._gid}, "node_entities_info_seq": [node]}))


class DdsPublisher:
    """Implements `port.Publisher`."""

    def __init__(self, transport: DdsTransport, writer: Writer, codec: Codec) -> None:
        self._transport = transport
        self._writer = writer
        self._codec = codec
        self._open = True

    def publish(self, message: Message) -> None:
        data = self._codec.pack(message)
        self._writer.write(data)

    def subscribers(self) -> int:
        return len(self._writer.readers())

    def close(self) -> None:
        if self._open:
            self._open = False
            self._transport.forget(self, self._writer, None)


class DdsSubscription:
    """What is subscribed to."""

    def __init__(
        self, transport: DdsTransport, reader: DataReader[Any], codec: Codec, taken: Callable[[Message], None]
    ) -> None:
        self._transport = transport
        self._reader = reader
        self._codec = codec
        self._handler = taken
        self._remove: Callable[[], None] | None = transport.reading.add(reader, self._taken)

    def publishers(self) -> int:
        return len(self._reader.get_matched_publications()) if self._remove is not None else 0

    def close(self) -> None:
        if self._remove is not None:
            self._remove()
            self._remove = None
            self._transport.forget(self, None, self._reader)

    def _taken(self, one: tuple[bytes, Any]) -> None:
        data, info = one
        if info.valid_data:
            self._handler(self._codec.unpack(data))
