"""Whether something that comes and goes is there, and is there to stay."""

from __future__ import annotations

from collections import deque

from rise_engine.ports.robot import Clock

SETTLING_SECONDS = 0.5
"""Seconds that one which was gone has to be there before it gets anything; doubled with each further loss ..."""
MAX_SETTLING_SECONDS = 8.0
UNSTEADY_SECONDS = 30.0
"""... within so many seconds. A server that restarts twenty times in ten seconds is reported once, not twenty times."""


class ServerPresence:
    """How many servers (or listeners) there are, since when, and how often that has changed."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._losses: deque[float] = deque(maxlen=64)
        self._settled_at = 0.0
        self.count = 0
        """How many there are."""
        self.was_seen = False
        """It was there once."""
        self.appeared_at = 0.0
        """Session time in seconds."""
        self.changes = 0
        """How often there were suddenly more or fewer: what was asked before may have been answered by another one."""
        self.appeared_twice = False
        """There were several when it appeared. (One that joins later may replace one that died a moment ago, which DDS
        goes on showing for ten seconds.)"""

    def update(self, count: int) -> bool:
        """Take in how many there are now. True when the last one has just gone."""
        before, self.count = self.count, count
        now = self._clock.now()
        if count != before:
            self.changes += 1
        if count and not before:
            self.was_seen = True
            self.appeared_at = now
            self.appeared_twice = count > 1
            losses = self.recent_losses
            seconds = min(SETTLING_SECONDS * 2 ** (losses - 1), MAX_SETTLING_SECONDS) if losses else 0.0
            self._settled_at = now + seconds
        elif before and not count:
            self._losses.append(now)
            return True
        elif count == 1:
            self.appeared_twice = False
        return False

    @property
    def recent_losses(self) -> int:
        """How often it has gone lately."""
        since = self._clock.now() - UNSTEADY_SECONDS
        while self._losses and self._losses[0] < since:
            self._losses.popleft()
        return len(self._losses)

    @property
    def is_settled(self) -> bool:
        """It is there, and has been long enough."""
        return self.count > 0 and self._clock.now() >= self._settled_at
