"""What is known about the result of one goal: how often it was asked for, and what the server has said of its end."""

from __future__ import annotations

from math import inf

from rise_adapters.ros2.actions.client import UNKNOWN
from rise_adapters.ros2.robot.endings import RESULT_GRACE

REPEAT_SECONDS = 5.0
"""After which a running goal's result is asked for once more: a server that was restarted unnoticed answers at once
that it does not know the goal."""
DOUBT_SECONDS = 1.0
"""The same when there is a reason to doubt."""
UNKNOWN_GRACE = 0.3
"""Seconds that the status topic may need to say how a goal has ended whose result the server has thrown away."""


class ResultQuery:
    """Asking for one goal's result. All times are session times in seconds."""

    def __init__(self) -> None:
        self.requests = 0
        """How often it was asked for ..."""
        self.responses = 0
        """... and how often an answer came."""
        self.taken = False
        """A result has been looked at; further ones say the same."""
        self.finished_as = UNKNOWN
        """How the goal is over, in the words of the status topic; UNKNOWN: it does not say so."""
        self.missing_at = inf
        """From when on the result of a goal that is over counts as missing."""
        self.discarded_at = inf
        """From when on a server that says that it does not know the goal has had the time to say how it ended."""
        self._requested_at = 0.0

    def request(self, now: float) -> None:
        """A request is about to be sent."""
        self.requests += 1
        self._requested_at = now

    def receive(self) -> bool:
        """An answer has come. Whether it is one more than was asked for."""
        self.responses += 1
        return self.responses > self.requests

    def finish(self, now: float, status: int) -> None:
        """The status topic says that the goal is over."""
        self.finished_as = status
        self.missing_at = now + RESULT_GRACE

    def disown(self, now: float) -> None:
        """The server says that it does not know the goal; what that means is decided a moment later."""
        self.discarded_at = now + UNKNOWN_GRACE

    def is_due(self, now: float) -> bool:
        return now >= self._requested_at + REPEAT_SECONDS

    def may_doubt(self, now: float) -> bool:
        """Whether the last request is so long ago that another one is worth it, where something seems to be wrong."""
        return now >= self._requested_at + DOUBT_SECONDS

    def next_deadline(self) -> float:
        """When something is due: to ask again, or to ask no more."""
        return min(self._requested_at + REPEAT_SECONDS, self.missing_at, self.discarded_at)
