"""Measures the delay of an asyncio loop, which shows whether it is blocked."""

from __future__ import annotations

import asyncio
from collections import deque


class LagMeter:
    """Measures the delay of a timer of the loop twenty times a second."""

    TICK = 0.05
    """Seconds between two measurements."""
    KEPT = 100
    """The number of measurements in `recent`: five seconds."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._latest: deque[float] = deque(maxlen=self.KEPT)
        self.max = 0.0
        """The longest delay since the start, in seconds."""
        self._due = loop.time() + self.TICK
        self._timer = loop.call_at(self._due, self._tick)

    @property
    def recent(self) -> float:
        """The longest delay within the last five seconds, in seconds."""
        return max(self._latest, default=0.0)

    def _tick(self) -> None:
        late = max(0.0, self._loop.time() - self._due)
        self._latest.append(late)
        self.max = max(self.max, late)
        self._due = self._loop.time() + self.TICK
        self._timer = self._loop.call_at(self._due, self._tick)

    def close(self) -> None:
        """Stop measuring."""
        self._timer.cancel()
