"""A goal that a client has sent to an action server of ours."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

from rise_adapters.ros2.actions.client import ABORTED, CANCELED, SUCCEEDED, UNKNOWN
from rise_adapters.ros2.transport.port import Message, SendReply


class GoalServer(Protocol):
    """What a goal asks its server to do; each gives whether it counted."""

    def accept(self, goal: ServerGoal) -> bool: ...

    def reject(self, goal: ServerGoal) -> bool: ...

    def execute(self, goal: ServerGoal) -> bool: ...

    def publish_feedback(self, goal: ServerGoal, message: Message) -> bool: ...

    def end(self, goal: ServerGoal, status: int, result: Message | None) -> bool: ...


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
        self.result: Message = {}
        """With its status, as it is answered to those who ask for it."""
        self.result_requests: list[SendReply] = []
        """Those who wait for its result."""
        self.cancel_requests: list[Callable[[int], None]] = []
        """Those who wait for a word about its cancelling, as a code of CancelGoal.srv."""
        self.is_asked_to_cancel = False
        """Whoever does it has been asked whether it will be cancelled, and has not decided."""
        self.expires_at = 0.0
        """Until when its result can be asked for, by the server's clock."""

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
        return self._server.accept(self)

    def reject(self) -> bool:
        """Say to the client that it will not be done; that ends it."""
        return self._server.reject(self)

    def execute(self) -> bool:
        """It has begun to run; an accepted goal may wait before that."""
        return self._server.execute(self)

    def publish_feedback(self, message: Message) -> bool:
        """Raises PortError when `message` does not fit the action."""
        return self._server.publish_feedback(self, message)

    def succeed(self, result: Message | None = None) -> bool:
        """End it with `result`, the fields of the action's result; those left out are zero. It is accepted by that too,
        if that was still open."""
        return self._server.end(self, SUCCEEDED, result)

    def abort(self, result: Message | None = None) -> bool:
        """As `succeed`, for one that has failed."""
        return self._server.end(self, ABORTED, result)

    def cancel(self, result: Message | None = None) -> bool:
        """As `succeed`, for one that was cancelled, whoever asked for that."""
        return self._server.end(self, CANCELED, result)
