"""Writers and readers of Cyclone DDS that carry bytes, with the quality of service and the user data of ROS 2."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Mapping
from typing import Any

from cyclonedds import _clayer
from cyclonedds.core import DDSException, Entity
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.pub import DataWriter
from cyclonedds.qos import BasePolicy, Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from rise_adapters.ros2.transport.dds import names
from rise_adapters.ros2.transport.port import PortError, QoS

_RETRY_SECONDS = 0.005
"""Seconds until a message is tried again that DDS would not take because a reader is slow."""
_OUTBOX_LIMIT = 10_000
"""Messages that wait for that; the oldest is given up for the next."""
_READER_HISTORY = 1000
"""Messages that a reader keeps at least: those that come while the reading thread waits for its turn."""
_LOG = logging.getLogger(__name__)


def dds_qos(qos: QoS, data: Mapping[str, str], *, reader: bool, pauses: bool = False) -> Qos:
    """A ROS quality of service as DDS has it, with an endpoint's user data. `pauses`: a reader wants the newest, and no
    more of them than the depth."""
    depth = max(qos.depth, 1)
    if reader and not qos.latched and not pauses:
        depth = max(depth, _READER_HISTORY)
    chosen: list[BasePolicy] = [
        # Never wait in a write: it would hold up everything else. What does not go out at once is kept by `DdsWriter`.
        Policy.Reliability.Reliable(0) if qos.reliable else Policy.Reliability.BestEffort,
        Policy.History.KeepLast(depth),
        Policy.Durability.TransientLocal if qos.latched else Policy.Durability.Volatile,
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(names.encode_user_data(data)),
    ]
    if qos.latched and not reader:
        chosen.append(Policy.DurabilityService(0, Policy.History.KeepLast(depth), -1, -1, -1))
    if reader:
        # Only the very same type. Otherwise Cyclone compares the structures of types that differ, and for that it asks
        # everybody for their descriptions. The Cyclone of ROS 2 Jazzy (0.10.5) crashes on the answers, in every node.
        chosen.append(Policy.TypeConsistency.DisallowTypeCoercion())
    else:
        chosen.append(Policy.WriterDataLifecycle(autodispose=False))
    return Qos(*chosen)


def delete_entity(entity: Entity) -> None:
    """Delete an entity now, not when Python finds that nobody needs it any more."""
    entity.__del__()  # does nothing the second time


class DdsWriter:
    """Writes bytes on one DDS topic."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        participant: DomainParticipant,
        topic: str,
        idl: type[IdlStruct],
        qos: Qos,
    ) -> None:
        """Raises PortError when DDS refuses."""
        self._loop = loop
        self.topic = topic
        try:
            self._writer: DataWriter[Any] | None = DataWriter(participant, Topic(participant, topic, idl), qos)
        except DDSException as error:
            raise PortError(f"DDS refuses a writer of {topic}: {error}") from None
        self.handle = int(self._writer._ref)
        self.gid = self._writer.guid.bytes
        self.instance = self._writer.instance_handle & 0xFFFF_FFFF_FFFF_FFFF
        self._outbox: deque[bytes] = deque(maxlen=_OUTBOX_LIMIT)
        self._timer: asyncio.TimerHandle | None = None
        self._loses_messages = False

    def write(self, data: bytes) -> None:
        """Send, at once or as soon as slow readers allow it."""
        if self._writer is None:
            return
        if self._outbox or not self._try_write(data):
            if len(self._outbox) == _OUTBOX_LIMIT and not self._loses_messages:
                self._loses_messages = True
                _LOG.warning("%s: a reader is too slow; messages are lost", self.topic)
            self._outbox.append(data)
            if self._timer is None:
                self._timer = self._loop.call_later(_RETRY_SECONDS, self._flush)

    def matched_readers(self) -> list[int]:
        """Handles of the readers that take it."""
        return self._writer.get_matched_subscriptions() if self._writer is not None else []

    def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._outbox.clear()
        if self._writer is not None:
            delete_entity(self._writer)
            self._writer = None

    def _flush(self) -> None:
        self._timer = None
        while self._outbox and self._writer is not None:
            try:
                sent = self._try_write(self._outbox[0])
            except PortError as error:
                _LOG.warning("%s", error)
                sent = True
            if not sent:
                self._timer = self._loop.call_later(_RETRY_SECONDS, self._flush)
                return
            self._outbox.popleft()

    def _try_write(self, data: bytes) -> bool:
        code = _clayer.ddspy_write(self.handle, data)
        if code < 0 and code != DDSException.DDS_RETCODE_TIMEOUT:
            raise PortError(f"DDS does not send on {self.topic}: {DDSException(code)}")
        return bool(code >= 0)


def make_reader(participant: DomainParticipant, topic: str, idl: type[IdlStruct], qos: Qos) -> DataReader[Any]:
    """Raises PortError when DDS refuses."""
    try:
        return DataReader(participant, Topic(participant, topic, idl), qos)
    except DDSException as error:
        raise PortError(f"DDS refuses a reader of {topic}: {error}") from None
