"""Reading from DDS in a thread of its own, and handing over what came to the asyncio loop (`transport.inbox`).

The thread does nothing but wait, take and hand over. When the loop is far behind it takes no more: the rest stays in
DDS, whose quality of service says what becomes of it. So it does with a reader that may pause: until that is over, the
thread is not woken for it.
"""

from __future__ import annotations

import asyncio
import ctypes
import logging
from collections import deque
from collections.abc import Callable
from functools import partial
from threading import Thread
from time import monotonic
from typing import Any

from cyclonedds import _clayer
from cyclonedds.core import GuardCondition, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import dds_infinity
from cyclonedds.sub import DataReader

from rise_adapters.ros2.transport.dds.entities import delete_entity
from rise_adapters.ros2.transport.inbox import Inbox

_MOST_PER_TAKE = 500
"""Messages that are taken from DDS in one call."""
_NOT_READ = ViewState.Any | InstanceState.Any | SampleState.NotRead
_ANY = ViewState.Any | InstanceState.Any | SampleState.Any
_LOG = logging.getLogger(__name__)

TakeSamples = Callable[[int, int], Any]
"""Takes from a reader (its handle, at most so many): a list, or a negative number."""
HandleSample = Callable[[Any], None]
"""Gets one thing that was taken, on the loop."""


def take_samples(reader: int, most: int) -> Any:
    """Pairs of bytes and `SampleInfo`."""
    return _clayer.ddspy_take(reader, _ANY, most)


class DdsReader:
    """One reader that the thread reads, until it is closed. Its methods belong to the loop's thread."""

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
        """Handles of the writers that it hears."""
        return self._reader.get_matched_publications() if self.is_open else []

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
    """The thread. Its methods belong to the loop's thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, participant: DomainParticipant, name: str) -> None:
        self.failure = ""
        """Why nothing is read any more; empty while all is well."""
        self._inbox = Inbox(loop)
        self._waitset = WaitSet(participant)
        self._guard = GuardCondition(participant)
        self._readers: dict[int, DdsReader] = {}
        """By the handle, which the wait set gives back when there is something to read."""
        self._closing = False
        self._waitset._waitset_attach(self._waitset._ref, self._guard._ref, 0)
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def add(
        self, reader: DataReader[Any], on_sample: HandleSample, take: TakeSamples = take_samples, pause: float = 0.0
    ) -> DdsReader:
        """Have `on_sample` called with everything that comes, until what is returned is closed. `pause`: seconds for
        which nothing is taken after something was."""
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
        """End the thread and wait for it, at most so many seconds; close what is still read."""
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
        except Exception as error:  # whatever it is, the transport says that it works no more
            if not self._closing:
                self.failure = f"reading from DDS ended: {error}"
                _LOG.exception("reading from DDS ended")

    def _read(self) -> None:
        wait, waitset = self._waitset._waitset_wait, self._waitset._ref
        triggered = (ctypes.c_void_p * 64)()
        pausing: deque[tuple[float, DdsReader]] = deque()
        """And until when."""
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
                taken = found.take(found.handle, _MOST_PER_TAKE)
                if not isinstance(taken, int):
                    deliveries += [partial(found.deliver, sample) for sample in taken]
            if deliveries:
                self._inbox.put(*deliveries)
