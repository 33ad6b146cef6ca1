"""One request to cancel goals, from its coming to its one answer (action_msgs/srv/CancelGoal).

Where this differs from rcl, it follows the comments of CancelGoal.srv: a refused cancel is answered with code 1 (rcl
says 0 with an empty list), and cancelling again what is being cancelled succeeds again.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from rise_adapters.ros2.actions.client import CANCEL_NONE, CANCEL_REJECTED
from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.transport.port import Message

MAX_WAITING_REPLIES = 64
"""Requests to cancel one goal, or for its result, that wait at most."""


class CancelRequest:
    """Waits until there is a word about each goal that it concerns, and answers then."""

    def __init__(self, goals: list[ServerGoal], send_reply: Callable[[Message], object], *, is_about_one: bool) -> None:
        """`is_about_one`: it is about one goal, so that its answer says why that one is not cancelled."""
        self._send_reply = send_reply
        self._is_about_one = is_about_one
        self._undecided = len(goals) + 1
        self._codes: list[int] = []
        self._canceling: list[Message] = []
        for goal in goals:
            if len(goal.cancel_requests) < MAX_WAITING_REPLIES:
                goal.cancel_requests.append(partial(self._take_decision, goal))
            else:
                self._take_decision(goal, CANCEL_REJECTED)
        self._count_down()

    def _take_decision(self, goal: ServerGoal, code: int) -> None:
        if code == CANCEL_NONE:
            self._canceling.append(goal.info)
        self._codes.append(code)
        self._count_down()

    def _count_down(self) -> None:
        self._undecided -= 1
        if self._undecided:
            return
        if self._canceling:
            code = CANCEL_NONE
        elif self._is_about_one:
            code = self._codes[0]
        else:
            code = CANCEL_REJECTED if CANCEL_REJECTED in self._codes else CANCEL_NONE
        self._send_reply({"return_code": code, "goals_canceling": self._canceling})
