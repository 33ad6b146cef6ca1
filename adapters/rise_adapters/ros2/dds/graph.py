"""Who is there: participants, endpoints and nodes, from what DDS and ROS announce of them.

Fed by three built-in topics of DDS and by `ros_discovery_info`, on which every participant of ROS says which nodes it
has.
"""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from cyclonedds import _clayer
from cyclonedds.core import InstanceState
from cyclonedds.qos import _CQos
from msgspec import Struct

from rise_adapters.ros2.dds import names

_NONE: Mapping[bytes, str] = MappingProxyType({})
CYCLONE = b"\x01\x10"
_VENDORS = {
    b"\x01\x0f": "eProsima Fast DDS (rmw_fastrtps_cpp)",
    b"\x01\x01": "RTI Connext DDS (rmw_connextdds)",
    b"\x01\x03": "OpenSplice",
    b"\x01\x12": "RustDDS",
    b"\x01\x14": "GurumDDS (rmw_gurumdds_cpp)",
}
"""By the first two bytes of a participant's id (https://www.dds-foundation.org/dds-rtps-vendor-and-product-ids/)."""


class Endpoint(Struct, frozen=True):
    """A reader or a writer of somebody."""

    key: bytes
    """Its id; the first 12 bytes are those of its participant."""
    participant: bytes
    topic: str
    """As DDS has it: `rt/chatter`."""
    type: str
    """As ROS has it; empty when it is none of ROS."""
    data: dict[str, str]
    """Its user data: `typehash`, `serviceid`, `clientid`."""

    @property
    def cyclone(self) -> bool:
        return self.key[:2] == CYCLONE


class Gone(Struct, frozen=True):
    key: bytes


class Participant(Struct, frozen=True):
    key: bytes


def take_participants(reader: int, most: int) -> Any:
    def made(key: bytes, data: bytes, info: Any) -> Participant | Gone:
        return Participant(key) if info.instance_state == InstanceState.Alive else Gone(key)

    return _clayer.ddspy_take_participant(reader, most, made, _no_qos)


def take_endpoints(reader: int, most: int) -> Any:
    return _clayer.ddspy_take_endpoint(reader, most, _endpoint, _user_data)


def matched_reader(writer: int, handle: int) -> Endpoint | None:
    """Who a matched reader is; None when it is gone."""
    found = _clayer.ddspy_get_matched_subscription_data(writer, handle, _endpoint, _user_data)
    return found if isinstance(found, Endpoint) else None


def matched_writer(reader: int, handle: int) -> Endpoint | None:
    """Who a matched writer is; None when it is gone."""
    found = _clayer.ddspy_get_matched_publication_data(reader, handle, _endpoint, _user_data)
    return found if isinstance(found, Endpoint) else None


def _endpoint(
    key: bytes, participant: bytes, handle: int, topic: str, type: str, data: bytes, info: Any, type_id: Any
) -> Endpoint | Gone:
    if info is not None and info.instance_state != InstanceState.Alive:
        return Gone(key)
    return Endpoint(key, participant, topic or "", names.ros_type(type or ""), names.read_user_data(data))


def _user_data(pointer: int) -> bytes:
    # Not by the library's own conversion of whole QoS objects: it is slow, and not made for several threads.
    value, size = ctypes.c_void_p(), ctypes.c_size_t()
    if not _CQos._get_userdata(ctypes.c_void_p(pointer), ctypes.byref(value), ctypes.byref(size)) or not value.value:
        return b""
    data = ctypes.string_at(value.value, size.value)
    _CQos.free(value)
    return data


def _no_qos(pointer: int) -> bytes:
    return b""


class Graph:
    """Everybody who is seen, with this process. Belongs to the loop's thread."""

    def __init__(self, own: bytes) -> None:
        """`own`: the id of this participant."""
        self._own = own[:12]
        self._participants: set[bytes] = {own}
        self._readers: dict[bytes, Endpoint] = {}
        self._writers: dict[bytes, Endpoint] = {}
        self._nodes: dict[bytes, list[str]] = {}
        self._owners: dict[bytes, Mapping[bytes, str]] = {}
        """By participant, which of its writers belongs to which node."""

    def participant(self, seen: Participant | Gone) -> None:
        if isinstance(seen, Participant):
            self._participants.add(seen.key)
        else:
            self._participants.discard(seen.key)
            self._nodes.pop(seen.key, None)
            self._owners.pop(seen.key, None)

    def reader(self, seen: Endpoint | Gone) -> None:
        self._endpoint(self._readers, seen)

    def writer(self, seen: Endpoint | Gone) -> None:
        self._endpoint(self._writers, seen)

    def named(self, participant: bytes, nodes: list[str], owners: Mapping[bytes, str] = _NONE) -> None:
        """A participant says which nodes it has; `owners`: by writer, the node that it belongs to."""
        self._nodes[participant] = nodes
        self._owners[participant] = owners

    def writing(self, topic: str) -> list[str]:
        """The nodes of others that write a DDS topic, as far as they say so."""
        owners = [self._owners.get(end.participant, {}).get(end.key) for end in self.writers(topic)]
        return sorted({owner for owner in owners if owner is not None})

    def nodes(self) -> list[str]:
        """Full names, each as often as it is there."""
        return sorted(
            node for participant, nodes in self._nodes.items() if participant in self._participants for node in nodes
        )

    def writers(self, topic: str) -> list[Endpoint]:
        """Those of others that write a DDS topic."""
        return self._others(self._writers, topic)

    def readers(self, topic: str) -> list[Endpoint]:
        """Those of others that read a DDS topic."""
        return self._others(self._readers, topic)

    def foreign(self) -> list[str]:
        """A sentence for each program that uses other software for DDS than Cyclone, or talks DDS but is not ROS 2."""
        sentences = []
        for key in sorted(self._participants):
            if key[:2] != CYCLONE:
                vendor = _VENDORS.get(key[:2], f"DDS software of another vendor (number {key[:2].hex()})")
                sentences.append(
                    f"{self._called(key)} uses {vendor}: topics may arrive, services and actions do not. "
                    "Start it with RMW_IMPLEMENTATION=rmw_cyclonedds_cpp, or use --ros rclpy here"
                )
        return sentences

    def _called(self, participant: bytes) -> str:
        nodes = self._nodes.get(participant)
        return f"the node {', '.join(nodes)}" if nodes else f"a program without named nodes ({participant[:12].hex()})"

    def _endpoint(self, known: dict[bytes, Endpoint], seen: Endpoint | Gone) -> None:
        if isinstance(seen, Endpoint):
            known[seen.key] = seen
        else:
            known.pop(seen.key, None)

    def _others(self, known: dict[bytes, Endpoint], topic: str) -> list[Endpoint]:
        return [end for end in known.values() if end.topic == topic and end.participant[:12] != self._own]
