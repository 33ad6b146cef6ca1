"""Goals at services and topics.

A service carries an action as one call with its response. No call can be cancelled: cancelling the action ends it for
the engine, but the robot may continue until it answers, also while its program is out of sight. Until it answers, or
another program offers the service, the service gets no other call.

A topic carries an action as a message, sent once or at a rate. The action lasts its expected time, and the profile's
reset takes it back. A topic gives no answer, so a listener counts as acceptance, and the end of the time as success.
The goal is open until every program with its message has received the reset (`Listeners`). Only the listeners at its
start get repetitions, because a base that starts up must not begin midway.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.robot import endings
from rise_adapters.ros2.robot.endpoints import NOT_HEARD, ServiceEndpoint, TopicEndpoint
from rise_adapters.ros2.robot.goal_host import TIMER_TOLERANCE, Ending, GoalHost, Phase
from rise_adapters.ros2.robot.waiting import Waiting
from rise_adapters.ros2.transport.port import Message, PortError
from rise_engine.base.suspend import suspended_seconds
from rise_engine.kernel.commands import StartAction
from rise_engine.ports.robot import Timer

# --- topics -----------------------------------------------------------------------------------------------------------

STANDSTILL_SECONDS, STANDSTILL_PERIODS = 1.0, 3.0
"""A longer pause between two repetitions, in seconds and in periods, ends the goal."""


class TopicGoal:
    """One of our messages on one topic, until its time is over. Implements `Goal`."""

    def __init__(
        self,
        host: GoalHost,
        endpoint: TopicEndpoint,
        goal: StartAction,
        mapping: ActionMapping,
        make_message: Callable[[], Message],
    ) -> None:
        self.action = goal.action
        self.type = goal.type
        self.phase: Phase = "waiting"
        self.may_be_running = False
        self.endpoint = endpoint
        self._host = host
        self._make_message = make_message
        self._is_stoppable = mapping.stoppable
        self._is_harmless = mapping.harmless
        self._rate = mapping.rate
        self._sent_at = -inf
        self._suspended = 0.0
        """`suspended_seconds` at `_sent_at`."""
        self._listeners: frozenset[bytes] = frozenset()
        """The programs that listened at its first message."""
        self._repeat: Timer | None = None
        self._expected = goal.expected
        self._waiting = Waiting(host, mapping.deadlines.server)
        self._deadline = self._waiting.until

    def adopt(self, *, accepted: bool) -> None:
        """Take over a message that an earlier engine has published; the reset ends it."""
        self.phase = "ended"
        self.may_be_running = True
        if self._is_stoppable:
            self.endpoint.adopt(self)
        else:
            self._leave_unstopped()
        self._host.on_goal_changed(self)

    def _leave_unstopped(self) -> None:
        self.may_be_running = not self._is_harmless
        if self._is_harmless:
            return
        self.endpoint.unstopped = self

    def cancel(self) -> None:
        if self.phase == "ended" and self.endpoint.is_open(self):
            self.endpoint.take_back(self)
            self._check_open()
        elif self.phase == "waiting":
            self._end("canceled", "it had not been sent yet")
        elif self.phase == "running":
            self._end("canceled", "")

    @property
    def is_accepted(self) -> bool:
        return True

    @property
    def is_unanswerable(self) -> bool:
        return False

    @property
    def holds_its_part(self) -> bool:
        return self._is_stoppable

    def release(self, by: str = "somebody") -> None:
        if self.phase == "ended" and self.may_be_running:
            self._host.report_note(
                self.endpoint, f"released: {by} has released {self.endpoint.name}; {self.why_open()}"
            )
        self.endpoint.release(self)
        self.may_be_running = False
        self._host.on_goal_changed(self)

    def why_open(self) -> str:
        if not self._is_stoppable:
            return "its topic cannot be stopped"
        is_adopted = self.phase == "ended" and self.endpoint.user is self
        return "an engine that has gone began it" if is_adopted else NOT_HEARD

    def is_live(self) -> bool:
        return self.phase != "ended" or (self.may_be_running and self._is_stoppable)

    def next_deadline(self) -> float:
        return self._deadline if self.phase != "ended" else inf

    def poll(self) -> None:
        now = self._host.clock.now() + TIMER_TOLERANCE
        if self.phase == "waiting":
            if ending := self._waiting.poll(self.endpoint, self._publish, self._why_not_published):
                self._end(*ending)
        elif self.phase == "running" and now >= self._deadline:
            self._end("succeeded", "")
        elif self.phase == "ended":
            self._check_open()

    def _why_not_published(self, is_over: bool) -> endings.Outcome | None:
        return ("failed", f"server-missing: {endings.describe_missing(self.endpoint)}") if is_over else None

    def on_server_gone(self) -> None:
        if self.phase == "running":
            self._end("lost", f"server-gone: the listener of {self.endpoint.name} went away during the action")
        elif self.phase == "ended":
            self._check_open()

    def on_server_changed(self) -> None:
        if self.phase == "running" and self._rate and self.endpoint.user is self:
            self._check_listeners()
        elif self.phase == "ended":
            self._check_open()

    def _check_listeners(self) -> bool:
        """End the goal if the listeners differ from those at its start. Returns whether they are the same."""
        now = self.endpoint.find_listeners()
        if self._listeners - now:
            self.on_server_gone()
        elif now != self._listeners:  # a person may stand beside a base that has just started up
            name = self.endpoint.name
            self._end("aborted", f"server-restarted: something else listens to {name} now, and must not begin midway")
        return now == self._listeners

    def _check_open(self) -> None:
        """Check, after its end, whether a listener may still carry it out."""
        is_open = self.endpoint.is_open(self)
        if self._is_stoppable and is_open != self.may_be_running:
            self.may_be_running = is_open
            self._host.on_goal_changed(self)

    def on_robot_lost(self, reason: str) -> None:
        if self.phase != "ended":
            self._end(*endings.of_lost_robot(reason, was_sent=self.phase != "waiting"))

    def _publish(self) -> None:
        try:
            self._listeners = self.endpoint.order(self, self._make_message())
        except (PortError, ValueError) as error:
            self._end("failed", f"not-sent: {error}")
            return
        self._plan_repetition()
        self.phase = "running"
        self.may_be_running = self._is_stoppable
        self._deadline = self._host.clock.now() + self._expected
        self._host.report_accepted(self.action)
        self._host.on_goal_changed(self)

    def _plan_repetition(self) -> None:
        if self._rate:
            clock = self._host.clock
            self._sent_at, self._suspended = clock.now(), suspended_seconds()
            self._repeat = clock.call_at(self._sent_at + 1 / self._rate, self._send_again)

    def _send_again(self) -> None:
        if self.phase != "running" or self.endpoint.user is not self or not self._check_listeners():
            return
        silent = self._host.clock.now() - self._sent_at + suspended_seconds() - self._suspended
        if silent > max(STANDSTILL_SECONDS, STANDSTILL_PERIODS / self._rate):
            # The robot's own watchdog may have stopped it, and a person may stand in front of it.
            self._end("aborted", f"standstill: the session was silent for {silent:.1f} s, so the robot does not go on")
            return
        try:
            self.endpoint.publisher.publish(self._make_message())
        except Exception as error:
            self._end("aborted", f"standstill: it cannot be repeated, so the robot does not go on ({error})")
        else:
            self._plan_repetition()

    def _end(self, status: Ending, reason: str) -> None:
        assert self.phase != "ended"
        self.phase = "ended"
        if self._repeat is not None:
            self._repeat.cancel()
        is_user = self.endpoint.user is self  # otherwise the topic belongs to a later goal
        if is_user and self._is_stoppable:
            self.endpoint.take_back(self)
        elif is_user:
            self.endpoint.user = None
            self._leave_unstopped()
        if self._is_stoppable:
            self.may_be_running = self.endpoint.is_open(self)
        self._host.on_goal_changed(self)
        self._host.report_ended(self.action, status, reason)


class ServiceGoal:
    """One of our calls of one service. Implements `Goal`."""

    def __init__(
        self,
        host: GoalHost,
        endpoint: ServiceEndpoint,
        goal: StartAction,
        mapping: ActionMapping,
        make_request: Callable[[], Message],
        limit: float,
    ) -> None:
        """:param limit: seconds until the kernel gives up the call."""
        self.action = goal.action
        self.type = goal.type
        self.phase: Phase = "waiting"
        self.endpoint = endpoint
        self.may_be_running = False
        self._host = host
        self._mapping = mapping
        self._make_request = make_request
        self._expected = goal.expected
        self._waiting = Waiting(host, mapping.deadlines.server)
        self._deadline = self._waiting.until
        self._limit_at = host.clock.now() + limit
        self._ended_at = 0.0
        self._called: frozenset[bytes] = frozenset()
        """The programs that offered the service at the time of the call."""
        self._is_adopted = False

    def adopt(self, *, accepted: bool) -> None:
        """Take over a call of an earlier engine. Its answer cannot arrive here."""
        self.phase = "ended"
        self.may_be_running = self._is_adopted = True
        self._host.on_goal_changed(self)

    @property
    def is_accepted(self) -> bool:
        return True

    @property
    def is_unanswerable(self) -> bool:
        return self._is_adopted

    @property
    def holds_its_part(self) -> bool:
        return True

    def release(self, by: str = "somebody") -> None:
        if self.phase == "ended" and self.may_be_running:
            self._host.report_note(
                self.endpoint, f"released: {by} has released {self.endpoint.name}; {self.why_open()}"
            )
            self._mark_over()

    def why_open(self) -> str:
        if self.endpoint.presence.was_seen and not self.endpoint.presence.count:
            return "its program has gone"
        return (
            "an engine that has gone called it" if self._is_adopted else "nothing stops a call, and it has not answered"
        )

    def cancel(self) -> None:
        if self.phase == "waiting":
            self._end("canceled", "it had not been sent yet")
        elif self.phase == "running":
            is_overdue = endings.is_overdue(self._host.clock.now(), self._limit_at)
            self._end(*endings.of_unstoppable_call(self.endpoint.name, is_overdue=is_overdue))

    def is_live(self) -> bool:
        return self.phase != "ended" or self.may_be_running

    def next_deadline(self) -> float:
        return self._deadline if self.phase != "ended" else inf

    def poll(self) -> None:
        now = self._host.clock.now() + TIMER_TOLERANCE
        if self.phase == "waiting":
            if ending := self._waiting.poll(self.endpoint, self._call, self._why_not_sent):
                self._end(*ending)
        elif self.phase == "running" and now >= self._deadline:
            grace = self._mapping.deadlines.result
            self._end(*endings.of_overdue_result(self.endpoint.name, self._expected, grace))

    def _why_not_sent(self, is_over: bool) -> endings.Outcome | None:
        if not is_over:
            return None
        if self.endpoint.presence.count > 1:
            return endings.of_two_servers(self.endpoint)
        if self.endpoint.open:
            return "failed", f"held: {self.endpoint.trouble}"
        return endings.of_missing_server(self.endpoint, 0)

    def on_server_gone(self) -> None:
        """End the goal. The program may only be out of sight, and continue with the call."""
        if self.phase == "running":
            self._end("lost", f"server-gone: the server of {self.endpoint.name} went away during the action")

    def on_server_changed(self) -> None:
        """End the goal if another program offers the service: the one that had the call is gone."""
        programs = self.endpoint.comparison.programs
        if not (self.may_be_running and self._called and programs) or self._called & programs:
            return
        self._mark_over()
        if self.phase == "running":
            self._end(*endings.of_restart(self.endpoint.name))

    def on_robot_lost(self, reason: str) -> None:
        if self.phase != "ended":
            self._end(*endings.of_lost_robot(reason, was_sent=self.phase != "waiting"))

    def _call(self) -> None:
        self._called = self.endpoint.comparison.programs
        try:
            self.endpoint.client.call(self._make_request(), self._take_response)
        except (PortError, ValueError) as error:
            self._end("failed", f"not-sent: {error}")
            return
        grace = self._mapping.deadlines.result
        self._deadline = self._host.clock.now() + self._expected + grace if grace else inf
        self.phase = "running"
        self.may_be_running = True
        self._host.report_accepted(self.action)
        self._host.on_goal_changed(self)

    def _take_response(self, response: Message) -> None:
        if self.phase == "ended":
            if self.may_be_running:
                seconds = self._host.clock.now() - self._ended_at
                answer = f"{self.endpoint.name} answered {self.action} {seconds:.1f} s after its end"
                self._host.report_note(self.endpoint, f"late: {answer}; it changes nothing")
            self._mark_over()
            return
        self.may_be_running = False
        self._end(*endings.of_response(response, self._mapping, self.endpoint.name))

    def _end(self, status: Ending, reason: str) -> None:
        assert self.phase != "ended"
        self.phase = "ended"
        self._ended_at = self._host.clock.now()
        self._host.on_goal_changed(self)
        self._host.report_ended(self.action, status, reason)

    def _mark_over(self) -> None:
        """Note that nothing of it runs on the robot any more."""
        self.may_be_running = False
        self._host.on_goal_changed(self)
