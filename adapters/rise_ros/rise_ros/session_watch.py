"""The logic of a dead man's switch, without ROS: whether the session that moves a robot gives signs of life.

A session announces itself and its state twice a second on the topic `rise/session`, and at the end, that it is over.
"""

from __future__ import annotations

import json

TOPIC = "rise/session"


class SessionWatch:
    """Decides by the session's announcements whether the robot may move. Seconds are of any running clock."""

    def __init__(self, timeout: float, *, required: bool = False) -> None:
        """`timeout`: seconds without a sign of life after which the robot may not move; 0: it always may. `required`:
        it may not move without a session either. Otherwise it may move before the first session, and after one has
        ended in order, so that other programs can use it, such as `ros2 action send_goal`."""
        self._timeout = timeout
        self._required = required
        self._heard: dict[str, float] = {}
        """The present sessions by id, each with its last sign of life."""

    def hear(self, text: str, now: float) -> None:
        """Process a message of the topic."""
        try:
            announced = json.loads(text)
            session, state = str(announced["id"]), announced["state"]
        except (ValueError, LookupError, TypeError, RecursionError):
            return  # not from a session
        if state == "serving":
            self._heard[session] = now
        elif state == "over":
            self._heard.pop(session, None)

    def why_not_move(self, now: float) -> str:
        """Why the robot may not move; empty: it may.

        One silent session is enough, because the robot may be moving for it. Another session lifts this after twice the
        timeout, in which the robot has stopped.
        """
        if self._timeout <= 0:
            return ""
        if any(now <= at + self._timeout for at in self._heard.values()):
            self._heard = {id: at for id, at in self._heard.items() if now <= at + 2 * self._timeout}
        if not self._heard:
            return "no session is there" if self._required else ""
        if all(now <= at + self._timeout for at in self._heard.values()):
            return ""
        return f"the session has given no sign of life for {self._timeout:g} s"
