"""The presence of servers, found by polling: how many, since when, and whether they come and go."""

from __future__ import annotations

from collections import deque

from rise_engine.ports.robot import Clock

SETTLING_SECONDS = 0.5
"""Seconds that an endpoint must stay after a loss before it gets anything. Each further loss doubles them ..."""
MAX_SETTLING_SECONDS = 8.0
UNSTEADY_SECONDS = 30.0
"""... within this many seconds. A server that restarts twenty times in ten seconds is reported once."""


class ServerPresence:
    """The number of servers (or listeners), since when, and how often it has changed."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._losses: deque[float] = deque(maxlen=64)
        self._settled_at = 0.0
        self.count = 0
        """The present number."""
        self.was_seen = False
        """Whether it ever existed."""
        self.appeared_at = 0.0
        """Session time in seconds."""
        self.changes = 0
        """How many times the number has changed. Another server may have answered an earlier request."""
        self.appeared_twice = False
        """Whether there were several when it appeared. (One that joins later may replace one that has just died, which
        DDS continues to show for ten seconds.)"""

    def update(self, count: int) -> bool:
        """Process the present number. Returns whether the last server has just gone."""
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
        """How many times it has gone recently."""
        since = self._clock.now() - UNSTEADY_SECONDS
        while self._losses and self._losses[0] < since:
            self._losses.popleft()
        return len(self._losses)

    @property
    def is_settled(self) -> bool:
        """Whether it has been present for long enough."""
        return self.count > 0 and self._clock.now() >= self._settled_at
