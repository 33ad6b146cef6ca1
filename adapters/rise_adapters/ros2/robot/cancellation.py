"""What is known about stopping one goal: who wants it, how often the server was asked, and what it said."""

from __future__ import annotations

from math import inf

from rise_engine.kernel.act_runner import CANCEL_LIMIT

RETRY_SECONDS = 1.0
"""Between requests to cancel that bring nothing."""
MAX_TRIES = 5
"""So many requests follow each other closely; after them the server is asked every SLOW_RETRY_SECONDS."""
SLOW_RETRY_SECONDS = 5.0
MAX_SECONDS = CANCEL_LIMIT - 0.25
"""Seconds. The kernel gives a cancel up after CANCEL_LIMIT; our word about it must be there before."""
OVERDUE_SECONDS = 1.0
"""Before a goal's time limit, from which on a cancel counts as the kernel's, which has recorded an ending."""


class Cancellation:
    """One goal's cancel, before or after the goal's end. All times are session times in seconds."""

    def __init__(self, seconds: float) -> None:
        """`seconds`: what the profile allows from the request to the end."""
        self.seconds = min(seconds, MAX_SECONDS)
        self.wanted = False
        """The engine has asked for it."""
        self.overdue = False
        """... when the goal's time was over."""
        self.deadline = inf
        """By when the goal must have ended."""
        self.next_try = inf
        """When the server is asked (again)."""
        self.tries = 0
        self.confirmed = False
        """The server has said that it cancels it, whoever asked for that."""
        self.refused_at: float | None = None
        """When the server did not let it be stopped for the first time."""
        self._servers = -1
        """The servers (`ServerPresence.changes`) that `tries` counts for."""

    def request(self, now: float, limit: float) -> None:
        """The engine wants it stopped; `limit` is when the kernel gives the goal up."""
        self.wanted = True
        self.overdue = now >= limit - OVERDUE_SECONDS
        self.deadline = now + self.seconds

    def begin_try(self, now: float) -> None:
        """A request is about to be sent."""
        self.tries += 1
        self.next_try = now + (RETRY_SECONDS if self.tries <= MAX_TRIES else SLOW_RETRY_SECONDS)

    def start_over_for(self, servers: int) -> None:
        """Count the tries anew when there are other servers than before."""
        if self._servers != servers:
            self._servers = servers
            self.tries = 0

    def pause(self) -> None:
        """Do not ask again by itself."""
        self.next_try = inf

    def confirm(self) -> None:
        self.confirmed = True
        self.refused_at = None

    def refuse(self, now: float) -> bool:
        """The server did not let it be stopped; or it is at it already, or over at this very moment, which is answered
        the same way. True when it says so again a while later: only then it has refused."""
        if self.refused_at is None:
            self.refused_at = now
            return False
        return now >= self.refused_at + RETRY_SECONDS / 2
