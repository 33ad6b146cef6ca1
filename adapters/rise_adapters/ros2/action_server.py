"""Serving a ROS 2 action, on the three services and two topics that one is made of (https://design.ros2.org/articles/actions.html).

    def wanted(goal: ServerGoal) -> None:        # at once or later: accept or reject, then exactly one ending
        goal.accept()
        goal.execute()
        goal.feedback({"progress": 0.5})
        goal.succeed({"reason": ""})

    def cancel(goal: ServerGoal, decide: Decide) -> None:        # at once or later
        decide(True)
        goal.cancel({"reason": "cancelled"})

    server = ActionServer(transport, "rise/robot/speech", "rise_interfaces/action/Speech", wanted, cancel)

Several goals at once, one at a time, the latest wins: that is the caller's policy. What the server sees to, whatever
the caller and the clients do:
- a goal has one acceptance or rejection and one ending; what comes after is ignored and says so by giving False;
- an id is taken once, and so is one that has been seen lately;
- a cancel that comes before the acceptance is not lost: it is asked about as soon as the goal is accepted;
- a result can be asked for before the goal is accepted, while it runs, and `result_timeout` seconds after its end;
- what is published and kept has bounds: the status array lists what runs and the latest that ended, and it is published
  the more seldom the longer it is.

Where this differs from rcl, it follows the comments of CancelGoal.srv: a refused cancel is answered with code 1 (rcl
says 0 with an empty list), and cancelling again what is being cancelled succeeds again.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from functools import partial
from itertools import islice
from typing import TypeAlias

from rise_adapters.ros2.action_client import (
    ABORTED,
    ACCEPTED,
    CANCEL_NONE,
    CANCEL_REJECTED,
    CANCEL_TERMINATED,
    CANCEL_UNKNOWN,
    CANCELED,
    CANCELING,
    EVERYTHING,
    EXECUTING,
    SUCCEEDED,
    UNKNOWN,
)
from rise_adapters.ros2.port import (
    CANCEL_GOAL,
    FEEDBACK,
    GET_RESULT,
    SEND_GOAL,
    STATUS,
    STATUS_TOPIC,
    Message,
    PortError,
    Reply,
    Transport,
    action_topic,
    action_types,
)
from rise_engine.robot import Clock, Timer

_LOG = logging.getLogger(__name__)

RESULT_TIMEOUT = 10.0
"""Seconds for which a result can be asked for after the end. A client asks as soon as its goal is accepted, so this is
for one that was cut off for a moment; rclpy's 15 minutes would list 900,000 goals at 1,000 in a second."""
KEPT = 10_000
"""Ended goals that are kept at most, whatever the timeout."""
LISTED = 20
"""Ended goals that the status array lists at most, the latest."""
ASKERS = 64
"""Requests for one goal's result, or to cancel it, that wait at most."""
STATUS_SECONDS = 0.01
"""Between two status arrays, and for each goal in it ..."""
STATUS_SECONDS_PER_GOAL = 0.002

Decide: TypeAlias = Callable[[bool], None]
"""Says whether a goal will be cancelled. Only the first call counts."""
Wanted: TypeAlias = "Callable[[ServerGoal], object]"
Cancel: TypeAlias = "Callable[[ServerGoal, Decide], object]"


def accept_cancel(goal: ServerGoal, decide: Decide) -> None:
    """The policy of a server that cancels whatever it is asked to, and looks at `goal.status` meanwhile."""
    decide(True)


class ServerGoal:
    """A goal that a client has sent. Made by the server."""

    __slots__ = ("_cancels", "_deciding", "_expires", "_info", "_result", "_results", "_send", "_server", "data", "id",
                 "message", "nanoseconds", "status", "told")  # fmt: skip

    def __init__(self, server: ActionServer, id: bytes, message: Message, send: Reply | None) -> None:
        self.id = id
        """Of its client's making, 16 bytes."""
        self.message = message
        """The goal itself; empty once it has ended."""
        self.status = UNKNOWN
        self.data: object = None
        """For the caller's use."""
        self.told = False
        """Whether somebody has got its result; clients ask for that only when they know that it was accepted."""
        self.nanoseconds = time.time_ns()
        """When it came, since 1970: by that, requests to cancel what is older than some time find it."""
        self._server = server
        self._send = send
        self._info: Message = {"goal_id": {"uuid": id}, "stamp": self.stamp}
        self._results: list[Reply] = []
        self._cancels: list[Callable[[int], None]] = []
        self._deciding = False
        self._result: Message = {}
        self._expires = 0.0

    @property
    def hex(self) -> str:
        """Its id as 32 digits, to be read."""
        return self.id.hex()

    @property
    def stamp(self) -> Message:
        """When it came, as builtin_interfaces/msg/Time."""
        seconds, rest = divmod(self.nanoseconds, 1_000_000_000)
        return {"sec": seconds, "nanosec": rest}

    @property
    def decided(self) -> bool:
        """Whether it was accepted or rejected."""
        return self._send is None

    @property
    def ended(self) -> bool:
        """Whether nothing can become of it any more; also when it was rejected."""
        return self.status >= SUCCEEDED or (self.status == UNKNOWN and self.decided)

    # --- what the caller does; each gives whether it counted ----------------------------------------------------

    def accept(self) -> bool:
        return self._server._accept(self)

    def reject(self) -> bool:
        return self._server._reject(self)

    def execute(self) -> bool:
        """It has begun to run; an accepted goal may wait before that."""
        return self._server._execute(self)

    def feedback(self, message: Message) -> bool:
        """Raises PortError when `message` does not fit the action."""
        return self._server._feedback(self, message)

    def succeed(self, result: Message | None = None) -> bool:
        """End it; it is accepted by that too, if that was still open."""
        return self._server._end(self, SUCCEEDED, result)

    def abort(self, result: Message | None = None) -> bool:
        return self._server._end(self, ABORTED, result)

    def cancel(self, result: Message | None = None) -> bool:
        """End it as cancelled, whoever asked for that."""
        return self._server._end(self, CANCELED, result)


class ActionServer:
    """Offers an action. All methods belong to the loop of the transport."""

    def __init__(
        self,
        transport: Transport,
        name: str,
        type: str,
        wanted: Wanted,
        cancel: Cancel = accept_cancel,
        *,
        clock: Clock,
        result_timeout: float = RESULT_TIMEOUT,
    ) -> None:
        """`wanted` gets each new goal, `cancel` each that somebody wants cancelled (a goal not twice at a time).

        Neither is called inside a method of a goal. `clock` measures the timeout: `RealClock(loop)` outside of tests.
        Raises PortError when the transport does not know the type.
        """
        self.name = transport.resolve(name)
        self.type = type
        self._wanted = wanted
        self._cancel = cancel
        self._clock = clock
        self._timeout = result_timeout
        self._goals: dict[bytes, ServerGoal] = {}
        """Those that have not ended, also those that nobody has decided about yet; the oldest first."""
        self._ended: dict[bytes, ServerGoal] = {}
        """Those that have, whose results can still be asked for; the one that ended first comes first."""
        self._closed = False
        self._expiry: Timer | None = None
        self._status_timer: Timer | None = None
        self._status_next = 0.0
        types = action_types(type)
        topics = {part: action_topic(self.name, part) for part in types}
        self._feedbacks = transport.publisher(topics[FEEDBACK], types[FEEDBACK])
        self._statuses = transport.publisher(topics[STATUS_TOPIC], types[STATUS_TOPIC], STATUS)
        # The service for goals comes last: who sees it can count on the others.
        self._services = [
            transport.serve(topics[GET_RESULT], types[GET_RESULT], self._result_asked),
            transport.serve(topics[CANCEL_GOAL], types[CANCEL_GOAL], self._cancel_asked),
            transport.serve(topics[SEND_GOAL], types[SEND_GOAL], self._goal_asked),
        ]

    @property
    def goals(self) -> list[ServerGoal]:
        """Those that have not ended, the oldest first; also those that are still to be accepted or rejected."""
        return list(self._goals.values())

    def adopt(self, id: bytes, message: Message | None = None) -> ServerGoal:
        """Take up a goal that a server of this name had accepted before it went down, so that its client can still
        cancel it and get its result. Raises ValueError when there is one of that id."""
        if len(id) != 16 or id == EVERYTHING or id in self._goals or id in self._ended:
            raise ValueError(f"a goal of the id {id.hex()} cannot be taken up")
        goal = self._goals[id] = ServerGoal(self, id, message or {}, None)
        goal.status = EXECUTING
        self._status_changed()
        return goal

    def close(self, result: Message | None = None) -> None:
        """Reject what is still to be decided about, abort what runs with `result`, and offer the action no more."""
        if self._closed:
            return
        self._closed = True
        for goal in self.goals:
            if goal.decided:
                self._end(goal, ABORTED, result)
            else:
                self._reject(goal)
        for timer in (self._expiry, self._status_timer):
            if timer is not None:
                timer.cancel()
        self._publish_status()
        for handle in (*self._services, self._feedbacks, self._statuses):
            handle.close()

    # --- goals in -----------------------------------------------------------------------------------------------

    def _goal_asked(self, request: Message, reply: Reply) -> None:
        id = bytes(request["goal_id"]["uuid"])
        if self._closed or id == EVERYTHING or id in self._goals or id in self._ended:
            self._answer(reply, {"accepted": False})
            return
        goal = self._goals[id] = ServerGoal(self, id, request["goal"], reply)
        try:
            self._wanted(goal)
        except Exception:  # without an answer the client would wait for ever
            _LOG.exception("a goal of %s could not be handled", self.name)
            if not self._reject(goal):
                self._end(goal, ABORTED, None)

    def _accept(self, goal: ServerGoal) -> bool:
        send, goal._send = goal._send, None
        if send is None:
            return False
        goal.status = ACCEPTED
        self._answer(send, {"accepted": True, "stamp": goal._info["stamp"]})
        if goal._cancels:
            self._clock.call_at(self._clock.now(), partial(self._ask_to_cancel, goal))
        self._status_changed()
        return True

    def _reject(self, goal: ServerGoal) -> bool:
        send, goal._send = goal._send, None
        if send is None:
            return False
        self._goals.pop(goal.id, None)
        goal.message = {}
        self._answer(send, {"accepted": False})
        for reply in goal._results:
            self._answer(reply, {"status": UNKNOWN})
        goal._results.clear()
        self._settle_cancels(goal, CANCEL_UNKNOWN)
        return True

    # --- their lives --------------------------------------------------------------------------------------------

    def _execute(self, goal: ServerGoal) -> bool:
        if goal.status == UNKNOWN and not self._accept(goal):
            return False
        if goal.status != ACCEPTED:
            return goal.status == CANCELING
        goal.status = EXECUTING
        self._status_changed()
        return True

    def _feedback(self, goal: ServerGoal, message: Message) -> bool:
        if goal.status not in (ACCEPTED, EXECUTING, CANCELING):
            return False
        self._feedbacks.publish({"goal_id": goal._info["goal_id"], "feedback": message})
        return True

    def _end(self, goal: ServerGoal, status: int, result: Message | None) -> bool:
        if goal.status >= SUCCEEDED or (goal.status == UNKNOWN and not self._accept(goal)):
            return False
        del self._goals[goal.id]
        goal.status = status
        goal.message = {}
        goal._result = {"status": status, "result": result or {}}
        for reply in goal._results:
            self._answer_result(goal, reply)
        goal._results.clear()
        self._settle_cancels(goal, CANCEL_NONE if status == CANCELED else CANCEL_TERMINATED)
        goal._expires = self._clock.now() + self._timeout
        self._ended[goal.id] = goal
        if len(self._ended) > KEPT:
            del self._ended[next(iter(self._ended))]
        if self._expiry is None and not self._closed:
            self._expiry = self._clock.call_at(goal._expires, self._expire)
        self._status_changed()
        return True

    def _expire(self) -> None:
        self._expiry = None
        now, ended = self._clock.now(), self._ended
        over = 0
        for goal in ended.values():
            if goal._expires > now + 0.001:
                self._expiry = self._clock.call_at(goal._expires, self._expire)
                break
            over += 1
        for id in list(islice(ended, over)):
            del ended[id]
        self._status_changed()

    # --- results out --------------------------------------------------------------------------------------------

    def _result_asked(self, request: Message, reply: Reply) -> None:
        id = bytes(request["goal_id"]["uuid"])
        goal = self._goals.get(id)
        if goal is not None:
            if len(goal._results) == ASKERS:
                del goal._results[0]  # who asks again and again for the same
            goal._results.append(reply)
            return
        goal = self._ended.get(id)
        if goal is None:
            self._answer(reply, {"status": UNKNOWN})
        else:
            self._answer_result(goal, reply)

    def _answer_result(self, goal: ServerGoal, reply: Reply) -> None:
        goal.told = True
        if not self._answer(reply, goal._result) and goal._result["result"]:
            # A result that does not fit its type would leave the client waiting; what happened is not known then.
            goal.status = ABORTED
            goal._result = {"status": ABORTED, "result": {}}
            self._answer(reply, goal._result)

    # --- cancelling ---------------------------------------------------------------------------------------------

    def _cancel_asked(self, request: Message, reply: Reply) -> None:
        info = request["goal_info"]
        id = bytes(info["goal_id"]["uuid"])
        until = int(info["stamp"]["sec"]) * 1_000_000_000 + int(info["stamp"]["nanosec"])
        if id != EVERYTHING and not until:
            goal = self._goals.get(id)
            if goal is None:
                code = CANCEL_TERMINATED if id in self._ended else CANCEL_UNKNOWN
                self._answer(reply, {"return_code": code})
                return
            goals = [goal]
        else:
            goals = [goal for goal in self._goals.values() if not until or goal.nanoseconds <= until or goal.id == id]
        _CancelRequest(goals, partial(self._answer, reply), one=id != EVERYTHING and not until)
        for goal in goals:
            if goal.decided:
                self._ask_to_cancel(goal)

    def _ask_to_cancel(self, goal: ServerGoal) -> None:
        if goal.status == CANCELING:
            self._settle_cancels(goal, CANCEL_NONE)
        if goal._deciding or not goal._cancels:
            return
        goal._deciding = True
        try:
            self._cancel(goal, partial(self._decide, goal))
        except Exception:
            _LOG.exception("a goal of %s could not be cancelled", self.name)
            self._decide(goal, False)

    def _decide(self, goal: ServerGoal, agreed: bool) -> None:
        if not goal._deciding:
            return
        if agreed and not goal.ended:
            goal.status = CANCELING
            self._status_changed()
        self._settle_cancels(goal, CANCEL_NONE if agreed else CANCEL_REJECTED)

    def _settle_cancels(self, goal: ServerGoal, code: int) -> None:
        goal._deciding = False
        cancels, goal._cancels = goal._cancels, []
        for settle in cancels:
            settle(code)

    # --- the status array ---------------------------------------------------------------------------------------

    def _status_changed(self) -> None:
        if self._status_timer is None and not self._closed:
            self._status_timer = self._clock.call_at(max(self._clock.now(), self._status_next), self._publish_status)

    def _publish_status(self) -> None:
        self._status_timer = None
        listed = [goal for goal in self._goals.values() if goal.status != UNKNOWN]
        ended = list(islice(reversed(self._ended.values()), LISTED))
        listed += reversed(ended)
        try:
            self._statuses.publish(
                {"status_list": [{"goal_info": goal._info, "status": goal.status} for goal in listed]}
            )
        except PortError as error:
            _LOG.warning("the status of %s could not be published: %s", self.name, error)
        self._status_next = self._clock.now() + STATUS_SECONDS + STATUS_SECONDS_PER_GOAL * len(listed)

    def _answer(self, reply: Reply, message: Message) -> bool:
        try:
            reply(message)
        except PortError as error:
            _LOG.warning("an answer of %s could not be sent: %s", self.name, error)
            return False
        return True


class _CancelRequest:
    """One request to cancel, until there is a word about each goal that it concerns."""

    def __init__(self, goals: list[ServerGoal], answer: Callable[[Message], object], *, one: bool) -> None:
        self._answer = answer
        self._one = one
        self._open = len(goals) + 1
        self._codes: list[int] = []
        self._canceling: list[Message] = []
        for goal in goals:
            if len(goal._cancels) < ASKERS:
                goal._cancels.append(partial(self._settled, goal))
            else:
                self._settled(goal, CANCEL_REJECTED)
        self._count()

    def _settled(self, goal: ServerGoal, code: int) -> None:
        if code == CANCEL_NONE:
            self._canceling.append(goal._info)
        self._codes.append(code)
        self._count()

    def _count(self) -> None:
        self._open -= 1
        if self._open:
            return
        if self._canceling:
            code = CANCEL_NONE
        elif self._one:
            code = self._codes[0]
        else:
            code = CANCEL_REJECTED if CANCEL_REJECTED in self._codes else CANCEL_NONE
        self._answer({"return_code": code, "goals_canceling": self._canceling})
