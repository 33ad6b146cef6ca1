"""A goal that a client has sent to an action server of ours: its life, from the request to the one ending."""

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
    """What a goal needs of its server."""

    def send_reply(self, reply: SendReply, message: Message) -> bool:
        """Answer a request; gives whether that could be sent."""
        ...

    def send_feedback(self, goal: ServerGoal, message: Message) -> None:
        """Raises PortError when `message` does not fit the action."""
        ...

    def on_status_changed(self, goal: ServerGoal) -> None:
        """It was accepted or rejected, has begun to run, or has ended."""
        ...


class ServerGoal:
    """One goal, for whoever does it: accept or reject it, at once or later; then exactly one ending. What is done too
    late, or twice, changes nothing and says so by giving False. Made by the server."""

    def __init__(self, server: GoalServer, id: bytes, message: Message, reply: SendReply | None) -> None:
        """`reply` says to the client whether it is accepted; None: it was, before this server was there."""
        self.id = id
        """Of its client's making, 16 bytes."""
        self.message = message
        """The goal itself; empty once it has ended."""
        self.status = UNKNOWN
        self.data: object = None
        """For the caller's use."""
        self.is_result_fetched = False
        """Whether somebody has got its result; clients ask for that only when they know that it was accepted."""
        self.received_at_ns = time.time_ns()
        """When it came, since 1970: by that, requests to cancel what is older than some time find it."""
        self._server = server
        # The server's own notes about it:
        self.reply = reply
        seconds, rest = divmod(self.received_at_ns, 1_000_000_000)
        self.info: Message = {"goal_id": {"uuid": id}, "stamp": {"sec": seconds, "nanosec": rest}}
        """As action_msgs/msg/GoalInfo."""
        self.result_requests: list[SendReply] = []
        """Those who wait for its result."""
        self.cancel_requests: list[Callable[[int], None]] = []
        """Those who wait for a word about its cancelling, as a code of CancelGoal.srv."""
        self.is_asked_to_cancel = False
        """Whoever does it has been asked whether it will be cancelled, and has not decided."""
        self.expires_at = 0.0
        """Until when its result can be asked for, by the server's clock."""
        self._result: Message = {}
        """With its status, as it is answered to those who ask for it."""

    @property
    def is_decided(self) -> bool:
        """Whether it was accepted or rejected."""
        return self.reply is None

    @property
    def has_ended(self) -> bool:
        """Whether nothing can become of it any more; also when it was rejected."""
        return self.status >= SUCCEEDED or (self.status == UNKNOWN and self.is_decided)

    # --- what the caller does; each gives whether it counted ----------------------------------------------------

    def accept(self) -> bool:
        """Say to the client that it will be done."""
        reply, self.reply = self.reply, None
        if reply is None:
            return False
        self.status = ACCEPTED
        self._server.send_reply(reply, {"accepted": True, "stamp": self.info["stamp"]})
        self._server.on_status_changed(self)
        return True

    def reject(self) -> bool:
        """Say to the client that it will not be done; that ends it."""
        reply, self.reply = self.reply, None
        if reply is None:
            return False
        self._server.send_reply(reply, {"accepted": False})
        self._finish({"status": UNKNOWN}, CANCEL_UNKNOWN)
        return True

    def execute(self) -> bool:
        """It has begun to run; an accepted goal may wait before that."""
        if self.status == UNKNOWN and not self.accept():
            return False
        if self.status != ACCEPTED:
            return self.status == CANCELING
        self.status = EXECUTING
        self._server.on_status_changed(self)
        return True

    def publish_feedback(self, message: Message) -> bool:
        """Raises PortError when `message` does not fit the action."""
        if self.status not in (ACCEPTED, EXECUTING, CANCELING):
            return False
        self._server.send_feedback(self, message)
        return True

    def succeed(self, result: Message | None = None) -> bool:
        """End it with `result`, the fields of the action's result; those left out are zero. It is accepted by that too,
        if that was still open."""
        return self._end(SUCCEEDED, result)

    def abort(self, result: Message | None = None) -> bool:
        """As `succeed`, for one that has failed."""
        return self._end(ABORTED, result)

    def cancel(self, result: Message | None = None) -> bool:
        """As `succeed`, for one that was cancelled, whoever asked for that."""
        return self._end(CANCELED, result)

    def _end(self, status: int, result: Message | None) -> bool:
        if self.status >= SUCCEEDED or (self.status == UNKNOWN and not self.accept()):
            return False
        self.status = status
        code = CANCEL_NONE if status == CANCELED else CANCEL_TERMINATED
        self._finish({"status": status, "result": result or {}}, code)
        return True

    def _finish(self, result: Message, code: int) -> None:
        """Nothing becomes of it any more: answer those who wait for its result, or for a word about its cancelling."""
        self.message, self._result = {}, result
        self._server.on_status_changed(self)
        requests, self.result_requests = self.result_requests, []
        for reply in requests:
            self.send_result(reply)
        self.answer_cancels(code)

    # --- what the server does -----------------------------------------------------------------------------------

    def send_result(self, reply: SendReply) -> None:
        """Answer who asks for the result, of a goal that has ended."""
        self.is_result_fetched = True
        if not self._server.send_reply(reply, self._result) and self._result.get("result"):
            # A result that does not fit its type would leave the client waiting; what happened is not known then.
            self.status = ABORTED
            self._result = {"status": ABORTED, "result": {}}
            self._server.send_reply(reply, self._result)

    def answer_cancels(self, code: int) -> None:
        """Answer all requests to cancel it."""
        self.is_asked_to_cancel = False
        requests, self.cancel_requests = self.cancel_requests, []
        for answer in requests:
            answer(code)
