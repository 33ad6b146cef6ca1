"""Serving a ROS 2 action, on the three services and two topics that one is made of (https://design.ros2.org/articles/actions.html).

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

Several goals at once, one at a time, the latest wins: that is the caller's policy. What the server sees to, whatever
the caller and the clients do:
- a goal has one acceptance or rejection and one ending; what comes after is ignored and says so by giving False;
- an id is taken once, and so is one that has been seen lately;
- a cancel that comes before the acceptance is not lost: it is asked about as soon as the goal is accepted;
- a result can be asked for before the goal is accepted, while it runs, and `result_timeout` seconds after its end;
- what is published and kept has bounds: the status array lists what runs and the latest that ended.

One request to cancel goals, from its coming to its one answer (action_msgs/srv/CancelGoal).

Where this differs from rcl, it follows the comments of CancelGoal.srv: a refused cancel is answered with code 1 (rcl
says 0 with an empty list), and cancelling again what is being cancelled succeeds again.
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


# --- the status of goals ----------------------------------------------------------------------------------------------

STATUS_SECONDS = 0.01
"""Between two status arrays, and for each goal in it ..."""
STATUS_SECONDS_PER_GOAL = 0.002


class StatusPublisher:
    """Publishes the array after a change, and the more seldom the longer it is."""

    def __init__(self, publisher: Publisher, clock: Clock, goals: Callable[[], Sequence[ServerGoal]]) -> None:
        """`goals` gives those that the array is to list."""
        self._publisher = publisher
        self._clock = clock
        self._goals = goals
        self._timer: Timer | None = None
        self._next_at = 0.0
        self._closed = False

    def publish_soon(self) -> None:
        """Something has changed."""
        if self._timer is None and not self._closed:
            self._timer = self._clock.call_at(max(self._clock.now(), self._next_at), self._publish)

    def close(self, *, silently: bool = False) -> None:
        """Publish how all stands at the end (unless `silently`), and nothing any more."""
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
"""Seconds for which a result can be asked for after the end. A client asks as soon as its goal is accepted, so this is
for one that was cut off for a moment; rclpy's 15 minutes would list 900,000 goals at 1,000 in a second."""
MAX_ENDED = 10_000
"""Ended goals that are kept at most, whatever the timeout."""
MAX_LISTED = 20
"""Ended goals that the status array lists at most, the latest."""

Decide: TypeAlias = Callable[[bool], None]
"""Says whether a goal will be cancelled. Only the first call counts."""
TakeGoal: TypeAlias = Callable[[ServerGoal], object]
TakeCancel: TypeAlias = Callable[[ServerGoal, Decide], object]


def accept_cancel(goal: ServerGoal, decide: Decide) -> None:
    """The policy of a server that cancels whatever it is asked to, and looks at `goal.status` meanwhile."""
    decide(True)


class ActionServer:
    """Offers an action. All methods belong to the loop of the transport."""

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
        """Offer the action `name` of `type`; a result is kept `result_timeout` seconds after the end. `feedback` and
        `status` are what these topics promise.

        `take_goal` gets each new goal, `take_cancel` each that is to be cancelled (a goal not twice at a time).

        Neither is called inside a method of a goal. `clock` measures the timeout: `RealClock(loop)` outside of tests.
        Raises PortError when the transport does not know the type.
        """
        self.name = transport.resolve(name)
        self._take_goal = take_goal
        self._take_cancel = take_cancel
        self._clock = clock
        self._timeout = result_timeout
        self._goals: dict[bytes, ServerGoal] = {}
        """Those that have not ended, also those that nobody has decided about yet; the oldest first."""
        self._ended: dict[bytes, ServerGoal] = {}
        """Those that have, whose results can still be asked for; the one that ended first comes first."""
        self._closed = False
        self._expiry: Timer | None = None
        types = action_types(type)
        topics = {part: action_topic(self.name, part) for part in types}
        self._feedback = transport.publisher(topics[FEEDBACK], types[FEEDBACK], feedback)
        publisher = transport.publisher(topics[STATUS_TOPIC], types[STATUS_TOPIC], status)
        self._status = StatusPublisher(publisher, clock, self._listed_goals)
        # The service for goals comes last: who sees it can count on the others.
        self._services = [
            transport.serve(topics[GET_RESULT], types[GET_RESULT], self._take_result_request),
            transport.serve(topics[CANCEL_GOAL], types[CANCEL_GOAL], self._take_cancel_request),
            transport.serve(topics[SEND_GOAL], types[SEND_GOAL], self._take_goal_request),
        ]

    @property
    def goals(self) -> list[ServerGoal]:
        """Those that have not ended, the oldest first; also those that are still to be accepted or rejected."""
        return list(self._goals.values())

    def adopt(self, id: bytes) -> ServerGoal:
        """Take up a goal that a server of this name had accepted before it went down, so that its client can still
        cancel it and get its result. Raises ValueError when there is one of that id."""
        if len(id) != 16 or id == ALL_GOALS or id in self._goals or id in self._ended:
            raise ValueError(f"a goal of the id {id.hex()} cannot be taken up")
        goal = self._goals[id] = ServerGoal(self, id, {}, None)
        goal.status = EXECUTING
        self._status.publish_soon()
        return goal

    def close(self, result: Message | None = None) -> None:
        """Reject what is still to be decided about, abort what runs with `result`, and offer the action no more."""
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
        """Be gone as a program that was killed: nobody is answered, nothing is published, and goals are forgotten."""
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

    # --- what goals need (`GoalServer`) ---------------------------------------------------------------------------

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
        """Its result can be asked for a while."""
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
        """What runs, and the latest that ended."""
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
        except Exception:  # without an answer the client would wait for ever
            _LOG.exception("a goal of %s could not be handled", self.name)
            if not goal.reject():
                goal.abort()

    def _take_result_request(self, request: Message, reply: SendReply) -> None:
        id = bytes(request["goal_id"]["uuid"])
        if (goal := self._goals.get(id)) is not None:
            if len(goal.result_requests) == MAX_WAITING_REPLIES:
                del goal.result_requests[0]  # who asks again and again for the same
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
        except Exception:  # without a decision the client would wait for ever
            _LOG.exception("a goal of %s could not be cancelled", self.name)
            self._decide_cancel(goal, False)

    def _decide_cancel(self, goal: ServerGoal, agreed: bool) -> None:
        if not goal.is_asked_to_cancel:
            return
        if agreed and not goal.has_ended:
            goal.status = CANCELING
            self._status.publish_soon()
        goal.answer_cancels(CANCEL_NONE if agreed else CANCEL_REJECTED)
