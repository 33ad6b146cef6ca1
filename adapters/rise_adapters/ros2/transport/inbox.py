"""What a transport's own thread has taken from the wire and the asyncio loop has not dealt with yet.

The loop works it off in slices of `SLICE_SECONDS` seconds with everything else between them. When it is far behind, the
thread waits, so that what comes stays in the middleware, whose quality of service says what becomes of it.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from threading import Condition
from time import perf_counter

SLICE = 0.0005
"""Seconds that one turn of the loop may be taken: a wizard's key waits for some turns."""
LIMIT = 2000
"""What may wait before the thread does; it goes on when half of that is dealt with."""


class Inbox:
    """Belongs to the loop's thread, but for `put`."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._waiting: deque[Callable[[], object]] = deque()
        self._room = Condition()
        self._scheduled = False
        self._closed = False

    def put(self, *calls: Callable[[], object], wait: bool = True) -> None:
        """From any thread: have the loop make these calls, in their order. `wait`: until there is room; only for a
        thread that the loop never waits for."""
        with self._room:
            if wait and len(self._waiting) >= LIMIT:
                self._room.wait_for(lambda: self._closed or len(self._waiting) <= LIMIT // 2)
            if self._closed:
                return
            self._waiting.extend(calls)
            if self._scheduled:
                return
            self._scheduled = True
        # Without the lock, which the loop wants as soon as it is woken.
        try:
            self._loop.call_soon_threadsafe(self._deliver)
        except RuntimeError:  # the loop was closed before the transport
            self._closed = True

    def close(self) -> None:
        """Nothing is delivered any more, and nobody waits for room."""
        with self._room:
            self._closed = True
            self._waiting.clear()
            self._room.notify_all()

    def _deliver(self) -> None:
        until = perf_counter() + SLICE
        while True:
            with self._room:
                if not self._waiting or self._closed:
                    self._scheduled = False
                    return
                call = self._waiting.popleft()
                if len(self._waiting) == LIMIT // 2:
                    self._room.notify_all()
            try:
                call()
            except Exception as error:  # of whoever listens: what else came is dealt with
                self._loop.call_exception_handler(
                    {"message": f"what was received from ROS was not dealt with: {error}", "exception": error}
                )
            if perf_counter() > until:
                self._loop.call_soon(self._deliver)
                return
