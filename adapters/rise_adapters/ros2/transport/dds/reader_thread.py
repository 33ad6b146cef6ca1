"""Reads from DDS in its own thread, and passes the messages to the asyncio loop (`transport.inbox`).

The thread only waits, takes and passes on. When the loop is far behind, it takes no more. Further messages stay in DDS,
whose quality of service applies. A reader with a pause does not wake the thread during its pause.
"""

from __future__ import annotations

import asyncio
import ctypes
import logging
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial
from threading import Thread
from time import monotonic
from typing import Any

from cyclonedds import _clayer
from cyclonedds.core import (
    DDSException,
    Entity,
    GuardCondition,
    InstanceState,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.internal import dds_infinity
from cyclonedds.pub import DataWriter
from cyclonedds.qos import BasePolicy, Policy, Qos
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from rise_adapters.ros2.transport.dds import names
from rise_adapters.ros2.transport.inbox import Inbox
from rise_adapters.ros2.transport.port import PortError, QoS

_LOG = logging.getLogger(__name__)

# --- readers and writers ----------------------------------------------------------------------------------------------

_RETRY_SECONDS = 0.005
"""Seconds until a message is sent again that DDS refused because a reader is slow."""
_OUTBOX_LIMIT = 10_000
"""Maximum number of messages that wait for this. At the limit, the oldest is dropped."""
_READER_HISTORY = 1000
"""Minimum number of messages that a reader keeps, for those that arrive before the reading thread runs."""


def dds_qos(qos: QoS, data: Mapping[str, str], *, reader: bool, pauses: bool = False) -> Qos:
    """Convert a ROS quality of service for DDS, with user data. `pauses`: the reader needs only the newest messages."""
    depth = max(qos.depth, 1)
    if reader and not qos.latched and not pauses:
        depth = max(depth, _READER_HISTORY)
    chosen: list[BasePolicy] = [
        # Never wait in a write, which would delay everything else. `DdsWriter` keeps refused messages.
        Policy.Reliability.Reliable(0) if qos.reliable else Policy.Reliability.BestEffort,
        Policy.History.KeepLast(depth),
        Policy.Durability.TransientLocal if qos.latched else Policy.Durability.Volatile,
        Policy.DataRepresentation(use_cdrv0_representation=True),
        Policy.Userdata(names.encode_user_data(data)),
    ]
    if qos.latched and not reader:
        chosen.append(Policy.DurabilityService(0, Policy.History.KeepLast(depth), -1, -1, -1))
    if reader:
        # Accept only the same type. Otherwise Cyclone compares the structures of different types, and requests
        # descriptions from everybody. The Cyclone of ROS 2 Jazzy (0.10.5) crashes on the answers, in every node.
        chosen.append(Policy.TypeConsistency.DisallowTypeCoercion())
    else:
        chosen.append(Policy.WriterDataLifecycle(autodispose=False))
    return Qos(*chosen)


def delete_entity(entity: Entity) -> None:
    """Delete an entity now instead of by Python's garbage collection."""
    entity.__del__()  # a second call has no effect


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
        """Raises PortError if DDS refuses."""
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
        """Send data, immediately or when slow readers allow it."""
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
        """Handles of the readers that match."""
        return list_matched(self._writer.get_matched_subscriptions) if self._writer is not None else []

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


def list_matched(handles: Callable[[], list[int]]) -> list[int]:
    """Return handles of the matching ends. DDS counts them first and then lists them. If another one appears meanwhile,
    the wheel's list is too short and it raises IndexError, so this tries again."""
    while True:
        with suppress(IndexError):
            return handles()


def make_reader(participant: DomainParticipant, topic: str, idl: type[IdlStruct], qos: Qos) -> DataReader[Any]:
    """Create a reader. Raises PortError if DDS refuses."""
    try:
        return DataReader(participant, Topic(participant, topic, idl), qos)
    except DDSException as error:
        raise PortError(f"DDS refuses a reader of {topic}: {error}") from None


_MAX_PER_TAKE = 500
"""Maximum number of messages in one call."""
_NOT_READ = ViewState.Any | InstanceState.Any | SampleState.NotRead
_ANY = ViewState.Any | InstanceState.Any | SampleState.Any
TakeSamples = Callable[[int, int], Any]
"""Takes from a reader (handle, maximum number): returns a list, or a negative number."""
HandleSample = Callable[[Any], None]
"""Receives one taken item, on the loop."""


def take_samples(reader: int, most: int) -> Any:
    """Take pairs of bytes and `SampleInfo`."""
    return _clayer.ddspy_take(reader, _ANY, most)


class DdsReader:
    """One reader that the thread reads until it is closed. Its methods belong to the loop's thread."""

    def __init__(
        self,
        reader: DataReader[Any],
        on_sample: HandleSample,
        take: TakeSamples,
        pause: float,
        closed: Callable[[DdsReader], None],
    ) -> None:
        self.is_open = True
        self.handle = int(reader._ref)
        self.take = take
        self.pause = pause
        self.condition = ReadCondition(reader, _NOT_READ)
        self._reader = reader
        self._on_sample = on_sample
        self._closed = closed

    def matched_writers(self) -> list[int]:
        """Handles of the matching writers."""
        return list_matched(self._reader.get_matched_publications) if self.is_open else []

    def deliver(self, sample: Any) -> None:
        if self.is_open:
            self._on_sample(sample)

    def close(self) -> None:
        if self.is_open:
            self.is_open = False
            self._closed(self)
            delete_entity(self.condition)
            delete_entity(self._reader)


class ReaderThread:
    """The reading thread. Its methods belong to the loop's thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, participant: DomainParticipant, name: str) -> None:
        self.failure = ""
        """Why reading has ended; empty: it works."""
        self._inbox = Inbox(loop)
        self._waitset = WaitSet(participant)
        self._guard = GuardCondition(participant)
        self._readers: dict[int, DdsReader] = {}
        """The readers by handle, which the wait set returns when there is something to read."""
        self._closing = False
        self._waitset._waitset_attach(self._waitset._ref, self._guard._ref, 0)
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def add(
        self, reader: DataReader[Any], on_sample: HandleSample, take: TakeSamples = take_samples, pause: float = 0.0
    ) -> DdsReader:
        """Call `on_sample` with every item, until the returned reader is closed. `pause`: seconds without taking after
        each read."""
        added = DdsReader(reader, on_sample, take, pause, self._remove)
        self._readers[added.handle] = added
        self._attach(added)
        return added

    def _attach(self, reader: DdsReader) -> None:
        self._waitset._waitset_attach(self._waitset._ref, reader.condition._ref, reader.handle)

    def _detach(self, reader: DdsReader) -> None:
        self._waitset._waitset_detach(self._waitset._ref, reader.condition._ref)

    def _remove(self, reader: DdsReader) -> None:
        del self._readers[reader.handle]
        self._detach(reader)

    def close(self, wait: float) -> None:
        """End the thread, wait at most `wait` seconds for it, and close the remaining readers."""
        self._closing = True
        self._guard.set(True)
        self._inbox.close()
        self._thread.join(wait)
        for reader in tuple(self._readers.values()):
            reader.close()
        for entity in (self._guard, self._waitset):
            delete_entity(entity)

    # --- the thread ---------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._read()
        except Exception as error:  # after any error, the transport reports its failure
            if not self._closing:
                self.failure = f"reading from DDS ended: {error}"
                _LOG.exception("reading from DDS ended")

    def _read(self) -> None:
        wait, waitset = self._waitset._waitset_wait, self._waitset._ref
        triggered = (ctypes.c_void_p * 64)()
        pausing: deque[tuple[float, DdsReader]] = deque()
        """The paused readers, with the end of each pause."""
        while not self._closing:
            now = monotonic()
            while pausing and pausing[0][0] <= now:
                _, reader = pausing.popleft()
                if reader.is_open:
                    self._attach(reader)
            patience = int((pausing[0][0] - now) * 1e9) if pausing else dds_infinity
            count = wait(waitset, triggered, len(triggered), patience)
            if count < 0:
                raise RuntimeError(f"waiting failed with code {count}")
            deliveries: list[partial[None]] = []
            for index in range(min(count, len(triggered))):
                found = self._readers.get(triggered[index] or 0)
                if found is None:
                    continue
                if found.pause:
                    self._detach(found)
                    pausing.append((monotonic() + found.pause, found))
                taken = found.take(found.handle, _MAX_PER_TAKE)
                if not isinstance(taken, int):
                    deliveries += [partial(found.deliver, sample) for sample in taken]
            if deliveries:
                self._inbox.put(*deliveries)
