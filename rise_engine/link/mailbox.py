"""How two threads talk: questions to the engine's loop (`Call`), and records on their way to a client's (`Mailbox`).

Neither side ever waits for the other. Whatever crosses is posted to the other loop; a loop that is closed is forgotten.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress
from typing import Any

from rise_engine.kernel.records import AnyRecord
from rise_engine.link.client import EngineGone

LIMIT = 200_000
"""Records that wait for one client. One that is further behind is cut off and has to attach again."""


class Call:
    """A question to the engine, and the future of another loop that waits for the answer."""

    def __init__(self, loop: asyncio.AbstractEventLoop, future: asyncio.Future[Any]) -> None:
        self._loop = loop
        self.future = future

    def settle(self, result: Any, error: Exception | None) -> None:
        with suppress(RuntimeError):  # the client's loop is closed: nobody waits any more
            self._loop.call_soon_threadsafe(self._set, result, error)

    def _set(self, result: Any, error: Exception | None) -> None:
        if self.future.done():
            return
        if error is None:
            self.future.set_result(result)
        else:
            self.future.set_exception(error)


class Mailbox:
    """Records on their way from the engine's thread to one client's loop."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._records: deque[AnyRecord] = deque()
        self._woken = False
        self._closed = False
        self._finished = False
        self._error: str | None = None
        self._arrived = asyncio.Event()

    # --- engine's thread ---

    def put(self, record: AnyRecord) -> bool:
        """Never waits. False when nobody takes records from here any more."""
        if self._closed:
            return False
        if len(self._records) >= LIMIT:
            self.finish("this client fell too far behind the engine; attach again")
            return False
        self._records.append(record)
        return self._wake()

    def finish(self, error: str | None) -> None:
        """No more records: the engine has ended, or this client is cut off."""
        self._error = error
        self._finished = True
        self._woken = False
        self._wake()

    def _wake(self) -> bool:
        if not self._woken:
            self._woken = True
            try:
                self._loop.call_soon_threadsafe(self._ring)
            except RuntimeError:  # the client's loop is closed
                self._closed = True
        return not self._closed

    # --- client's loop ---

    def _ring(self) -> None:
        # First this, then the taking: a record that comes in between rings once more, and none is left lying.
        self._woken = False
        self._arrived.set()

    def close(self) -> None:
        self._closed = True
        self._records.clear()
        self._finished = True
        self._arrived.set()

    async def batches(self) -> AsyncIterator[Sequence[AnyRecord]]:
        while True:
            await self._arrived.wait()
            self._arrived.clear()
            finished = self._finished
            batch: list[AnyRecord] = []
            with suppress(IndexError):
                while True:
                    batch.append(self._records.popleft())
            if batch:
                yield batch
            if finished and not self._records:
                if self._error is not None:
                    raise EngineGone(self._error)
                return
            if finished:
                self._arrived.set()
