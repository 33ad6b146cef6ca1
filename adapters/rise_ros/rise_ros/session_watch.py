"""Whether the session that moves a robot still gives signs of life: the logic of a dead man's switch, without ROS.

A session announces itself and its state twice a second on the topic `rise/session`, and at its end that it is over.
"""

from __future__ import annotations

import json

TOPIC = "rise/session"


class SessionWatch:
    """Decides from the session's announcements whether the robot may move. Seconds are of any running clock."""

    def __init__(self, timeout: float, *, required: bool = False) -> None:
        """`timeout`: seconds without a sign of life after which the robot may not move; 0: it always may. `required`:
        it may not move without a session either. Otherwise it may move until one has been heard, and after one has
        ended in order, so that others can use it, such as `ros2 action send_goal`."""
        self._timeout = timeout
        self._required = required
        self._session: object = None
        """The id of the last session that was heard; None: there is none."""
        self._heard_at = 0.0

    def hear(self, said: str, now: float) -> None:
        """Take in a message of the topic."""
        try:
            announced = json.loads(said)
            session, state = announced["id"], announced["state"]
        except (ValueError, LookupError, TypeError, RecursionError):
            return  # not from a session
        if state == "serving":
            self._session, self._heard_at = session, now
        elif state == "over" and session == self._session:
            self._session = None

    def why_not_move(self, now: float) -> str:
        """Why the robot may not move; empty when it may."""
        if self._timeout <= 0:
            return ""
        if self._session is None:
            return "no session is there" if self._required else ""
        if now <= self._heard_at + self._timeout:
            return ""
        return f"the session has given no sign of life for {self._timeout:g} s"
