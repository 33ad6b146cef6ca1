"""Reading from DDS in a thread of its own, and handing over what came to the asyncio loop (`transport.inbox`).

The thread does nothing but wait, take and hand over. When the loop is far behind it takes no more: the rest stays in
DDS, whose quality of service says what becomes of it.
"""

from __future__ import annotations

import asyncio
import ctypes
import logging
from collections.abc import Callable
from functools import partial
from threading import Thread
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


class ReadSource:
    """One reader that is read."""

    def __init__(self, reader: DataReader[Any], taken: HandleSample, take: TakeSamples) -> None:
        self.reader = reader
        self.handler = taken
        self.take = take
        self.condition = ReadCondition(reader, _NOT_READ)
        self.handle = int(reader._ref)
        self.open = True

    def deliver(self, one: Any) -> None:
        """On the loop."""
        if self.open:
            self.handler(one)


class ReaderThread:
    """The thread. Its methods belong to the loop's thread."""

    def __init__(self, loop: asyncio.AbstractEventLoop, participant: DomainParticipant, name: str) -> None:
        self.failure = ""
        """Why nothing is read any more; empty while all is well."""
        self._inbox = Inbox(loop)
        self._waitset = WaitSet(participant)
        self._guard = GuardCondition(participant)
        self._guard_key = 0
        self._sources: dict[int, ReadSource] = {}
        self._next = 1
        self._closing = False
        self._waitset._waitset_attach(self._waitset._ref, self._guard._ref, self._guard_key)
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def add(self, reader: DataReader[Any], taken: HandleSample, take: TakeSamples = take_samples) -> Callable[[], None]:
        """Have `taken` called with everything that comes; what is returned ends that."""
        source = ReadSource(reader, taken, take)
        key, self._next = self._next, self._next + 1
        self._sources[key] = source
        self._waitset._waitset_attach(self._waitset._ref, source.condition._ref, key)

        def remove() -> None:
            source.open = False
            if self._sources.pop(key, None) is not None:
                self._waitset._waitset_detach(self._waitset._ref, source.condition._ref)
                delete_entity(source.condition)

        return remove

    def close(self, wait: float) -> None:
        """End the thread and wait for it, at most so many seconds."""
        self._closing = True
        for source in self._sources.values():
            source.open = False
        self._guard.set(True)
        self._inbox.close()
        self._thread.join(wait)
        for entity in (*(source.condition for source in self._sources.values()), self._guard, self._waitset):
            delete_entity(entity)
        self._sources.clear()

    # --- the thread ---------------------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._read()
        except Exception as error:
            if not self._closing:
                self.failure = f"reading from DDS ended: {error}"
                _LOG.exception("reading from DDS ended")

    def _read(self) -> None:
        wait, waitset = self._waitset._waitset_wait, self._waitset._ref
        triggered = (ctypes.c_void_p * 64)()
        while not self._closing:
            count = wait(waitset, triggered, len(triggered), dds_infinity)
            if count < 0:
                raise RuntimeError(f"waiting failed with code {count}")
            came: list[partial[None]] = []
            for index in range(min(count, len(triggered))):
                source = self._sources.get(triggered[index] or 0)
                if source is None:
                    continue
                taken = source.take(source.handle, _MOST_PER_TAKE)
                if not isinstance(taken, int):
                    came += [partial(source.deliver, one) for one in taken]
            if came:
                self._inbox.put(*came)
