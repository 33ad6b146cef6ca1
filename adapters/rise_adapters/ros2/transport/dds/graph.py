"""The present participants, endpoints and nodes, from the announcements of DDS and ROS.

Its inputs are three built-in topics of DDS, and `ros_discovery_info`, where every participant of ROS announces its
nodes.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Sequence
from typing import Any, TypeAlias

from cyclonedds import _clayer
from cyclonedds.core import InstanceState
from cyclonedds.qos import _CQos
from msgspec import Struct

from rise_adapters.ros2.transport import vendors
from rise_adapters.ros2.transport.dds import names
from rise_adapters.ros2.transport.port import QoS, RemoteEndpoint

CYCLONE = bytes.fromhex(vendors.CYCLONE)
"""The prefix of the ids of its participants and endpoints."""


class DdsParticipant(Struct, frozen=True):
    """A program that uses DDS."""

    key: bytes
    alive: bool = True


class DdsEndpoint(Struct, frozen=True):
    """A reader or a writer of a participant."""

    key: bytes
    """Its id, which begins with the 12 bytes of its participant."""
    topic: str = ""
    """DDS's name: `rt/chatter`."""
    type: str = ""
    """The type's name in ROS; empty: no type of ROS."""
    user_data: dict[str, str] = {}
    """Its user data: `typehash`, `serviceid`, `clientid`."""
    qos: QoS | None = None
    alive: bool = True

    @property
    def is_cyclone(self) -> bool:
        return self.key[:2] == CYCLONE


_Announcement: TypeAlias = tuple[bytes, QoS | None]
"""From an endpoint's announcement: its user data and quality of service."""


def take_participants(reader: int, most: int) -> Any:
    def make_participant(key: bytes, data: bytes, info: Any) -> DdsParticipant:
        return DdsParticipant(key, info.instance_state == InstanceState.Alive)

    return _clayer.ddspy_take_participant(reader, most, make_participant, _read_nothing)


def take_endpoints(reader: int, most: int) -> Any:
    return _clayer.ddspy_take_endpoint(reader, most, _make_endpoint, _read_announcement)


def find_matched_reader(writer: int, handle: int) -> DdsEndpoint | None:
    """The endpoint of a matched reader; None: it is gone."""
    found = _clayer.ddspy_get_matched_subscription_data(writer, handle, _make_endpoint, _read_announcement)
    return found if isinstance(found, DdsEndpoint) else None


def find_matched_writer(reader: int, handle: int) -> DdsEndpoint | None:
    """The endpoint of a matched writer; None: it is gone."""
    found = _clayer.ddspy_get_matched_publication_data(reader, handle, _make_endpoint, _read_announcement)
    return found if isinstance(found, DdsEndpoint) else None


def _make_endpoint(
    key: bytes,
    participant: bytes,
    handle: int,
    topic: str,
    type: str,
    announcement: _Announcement,
    info: Any,
    type_id: Any,
) -> DdsEndpoint:
    if info is not None and info.instance_state != InstanceState.Alive:
        return DdsEndpoint(key, alive=False)
    data, qos = announcement
    return DdsEndpoint(key, topic or "", names.ros_type(type or ""), names.decode_user_data(data), qos)


# The settings of a QoS are read one by one: the library's conversion of whole objects is slow and not thread-safe.


def _read_announcement(pointer: int) -> _Announcement:
    reliable, durable, blocking = ctypes.c_int(), ctypes.c_int(), ctypes.c_int64()
    qos = None
    if _CQos._get_reliability(
        ctypes.c_void_p(pointer), ctypes.byref(reliable), ctypes.byref(blocking)
    ) and _CQos._get_durability(ctypes.c_void_p(pointer), ctypes.byref(durable)):
        qos = QoS(reliable=bool(reliable.value), latched=bool(durable.value))
    return _read_user_data(pointer), qos


def _read_user_data(pointer: int) -> bytes:
    value, size = ctypes.c_void_p(), ctypes.c_size_t()
    if not _CQos._get_userdata(ctypes.c_void_p(pointer), ctypes.byref(value), ctypes.byref(size)) or not value.value:
        return b""
    data = ctypes.string_at(value.value, size.value)
    _CQos.free(value)
    return data


def _read_nothing(pointer: int) -> bytes:
    return b""


_Endpoints: TypeAlias = dict[str, dict[bytes, DdsEndpoint]]
"""The readers or writers by topic and id."""


class DdsGraph:
    """All visible participants, including this process. Belongs to the loop's thread."""

    def __init__(self, own: bytes) -> None:
        """`own`: the id of this participant."""
        self._own = own[:12]
        self._participants: set[bytes] = {own}
        self._readers: _Endpoints = {}
        self._writers: _Endpoints = {}
        self._nodes: dict[bytes, list[str]] = {}
        """The names of each participant's nodes."""
        self._owners: dict[bytes, dict[bytes, str]] = {}
        """The node that owns each endpoint of a participant, by the first 12 bytes of the participant's id."""
        self.version = 0
        """Increases with every change."""

    def update_participant(self, seen: DdsParticipant) -> None:
        self.version += 1
        if seen.alive:
            self._participants.add(seen.key)
        else:
            self._participants.discard(seen.key)
            self._nodes.pop(seen.key, None)
            self._owners.pop(seen.key[:12], None)

    def update_reader(self, seen: DdsEndpoint) -> None:
        self.version += 1
        _update_endpoints(self._readers, seen)

    def update_writer(self, seen: DdsEndpoint) -> None:
        self.version += 1
        _update_endpoints(self._writers, seen)

    def set_nodes(self, participant: bytes, nodes: Sequence[tuple[str, Iterable[bytes]]]) -> None:
        """Store a participant's nodes, with the ids of the endpoints of each node."""
        self.version += 1
        self._nodes[participant] = [node for node, _ in nodes]
        self._owners[participant[:12]] = {key: node for node, keys in nodes for key in keys}

    def find_writer_nodes(self, topic: str) -> list[str]:
        """The other nodes that write a DDS topic, as far as they announce this."""
        return sorted({end.node for end in self.find_writers(topic) if end.node})

    def nodes(self) -> list[str]:
        """The full names, each as often as it exists."""
        return sorted(
            node for participant, nodes in self._nodes.items() if participant in self._participants for node in nodes
        )

    def find_writers(self, topic: str) -> list[RemoteEndpoint]:
        """The endpoints of other participants that write a DDS topic."""
        return self._find_of_others(self._writers, topic)

    def find_readers(self, topic: str) -> list[RemoteEndpoint]:
        """The endpoints of other participants that read a DDS topic."""
        return self._find_of_others(self._readers, topic)

    def topics(self, ending: str) -> list[str]:
        """The topics of ROS (without services) with this ending on which other participants have an endpoint."""
        found = {
            topic
            for endpoints in (self._readers, self._writers)
            for topic, ends in endpoints.items()
            if topic.endswith(ending) and any(not key.startswith(self._own) for key in ends)
        }
        return sorted(name for topic in found if (name := names.ros_topic(topic)))

    def programs_of_other_vendors(self) -> list[tuple[str, str]]:
        """Programs with DDS software other than Cyclone, or with DDS but without ROS 2."""
        return [
            (
                ", ".join(dict.fromkeys(self._nodes.get(key, ()))) or f"without named nodes ({key[:12].hex()})",
                key[:2].hex(),
            )
            for key in sorted(self._participants)
            if key[:2] != CYCLONE
        ]

    def _find_of_others(self, endpoints: _Endpoints, topic: str) -> list[RemoteEndpoint]:
        return [
            RemoteEndpoint(
                self._owners.get(key[:12], {}).get(key, ""),
                end.type,
                end.user_data.get("typehash", ""),
                key[:2].hex(),
                end.qos,
                key[:12],
            )
            for key, end in endpoints.get(topic, {}).items()
            if not key.startswith(self._own)
        ]


def _update_endpoints(endpoints: _Endpoints, seen: DdsEndpoint) -> None:
    for known in endpoints.values():
        known.pop(seen.key, None)
    if seen.alive:
        endpoints.setdefault(seen.topic, {})[seen.key] = seen
