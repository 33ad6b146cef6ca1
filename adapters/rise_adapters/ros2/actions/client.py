"""The client's side of a ROS 2 action, built from its three services and two topics.

This module contains no policy, such as deadlines and retries (`robot` has it). It uses the parts directly, because
ready-made clients lack functions: own goal ids, cancelling an id that was not accepted, cancelling everything on a
server, requesting a result again. Source: https://design.ros2.org/articles/actions.html, and measurements against rclpy
7.1 (docs/explanation/ros2.md).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

from msgspec import Struct
from msgspec.structs import replace

from rise_adapters.ros2.transport.port import (
    CANCEL_GOAL,
    FEEDBACK,
    GET_RESULT,
    RELIABLE,
    SEND_GOAL,
    STATUS,
    STATUS_TOPIC,
    Message,
    QoS,
    ServiceClient,
    Transport,
    action_topic,
    action_types,
)

UNKNOWN, ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(7)
"""The states of a goal (action_msgs/msg/GoalStatus). UNKNOWN is also the answer about a goal that was never sent."""
STATUS_NAMES = ("unknown", "accepted", "executing", "canceling", "succeeded", "canceled", "aborted")
"""The names of these states, for a person."""
FINAL_STATUSES = frozenset((SUCCEEDED, CANCELED, ABORTED))

CANCEL_NONE, CANCEL_REJECTED, CANCEL_UNKNOWN, CANCEL_TERMINATED = range(4)
"""The answers to a cancel request (action_msgs/srv/CancelGoal). NONE is not an error. Only the list of goals shows
whether something is being cancelled: rclpy answers a refused cancel with NONE and an empty list."""

ALL_GOALS = bytes(16)
"""The goal id that, with a zero stamp, cancels all goals of a server, including those of other clients."""


FEEDBACK_PAUSE = 0.1
"""Seconds between two checks of feedback as a sign of life. A robot may send it a thousand times a second."""


class CancelResponse(Struct, frozen=True):
    """A server's answer to a cancel request."""

    code: int
    goals: tuple[bytes, ...]
    """The goals that are now being cancelled."""


class ActionClient:
    """One action on the wire. It owns its services and subscriptions, and passes on every answer, even a duplicate."""

    def __init__(
        self,
        transport: Transport,
        name: str,
        type: str,
        *,
        now: Callable[[], float] = time.monotonic,
        feedback: QoS | None = RELIABLE,
        status: QoS = STATUS,
    ) -> None:
        """`name` in ROS's form, `type` as `PKG/action/NAME`; `now` in seconds, for `heard_at`. `feedback`, `status`:
        their quality of service; `feedback` None: no subscription. Raises PortError."""
        self.name = transport.resolve(name)
        """The full name."""
        self.heard_at: float | None = None
        """The time of the server's last sign of life: any answer, feedback or status."""
        self.statuses: dict[bytes, int] = {}
        """The server's last status of each goal that it knows, including those of other clients. With several servers,
        also of goals at one that did not publish last: a message does not name its sender."""
        self.on_feedback: Callable[[bytes, Message], None] = _ignore
        """Called with the goal's id and the action's feedback. Of fast feedback, only the newest messages arrive
        (`FEEDBACK_PAUSE`), as many as the depth of the topic, because several goals share it."""
        self.on_status: Callable[[Mapping[bytes, int]], None] = _ignore
        """Called with `statuses` after the server has published them."""
        self._now = now
        types = action_types(type)
        self._send = transport.client(action_topic(self.name, SEND_GOAL), types[SEND_GOAL])
        self._cancel = transport.client(action_topic(self.name, CANCEL_GOAL), types[CANCEL_GOAL])
        self._result = transport.client(action_topic(self.name, GET_RESULT), types[GET_RESULT])
        self._status = transport.subscribe(
            action_topic(self.name, STATUS_TOPIC), types[STATUS_TOPIC], self._take_status, status
        )
        self._subscriptions = [self._status]
        if feedback is not None:
            each_goal = replace(feedback, depth=max(feedback.depth, RELIABLE.depth))  # of those running at a time
            self._subscriptions.append(
                transport.subscribe(
                    action_topic(self.name, FEEDBACK), types[FEEDBACK], self._take_feedback, each_goal, FEEDBACK_PAUSE
                )
            )

    def count_servers(self) -> int:
        """The number of servers; 0 while any of the three services is missing, because a request would be lost."""
        counts = (self._send.count_servers(), self._cancel.count_servers(), self._result.count_servers())
        return max(counts) if all(counts) else 0

    def count_status_publishers(self) -> int:
        """The number of publishers whose status would arrive."""
        return self._status.count_publishers()

    def send(self, goal: bytes, fields: Message, answered: Callable[[bool], None]) -> None:
        """Send a goal with our own id (16 bytes). `answered` receives whether it was accepted. Raises PortError."""
        request = {"goal_id": {"uuid": goal}, "goal": fields}
        self._call(self._send, request, lambda response: answered(bool(response["accepted"])))

    def get_result(self, goal: bytes, ended: Callable[[int, Message], None]) -> None:
        """Request a goal's result: its status and fields, which arrive at its end. Repeated requests are allowed.

        Raises PortError.
        """
        request = {"goal_id": {"uuid": goal}}
        self._call(self._result, request, lambda response: ended(int(response["status"]), response["result"]))

    def cancel(self, goal: bytes, answered: Callable[[CancelResponse], None]) -> None:
        """Ask the server to stop one goal, accepted or not, or `ALL_GOALS`. Raises PortError."""

        def take_response(response: Message) -> None:
            stopping = tuple(bytes(each["goal_id"]["uuid"]) for each in response["goals_canceling"])
            answered(CancelResponse(int(response["return_code"]), stopping))

        self._call(self._cancel, {"goal_info": {"goal_id": {"uuid": goal}}}, take_response)

    def unfinished_goals(self) -> set[bytes]:
        """The goals that the server reports as unfinished, including those of other clients."""
        return {goal for goal, status in self.statuses.items() if status not in FINAL_STATUSES}

    def close(self) -> None:
        """Stop receiving answers. The server's work continues."""
        for part in (self._send, self._cancel, self._result, *self._subscriptions):
            part.close()

    def _call(self, service: ServiceClient, request: Message, take_response: Callable[[Message], None]) -> None:
        def take_sign_of_life(response: Message) -> None:
            self.heard_at = self._now()
            take_response(response)

        service.call(request, take_sign_of_life)

    def _take_feedback(self, message: Message) -> None:
        self.heard_at = self._now()
        self.on_feedback(bytes(message["goal_id"]["uuid"]), message["feedback"])

    def _take_status(self, message: Message) -> None:
        self.heard_at = self._now()
        reported = {bytes(each["goal_info"]["goal_id"]["uuid"]): int(each["status"]) for each in message["status_list"]}
        several = self._status.count_publishers() > 1
        self.statuses = {goal: self.statuses[goal] for goal in self.unfinished_goals() if several} | reported
        self.on_status(self.statuses)


def _ignore(*arguments: object) -> None:
    """Do nothing."""
