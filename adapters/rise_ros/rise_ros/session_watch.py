"""Whether the session that moves a robot still gives signs of life: the logic of a dead man's switch, without ROS.

A session says on the topic `rise/session` twice a second who it is and that it serves, and at its end that it is over.
"""

from __future__ import annotations

import json

TOPIC = "rise/session"


class SessionWatch:
    """Give it what is said, and ask it whether the robot may move. Seconds are of any clock that goes on."""

    def __init__(self, timeout: float, *, required: bool = False) -> None:
        """`timeout`: seconds without a sign of life after which the robot may not move; 0: it always may. `required`:
        it may not move without a session either. Otherwise it may until one has been heard, and after one has ended in
        order: then others use it, such as `ros2 action send_goal`."""
        self._timeout = timeout
        self._required = required
        self._session: object = None
        """The id of the session that was heard last; None: there is none."""
        self._heard_at = 0.0

    def hear(self, said: str, now: float) -> None:
        """Take what was said on the topic."""
        try:
            announced = json.loads(said)
            session, state = announced["id"], announced["state"]
        except (ValueError, LookupError, TypeError, RecursionError):
            return  # no word of a session
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
