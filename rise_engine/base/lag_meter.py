"""How late an asyncio loop is: the measure of whether anything holds it up."""

from __future__ import annotations

import asyncio
from collections import deque


class LagMeter:
    """Measures twenty times a second how late a timer of the loop is."""

    TICK = 0.05
    """Seconds between two measurements."""
    KEPT = 100
    """Measurements that `recent` goes back: five seconds."""

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._latest: deque[float] = deque(maxlen=self.KEPT)
        self.max = 0.0
        """Seconds by which it was late at most, since the beginning."""
        self._due = loop.time() + self.TICK
        self._timer = loop.call_at(self._due, self._tick)

    @property
    def recent(self) -> float:
        """Seconds by which it was late at most, in the latest five seconds."""
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
