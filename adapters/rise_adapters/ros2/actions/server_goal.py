"""A goal that a client sent to one of our action servers, from the request to its one ending."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from rise_adapters.ros2.actions.client import (
    ABORTED,
    ACCEPTED,
    CANCEL_NONE,
    CANCEL_TERMINATED,
    CANCEL_UNKNOWN,
    CANCELED,
    CANCELING,
    EXECUTING,
    SUCCEEDED,
    UNKNOWN,
)
from rise_adapters.ros2.transport.port import Message, SendReply


class GoalServer(Protocol):
    """The part of a server that its goals use."""

    def send_reply(self, reply: SendReply, message: Message) -> bool:
        """Answer a request. Returns whether the answer could be sent."""
        ...

    def send_feedback(self, goal: ServerGoal, message: Message) -> None:
        """Publish feedback. Raises PortError if `message` does not fit the action."""
        ...

    def on_status_changed(self, goal: ServerGoal) -> None:
        """Note that the goal was accepted or rejected, has begun to run, or has ended."""
        ...


class ServerGoal:
    """One goal, for the code that carries it out: accept or reject it, now or later, then end it exactly once. A late
    or repeated call has no effect and returns False. Created by the server."""

    def __init__(self, server: GoalServer, id: bytes, message: Message, reply: SendReply | None) -> None:
        """`reply` sends the client the acceptance or rejection; None: an earlier server has accepted the goal."""
        self.id = id
        """The client's id, 16 bytes."""
        self.message = message
        """The goal message; empty once the goal has ended."""
        self.status = UNKNOWN
        self.data: object = None
        """For the caller's use."""
        self.is_result_fetched = False
        """Whether a client has received its result. Clients request it only after the acceptance."""
        self.received_at_ns = time.time_ns()
        """Its arrival in nanoseconds since 1970, for requests to cancel goals older than some time."""
        self._server = server
        # For the server:
        self.reply = reply
        seconds, rest = divmod(self.received_at_ns, 1_000_000_000)
        self.info: Message = {"goal_id": {"uuid": id}, "stamp": {"sec": seconds, "nanosec": rest}}
        """As action_msgs/msg/GoalInfo."""
        self.result_requests: list[SendReply] = []
        """The replies that wait for its result."""
        self.cancel_requests: list[Callable[[int], None]] = []
        """The callbacks that wait for a decision about a cancel, as a code of CancelGoal.srv."""
        self.is_asked_to_cancel = False
        """Whether the caller was asked about a cancel and has not decided."""
        self.expires_at = 0.0
        """The end of the time for requesting its result, on the server's clock."""
        self._result: Message = {}
        """The result with its status, as clients receive it."""

    @property
    def is_decided(self) -> bool:
        """Whether it was accepted or rejected."""
        return self.reply is None

    @property
    def has_ended(self) -> bool:
        """Whether the goal is over, or was rejected."""
        return self.status >= SUCCEEDED or (self.status == UNKNOWN and self.is_decided)

    # --- calls of the caller; each returns whether it counted ---------------------------------------------------

    def accept(self) -> bool:
        """Tell the client that the goal was accepted."""
        reply, self.reply = self.reply, None
        if reply is None:
            return False
        self.status = ACCEPTED
        self._server.send_reply(reply, {"accepted": True, "stamp": self.info["stamp"]})
        self._server.on_status_changed(self)
        return True

    def reject(self) -> bool:
        """Tell the client that the goal was rejected. This ends it."""
        reply, self.reply = self.reply, None
        if reply is None:
            return False
        self._server.send_reply(reply, {"accepted": False})
        self._finish({"status": UNKNOWN}, CANCEL_UNKNOWN)
        return True

    def execute(self) -> bool:
        """Note that it has begun to run. An accepted goal may wait before that."""
        if self.status == UNKNOWN and not self.accept():
            return False
        if self.status != ACCEPTED:
            return self.status == CANCELING
        self.status = EXECUTING
        self._server.on_status_changed(self)
        return True

    def publish_feedback(self, message: Message) -> bool:
        """Publish feedback. Raises PortError if `message` does not fit the action."""
        if self.status not in (ACCEPTED, EXECUTING, CANCELING):
            return False
        self._server.send_feedback(self, message)
        return True

    def succeed(self, result: Message | None = None) -> bool:
        """End it with `result`, the action's result; missing fields are zero. This also accepts an undecided goal."""
        return self._end(SUCCEEDED, result)

    def abort(self, result: Message | None = None) -> bool:
        """Like `succeed`, for a goal that has failed."""
        return self._end(ABORTED, result)

    def cancel(self, result: Message | None = None) -> bool:
        """Like `succeed`, for a goal that any client has cancelled."""
        return self._end(CANCELED, result)

    def _end(self, status: int, result: Message | None) -> bool:
        if self.status >= SUCCEEDED or (self.status == UNKNOWN and not self.accept()):
            return False
        self.status = status
        code = CANCEL_NONE if status == CANCELED else CANCEL_TERMINATED
        self._finish({"status": status, "result": result or {}}, code)
        return True

    def _finish(self, result: Message, code: int) -> None:
        """End the goal, and answer all requests for its result or for a cancel."""
        self.message, self._result = {}, result
        self._server.on_status_changed(self)
        requests, self.result_requests = self.result_requests, []
        for reply in requests:
            self.send_result(reply)
        self.answer_cancels(code)

    # --- calls of the server ------------------------------------------------------------------------------------

    def send_result(self, reply: SendReply) -> None:
        """Send the result of an ended goal to a client that requests it."""
        self.is_result_fetched = True
        if not self._server.send_reply(reply, self._result) and self._result.get("result"):
            # A result that does not fit its type would leave the client waiting. So the outcome becomes ABORTED.
            self.status = ABORTED
            self._result = {"status": ABORTED, "result": {}}
            self._server.send_reply(reply, self._result)

    def answer_cancels(self, code: int) -> None:
        """Answer all requests to cancel it."""
        self.is_asked_to_cancel = False
        requests, self.cancel_requests = self.cancel_requests, []
        for answer in requests:
            answer(code)
