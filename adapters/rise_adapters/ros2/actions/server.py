"""Serves a ROS 2 action on its three services and two topics (https://design.ros2.org/articles/actions.html).

    def take_goal(goal: ServerGoal) -> None:        # at once or later: accept or reject, then exactly one ending
        goal.accept()
        goal.execute()
        goal.publish_feedback({"progress": 0.5})
        goal.succeed({"reason": ""})

    def take_cancel(goal: ServerGoal, decide: Decide) -> None:        # at once or later
        decide(True)
        goal.cancel({"reason": "cancelled"})

    type = "rise_interfaces/action/Speech"
    server = ActionServer(transport, "rise/robot/speech", type, take_goal, take_cancel, clock=clock)

The caller decides the policy: several goals together, one at a time, or the latest wins. The server guarantees:
- A goal has one acceptance or rejection and one ending. Later calls are ignored and return False.
- A goal id is accepted once, and an id that was seen recently is not accepted again.
- A cancel before the acceptance is not lost: `take_cancel` follows as soon as the goal is accepted.
- A client can ask for a result before the acceptance, while the goal runs, and `result_timeout` seconds after its end.
- Published and kept data is bounded: the status array lists the running goals and the latest ended ones.

A request to cancel goals gets exactly one answer (action_msgs/srv/CancelGoal).

Two differences from rcl follow the comments of CancelGoal.srv: a refused cancel is answered with code 1 (rcl answers 0
with an empty list), and a second cancel of the same goal succeeds again.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from functools import partial
from itertools import islice, takewhile
from typing import TypeAlias

from rise_adapters.ros2.actions.client import (
    ABORTED,
    ACCEPTED,
    ALL_GOALS,
    CANCEL_NONE,
    CANCEL_REJECTED,
    CANCEL_TERMINATED,
    CANCEL_UNKNOWN,
    CANCELING,
    EXECUTING,
    UNKNOWN,
)
from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.transport.port import (
    CANCEL_GOAL,
    FEEDBACK,
    GET_RESULT,
    RELIABLE,
    SEND_GOAL,
    STATUS,
    STATUS_TOPIC,
    Message,
    PortError,
    Publisher,
    QoS,
    SendReply,
    Transport,
    action_topic,
    action_types,
)
from rise_engine.ports.robot import Clock, Timer

_LOG = logging.getLogger(__name__)

# --- requests to cancel -----------------------------------------------------------------------------------------------

MAX_WAITING_REPLIES = 64
"""Maximum number of requests that wait to cancel one goal, or for its result."""


class CancelRequest:
    """Waits for a decision about each of its goals, then answers."""

    def __init__(self, goals: list[ServerGoal], send_reply: Callable[[Message], object], *, is_about_one: bool) -> None:
        """`is_about_one`: it names one goal, so its answer gives the reason if that goal is not cancelled."""
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


# --- the status of goals ----------------------------------------------------------------------------------------------

STATUS_SECONDS = 0.01
"""Seconds between two status arrays, and for each goal in the array ..."""
STATUS_SECONDS_PER_GOAL = 0.002


class StatusPublisher:
    """Publishes the array after a change; the longer the array, the less often."""

    def __init__(self, publisher: Publisher, clock: Clock, goals: Callable[[], Sequence[ServerGoal]]) -> None:
        """`goals` returns the goals for the array."""
        self._publisher = publisher
        self._clock = clock
        self._goals = goals
        self._timer: Timer | None = None
        self._next_at = 0.0
        self._closed = False

    def publish_soon(self) -> None:
        """Note that something has changed."""
        if self._timer is None and not self._closed:
            self._timer = self._clock.call_at(max(self._clock.now(), self._next_at), self._publish)

    def close(self, *, silently: bool = False) -> None:
        """Publish the final state (unless `silently`), and then nothing more."""
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
        if not silently:
            self._publish()
        self._publisher.close()

    def _publish(self) -> None:
        self._timer = None
        listed = self._goals()
        try:
            self._publisher.publish(
                {"status_list": [{"goal_info": goal.info, "status": goal.status} for goal in listed]}
            )
        except PortError as error:
            _LOG.warning("the status of goals could not be published: %s", error)
        self._next_at = self._clock.now() + STATUS_SECONDS + STATUS_SECONDS_PER_GOAL * len(listed)


RESULT_TIMEOUT = 10.0
"""Seconds after its end for which a result can be requested. A client asks as soon as its goal is accepted, so this is
for a client that was cut off briefly. The 15 minutes of rclpy would keep 900,000 goals at 1,000 a second."""
MAX_ENDED = 10_000
"""Maximum number of ended goals that are kept, whatever the timeout."""
MAX_LISTED = 20
"""Maximum number of ended goals in the status array: the latest ones."""

Decide: TypeAlias = Callable[[bool], None]
"""Decides whether a goal will be cancelled. Only the first call counts."""
TakeGoal: TypeAlias = Callable[[ServerGoal], object]
TakeCancel: TypeAlias = Callable[[ServerGoal, Decide], object]


def accept_cancel(goal: ServerGoal, decide: Decide) -> None:
    """Accept every cancel, for a server that watches `goal.status` during its work."""
    decide(True)


class ActionServer:
    """Offers an action. All methods belong to the transport's loop."""

    def __init__(
        self,
        transport: Transport,
        name: str,
        type: str,
        take_goal: TakeGoal,
        take_cancel: TakeCancel = accept_cancel,
        *,
        clock: Clock,
        result_timeout: float = RESULT_TIMEOUT,
        feedback: QoS = RELIABLE,
        status: QoS = STATUS,
    ) -> None:
        """Offer the action `name` of `type`. A result is kept for `result_timeout` seconds after the end. `feedback`
        and `status` are these topics' quality of service.

        `take_goal` receives each new goal, `take_cancel` each goal to cancel (never the same goal twice at a time).

        Neither is called inside a method of a goal. `clock` measures the timeout: `RealClock(loop)` outside of tests.
        Raises PortError if the transport does not know the type.
        """
        self.name = transport.resolve(name)
        self._take_goal = take_goal
        self._take_cancel = take_cancel
        self._clock = clock
        self._timeout = result_timeout
        self._goals: dict[bytes, ServerGoal] = {}
        """Goals that have not ended, including undecided ones, the oldest first."""
        self._ended: dict[bytes, ServerGoal] = {}
        """Ended goals whose results can still be requested, in the order of their endings."""
        self._closed = False
        self._expiry: Timer | None = None
        types = action_types(type)
        topics = {part: action_topic(self.name, part) for part in types}
        self._feedback = transport.publisher(topics[FEEDBACK], types[FEEDBACK], feedback)
        publisher = transport.publisher(topics[STATUS_TOPIC], types[STATUS_TOPIC], status)
        self._status = StatusPublisher(publisher, clock, self._listed_goals)
        # The service for goals comes last, so that clients that see it can rely on the others.
        self._services = [
            transport.serve(topics[GET_RESULT], types[GET_RESULT], self._take_result_request),
            transport.serve(topics[CANCEL_GOAL], types[CANCEL_GOAL], self._take_cancel_request),
            transport.serve(topics[SEND_GOAL], types[SEND_GOAL], self._take_goal_request),
        ]

    @property
    def goals(self) -> list[ServerGoal]:
        """Goals that have not ended, including undecided ones, the oldest first."""
        return list(self._goals.values())

    def adopt(self, id: bytes) -> ServerGoal:
        """Take over a goal that an earlier server of this name had accepted, so that its client can still cancel it and
        get its result. Raises ValueError if a goal with that id exists."""
        if len(id) != 16 or id == ALL_GOALS or id in self._goals or id in self._ended:
            raise ValueError(f"a goal of the id {id.hex()} cannot be taken up")
        goal = self._goals[id] = ServerGoal(self, id, {}, None)
        goal.status = EXECUTING
        self._status.publish_soon()
        return goal

    def close(self, result: Message | None = None) -> None:
        """Reject undecided goals, abort running ones with `result`, and stop offering the action."""
        if self._closed:
            return
        self._closed = True
        for goal in self.goals:
            if goal.is_decided:
                goal.abort(result)
            else:
                goal.reject()
        self._status.close()
        self._release()

    def vanish(self) -> None:
        """Disappear like a killed program: send no answers, publish nothing, and forget all goals."""
        if self._closed:
            return
        self._closed = True
        for goal in self.goals:
            goal.status, goal.reply = ABORTED, None
            goal.result_requests.clear()
            goal.cancel_requests.clear()
        self._goals.clear()
        self._status.close(silently=True)
        self._release()

    def _release(self) -> None:
        if self._expiry is not None:
            self._expiry.cancel()
        for handle in (*self._services, self._feedback):
            handle.close()

    # --- for goals (`GoalServer`) ---------------------------------------------------------------------------------

    def send_reply(self, reply: SendReply, message: Message) -> bool:
        try:
            reply(message)
        except PortError as error:
            _LOG.warning("an answer of %s could not be sent: %s", self.name, error)
            return False
        return True

    def send_feedback(self, goal: ServerGoal, message: Message) -> None:
        self._feedback.publish({"goal_id": goal.info["goal_id"], "feedback": message})

    def on_status_changed(self, goal: ServerGoal) -> None:
        if goal.has_ended:
            del self._goals[goal.id]
            if goal.status == UNKNOWN:
                return
            self._keep(goal)
        elif goal.status == ACCEPTED and goal.cancel_requests:
            self._clock.call_at(self._clock.now(), partial(self._request_cancel, goal))
        self._status.publish_soon()

    def _keep(self, goal: ServerGoal) -> None:
        """Keep an ended goal, whose result can be requested for a while."""
        goal.expires_at = self._clock.now() + self._timeout
        self._ended[goal.id] = goal
        if len(self._ended) > MAX_ENDED:
            del self._ended[next(iter(self._ended))]
        if self._expiry is None and not self._closed:
            self._expiry = self._clock.call_at(goal.expires_at, self._expire)

    def _expire(self) -> None:
        self._expiry = None
        until = self._clock.now() + 0.001
        for goal in list(takewhile(lambda goal: goal.expires_at <= until, self._ended.values())):
            del self._ended[goal.id]
        if self._ended:
            self._expiry = self._clock.call_at(next(iter(self._ended.values())).expires_at, self._expire)
        self._status.publish_soon()

    def _listed_goals(self) -> list[ServerGoal]:
        """The running goals, and the latest ended ones."""
        running = [goal for goal in self._goals.values() if goal.status != UNKNOWN]
        return [*running, *reversed(list(islice(reversed(self._ended.values()), MAX_LISTED)))]

    # --- requests -----------------------------------------------------------------------------------------------

    def _take_goal_request(self, request: Message, reply: SendReply) -> None:
        id = bytes(request["goal_id"]["uuid"])
        if self._closed or id == ALL_GOALS or id in self._goals or id in self._ended:
            self.send_reply(reply, {"accepted": False})
            return
        goal = self._goals[id] = ServerGoal(self, id, request["goal"], reply)
        try:
            self._take_goal(goal)
        except Exception:  # without an answer, the client would wait forever
            _LOG.exception("a goal of %s could not be handled", self.name)
            if not goal.reject():
                goal.abort()

    def _take_result_request(self, request: Message, reply: SendReply) -> None:
        id = bytes(request["goal_id"]["uuid"])
        if (goal := self._goals.get(id)) is not None:
            if len(goal.result_requests) == MAX_WAITING_REPLIES:
                del goal.result_requests[0]  # from a client that repeats its request
            goal.result_requests.append(reply)
        elif (goal := self._ended.get(id)) is not None:
            goal.send_result(reply)
        else:
            self.send_reply(reply, {"status": UNKNOWN})

    def _take_cancel_request(self, request: Message, reply: SendReply) -> None:
        info = request["goal_info"]
        id = bytes(info["goal_id"]["uuid"])
        until = int(info["stamp"]["sec"]) * 1_000_000_000 + int(info["stamp"]["nanosec"])
        is_about_one = id != ALL_GOALS and not until
        if is_about_one and id not in self._goals:
            code = CANCEL_TERMINATED if id in self._ended else CANCEL_UNKNOWN
            self.send_reply(reply, {"return_code": code})
            return
        if is_about_one:
            goals = [self._goals[id]]
        else:
            goals = [goal for goal in self.goals if not until or goal.received_at_ns <= until or goal.id == id]
        CancelRequest(goals, partial(self.send_reply, reply), is_about_one=is_about_one)
        for goal in goals:
            if goal.is_decided:
                self._request_cancel(goal)

    def _request_cancel(self, goal: ServerGoal) -> None:
        if goal.status == CANCELING:
            goal.answer_cancels(CANCEL_NONE)
        if goal.is_asked_to_cancel or not goal.cancel_requests:
            return
        goal.is_asked_to_cancel = True
        try:
            self._take_cancel(goal, partial(self._decide_cancel, goal))
        except Exception:  # without a decision, the client would wait forever
            _LOG.exception("a goal of %s could not be cancelled", self.name)
            self._decide_cancel(goal, False)

    def _decide_cancel(self, goal: ServerGoal, agreed: bool) -> None:
        if not goal.is_asked_to_cancel:
            return
        if agreed and not goal.has_ended:
            goal.status = CANCELING
            self._status.publish_soon()
        goal.answer_cancels(CANCEL_NONE if agreed else CANCEL_REJECTED)
