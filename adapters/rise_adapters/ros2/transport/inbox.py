"""Items that a transport's own thread has taken from the wire and the asyncio loop has not handled yet.

The loop handles them in slices of `SLICE` seconds, between its other work. When it is far behind, the thread waits, so
that further messages stay in the middleware, whose quality of service applies.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from threading import Condition
from time import perf_counter

SLICE = 0.0005
"""Seconds of work in one turn of the loop. A wizard's key waits for some turns."""
LIMIT = 2000
"""Maximum number of waiting items before the thread waits. It continues when half of them are handled."""


class Inbox:
    """All methods belong to the loop's thread, except for `put`."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._waiting: deque[Callable[[], object]] = deque()
        self._room = Condition()
        self._scheduled = False
        self._closed = False

    def put(self, *calls: Callable[[], object], wait: bool = True) -> None:
        """Make the loop call these functions, in order, from any thread. `wait`: for room, if the loop never waits for
        the thread."""
        with self._room:
            if wait and len(self._waiting) >= LIMIT:
                self._room.wait_for(lambda: self._closed or len(self._waiting) <= LIMIT // 2)
            if self._closed:
                return
            self._waiting.extend(calls)
            if self._scheduled:
                return
            self._scheduled = True
        # Without the lock, because the loop needs it when it wakes.
        try:
            self._loop.call_soon_threadsafe(self._deliver)
        except RuntimeError:  # the loop was closed first
            self._closed = True

    def close(self) -> None:
        """Stop delivering, and wake a waiting thread."""
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
            except Exception as error:  # a listener's error: the other items are still handled
                self._loop.call_exception_handler(
                    {"message": f"what was received from ROS was not dealt with: {error}", "exception": error}
                )
            if perf_counter() > until:
                self._loop.call_soon(self._deliver)
                return
