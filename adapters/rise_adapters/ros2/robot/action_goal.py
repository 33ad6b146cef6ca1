"""One action on its way to a server and back: a deadline for each phase, and exactly one ending in every case.

    waiting --a server is there--> sent --accepted--> running --result--> ended
       |                            |                   |
       +-- server-missing           +-- rejected        +-- lost, timed-out, aborted, cancel-refused, ...
           two-servers              +-- no-accept

A goal that has ended for the engine may still run on the robot, or begin there: the server did not answer, accepted it
too late, or refused its cancel. Such a goal is *open*. It is cancelled as soon as the server can be reached. Its server
gets no other goal, and later messages about it are noted. It is over when the server reports its ending, rejects it, or
has forgotten it after accepting it. A server that never answered may not know the goal yet. That ends it only if a
different program answers now.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping
from functools import partial
from math import inf
from uuid import uuid4

from rise_adapters.ros2.actions.client import (
    CANCEL_NONE,
    CANCEL_REJECTED,
    CANCEL_TERMINATED,
    CANCELED,
    CANCELING,
    FINAL_STATUSES,
    STATUS_NAMES,
    UNKNOWN,
    CancelResponse,
)
from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.robot import endings
from rise_adapters.ros2.robot.endings import MAX_TRIES, Cancellation, ResultQuery
from rise_adapters.ros2.robot.endpoints import ActionEndpoint
from rise_adapters.ros2.robot.goal_host import TIMER_TOLERANCE, Ending, GoalHost, Phase
from rise_adapters.ros2.robot.waiting import Waiting
from rise_adapters.ros2.transport.port import Message, PortError
from rise_engine.kernel.commands import StartAction

_LOG = logging.getLogger(__name__)

MAX_SENDS = 3
"""Maximum sends, if a goal's server disappears before it answers. A server that knows the goal's id rejects a
repetition."""


class ActionGoal:
    """One of our goals at one action server. Implements `Goal`."""

    def __init__(
        self,
        host: GoalHost,
        endpoint: ActionEndpoint,
        goal: StartAction,
        mapping: ActionMapping,
        message: Message,
        limit: float,
    ) -> None:
        """:param limit: seconds until the kernel gives up the goal."""
        self.id = bytes.fromhex(goal.goal) if goal.goal else uuid4().bytes
        self.action = goal.action
        self.type = goal.type
        self.phase: Phase = "waiting"
        self.endpoint = endpoint
        self.may_be_running = False
        self._host = host
        self._mapping = mapping
        self._message = message
        self._expected = goal.expected
        now = self._now()
        self._limit_at = now + limit
        self._waiting = Waiting(host, mapping.deadlines.server)
        self._deadline = self._waiting.until
        """The deadline of the present phase."""
        self._sends = 0
        self._answers = 0
        """How many times the server accepted or rejected the goal."""
        self._accepted: bool | None = None
        """Whether the server accepted it; None: no answer yet."""
        self._sent_to: frozenset[bytes] = frozenset()
        """The programs that offered the action at the time of sending."""
        self._disowned_by = -1
        """The value of `ServerPresence.changes` when the only server did not know the goal."""
        self._is_adopted = False
        """Whether an earlier engine or an unknown client sent it."""
        self.is_unknown = self.is_released = False
        self._may_cancel = True
        """Whether this engine may cancel it. An adopted goal is cancelled only on request."""
        self._began_late = False
        self._heard_at = 0.0
        """The time of its last sign of life."""
        self._result = ResultQuery()
        self.cancellation = Cancellation(mapping.deadlines.cancel)
        self._ending: Ending | None = None
        self._ended_at = 0.0
        self._noted: set[tuple[str, str]] = set()
        """Notes that were already reported: a repeated message is reported once."""

    # --- from the engine ----------------------------------------------------------------------------------------

    def adopt(self, *, accepted: bool, unknown: bool = False) -> None:
        """Take over an open goal of an earlier engine.

        :param unknown: whether it ran before the session, sent by an unknown client.
        """
        self.is_unknown = unknown
        self.phase, self._ending = "ended", "lost"
        self._ended_at, self._deadline = self._now(), inf
        self.may_be_running = self._is_adopted = True
        self._may_cancel = False
        self._accepted = True if accepted else None
        self._host.on_goal_changed(self)
        if self.endpoint.presence.count:  # otherwise `on_server_changed` follows
            self._ask_result()

    def cancel(self) -> None:
        """Stop the goal. One that was not sent ends immediately; otherwise its server is asked, as soon as it has
        accepted it."""
        cancellation = self.cancellation
        if self.phase == "ended" and self.may_be_running:
            self._may_cancel = True
            cancellation.tries = 0
            self._ask_cancel()
        if self.phase == "ended" or cancellation.wanted:
            return
        cancellation.request(self._now(), self._limit_at)
        if self.phase == "waiting":
            self._end(
                "canceled",
                "its server had gone before it accepted the goal" if self._sends else "it had not been sent yet",
            )
        elif self.phase == "running":
            self._ask_cancel()
        self._host.on_goal_changed(self)

    @property
    def is_accepted(self) -> bool:
        return bool(self._accepted)

    @property
    def is_unanswerable(self) -> bool:
        return self._accepted is None and self._disowned_by == self.endpoint.presence.changes

    @property
    def holds_its_part(self) -> bool:
        return True

    def release(self, by: str = "somebody") -> None:
        if self.phase == "ended" and self.may_be_running:
            self._note_once("released", f"{by} has released {self.endpoint.name}; {self.why_open()}")
            self.is_released = True
            self._mark_over()

    def why_open(self) -> str:
        if self.endpoint.presence.was_seen and not self.endpoint.presence.count:
            return "its program has gone"
        if self._is_adopted and not self.cancellation.confirmed and self.cancellation.refused_at is None:
            if self.is_unknown:
                return "it was running when the robot was found"
            return f"an engine that has gone {'began' if self._accepted else 'may have begun'} it"
        if self._accepted is None:
            return "it has not answered and may still begin"
        if self.cancellation.refused_at is not None:
            return "it refused to stop"
        return "it began late and should stop" if self._began_late else "it has not ended yet"

    def is_live(self) -> bool:
        return self.phase != "ended" or self.cancellation.next_try < inf

    # --- from the clock -----------------------------------------------------------------------------------------

    def next_deadline(self) -> float:
        cancellation = self.cancellation
        if self.phase == "ended":
            return cancellation.next_try
        deadline = min(self._deadline, cancellation.deadline)
        if self.phase == "running":
            deadline = min(deadline, cancellation.next_try, self._silent_at(), self._result.next_deadline())
        return deadline

    def poll(self) -> None:
        now = self._now() + TIMER_TOLERANCE
        if self.phase == "waiting":
            if ending := self._waiting.poll(self.endpoint, self._send, self._why_not_sent):
                self._end(*ending)
        elif self.phase == "sent":
            self._poll_sent(now)
        elif self.phase == "running":
            self._poll_running(now)
        elif now >= self.cancellation.next_try:
            self._ask_cancel()

    def _why_not_sent(self, is_over: bool) -> endings.Outcome | None:
        presence = self.endpoint.presence
        if presence.count > 1 and (presence.appeared_twice or is_over):
            return endings.of_two_servers(self.endpoint)
        if not is_over:
            return None
        if self.endpoint.open:
            return "failed", f"held: {self.endpoint.trouble}"
        return endings.of_missing_server(self.endpoint, self._sends)

    def _poll_sent(self, now: float) -> None:
        if now < min(self._deadline, self.cancellation.deadline):
            return
        self.endpoint.mark_unanswered()
        seconds = self._mapping.deadlines.acceptance if now >= self._deadline else None
        self._end(*endings.of_missing_answer(self.endpoint.name, seconds))

    def _poll_running(self, now: float) -> None:
        endpoint, deadlines, result = self.endpoint, self._mapping.deadlines, self._result
        if now >= result.discarded_at:
            self._end_discarded()
        elif now >= self.cancellation.deadline:
            if not self.cancellation.confirmed and self.cancellation.refused_at is None:
                endpoint.mark_unanswered()
            self._end(*endings.of_failed_cancel(self.cancellation, endpoint.name))
        elif now >= self._deadline:
            self._end(*endings.of_overdue_result(endpoint.name, self._expected, deadlines.result))
        elif now >= self._silent_at():
            endpoint.mark_unanswered()
            self._end(*endings.of_silence(endpoint.name, deadlines.feedback))
        elif now >= result.missing_at:
            self._end_without_result()
        else:
            if now >= self.cancellation.next_try:
                self._ask_cancel()
            if result.is_due(now):
                self._ask_result()

    def _silent_at(self) -> float:
        """When silence counts as a failure."""
        expected = self._mapping.deadlines.feedback
        return self._heard_at + expected if expected and not self.cancellation.wanted else inf

    # --- from the robot as a whole ------------------------------------------------------------------------------

    def on_server_gone(self) -> None:
        """Note that no server offers the action any more. What still runs there is unknown."""
        name = self.endpoint.name
        if self.phase == "sent":
            self._deadline = self._waiting.until
            may_send = self._sends < MAX_SENDS and not self.cancellation.wanted
            if may_send and self._now() < self._waiting.until:
                self.phase = "waiting"
                self._host.on_goal_changed(self)
            else:
                self._end(*endings.of_missing_server(self.endpoint, self._sends))
        elif self.phase == "running":
            self._end("lost", f"server-gone: the server of {name} went away during the action")

    def on_server_changed(self) -> None:
        """After a change in the number of servers, check which server has the goal, and whether one was restarted."""
        if self.phase == "running" or (self.phase == "ended" and self.may_be_running and not self._may_cancel):
            self._ask_result()
        elif self.phase == "ended" and self.may_be_running:
            self.cancellation.next_try = self._now()
            self._host.on_goal_changed(self)

    def on_robot_lost(self, reason: str) -> None:
        if self.phase != "ended":
            self._end(*endings.of_lost_robot(reason, was_sent=self.phase != "waiting" or self._sends > 0))

    # --- from the wire ------------------------------------------------------------------------------------------

    def take_feedback(self) -> None:
        """Note a sign of life. Feedback has no other effect."""
        self._heard_at = self._now()

    def take_status(self, statuses: Mapping[bytes, int]) -> None:
        """Process the server's status of its goals."""
        status = statuses.get(self.id)
        now = self._now()
        if status is None:
            if self.phase == "running" and self._result.may_repeat_request(now):
                self._ask_result()
            return
        self._heard_at = now
        if status == CANCELING:
            self.cancellation.confirm()
        if status and self._is_unanswered():
            self._accept()
        if status in FINAL_STATUSES:
            self._take_terminal_status(status, now)
        elif status and self.phase == "ended" and self._accepted is None:
            self._accept_late()

    def _take_terminal_status(self, status: int, now: float) -> None:
        result = self._result
        if self.phase == "running" and result.finished_as == UNKNOWN:
            result.finish(now, status)
            if result.discarded_at < inf:
                self._end_discarded()
            elif result.may_repeat_request(now):
                self._ask_result()
            self._host.on_goal_changed(self)
        elif self.phase == "ended":
            self._mark_over()

    # --- sending ------------------------------------------------------------------------------------------------

    def _send(self) -> None:
        self._sends += 1
        self._sent_to |= self.endpoint.comparison.programs
        self.phase = "sent"
        self.may_be_running = True
        self._deadline = self._now() + self._mapping.deadlines.acceptance
        try:
            self.endpoint.client.send(self.id, self._message, partial(self._take_answer, self._sends))
        except PortError as error:
            self.may_be_running = self._sends > 1
            self._end("failed", f"not-sent: {error}")

    def _take_answer(self, number: int, accepted: bool) -> None:
        """Process whether the server accepted the goal, sent for the `number`-th time."""
        name = self.endpoint.name
        self._answers += 1
        if self._answers > self._sends:
            self._note_once("duplicate", f"{name} answered twice whether it accepts {self.action}")
        elif self._is_unanswered():
            if accepted:
                self._accept()
            elif number > 1:
                # A server that only seemed to disappear has the goal already, and rejects the repetition.
                self._end("failed", f"rejected: {name} refused it when it was sent again")
            else:
                self._accepted = False
                self._end("failed", f"rejected: {name} refused it", is_over=True)
        elif self._accepted is None and self.phase == "ended":
            if accepted:
                self._accept_late()
            else:
                self._accepted = False
                self._note_once("late", f"{name} refused {self.action} {self._since_end()} after its end")
                self._mark_over()

    def _is_unanswered(self) -> bool:
        """Whether it was sent, and the server (which may be gone) has neither accepted nor rejected it."""
        return self.phase == "sent" or (self.phase == "waiting" and self._sends > 0)

    def _accept(self) -> None:
        now = self._now()
        self._accepted = True
        self.phase = "running"
        self._heard_at = now
        grace = self._mapping.deadlines.result
        self._deadline = now + self._expected + grace if grace else inf
        self._ask_result()
        if self.cancellation.wanted:
            self._ask_cancel()
        self._host.report_accepted(self.action)

    def _accept_late(self) -> None:
        self._accepted = self.may_be_running = True
        self.is_released = False
        if not self._may_cancel:
            self._ask_result()
            return
        self._began_late = True
        self._note_once(
            "late",
            f"{self.endpoint.name} took {self.action} {self._since_end()} after its end ({self._ending}); "
            "it is cancelled at once",
        )
        self.cancellation.tries = 0
        self._ask_result()
        self._ask_cancel()

    # --- results ------------------------------------------------------------------------------------------------

    def _ask_result(self) -> None:
        self._result.request(self._now())
        try:
            self.endpoint.client.get_result(self.id, partial(self._take_result, self.endpoint.presence.changes))
        except PortError as error:
            _LOG.debug("the result of %s could not be asked for: %s", self.action, error)
        self._host.on_goal_changed(self)

    def _take_result(self, servers: int, status: int, message: Message) -> None:
        """Process a result. `servers`: `ServerPresence.changes` at the request."""
        if self._result.receive():
            self._note_once("duplicate", f"the result of {self.action} came twice; the second one is ignored", "result")
        if self.phase == "ended":
            self._take_late_result(servers, status)
        elif status not in FINAL_STATUSES:  # UNKNOWN, or a status that no result can have: never a success
            self._take_unknown_goal(servers)
        else:
            self._result.taken = True
            wanted, name = self.cancellation.wanted, self.endpoint.name
            self._end(*endings.of_result(status, message, self._mapping, name, cancel_wanted=wanted), is_over=True)

    def _take_late_result(self, servers: int, status: int) -> None:
        ended = status in FINAL_STATUSES
        is_expected = self.is_unknown or (self.cancellation.tries and status == CANCELED)
        if not self._result.taken and ended and not is_expected:
            self._note_once(
                "late",
                f"the result of {self.action} ({STATUS_NAMES[status]}) came {self._since_end()} after its end "
                f"({self._ending}); it changes nothing",
                "result",
            )
        self._result.taken = self._result.taken or ended
        if ended or self._note_unknown(servers):
            self._mark_over()

    def _note_unknown(self, servers: int) -> bool:
        """Note that the server does not know the goal. Returns whether that ends it. `servers`: as at the request."""
        presence = self.endpoint.presence
        if presence.count != 1 or presence.changes != servers or not self._are_all_found():
            return False  # another server may have it
        self._disowned_by = servers
        programs = self.endpoint.comparison.programs
        was_replaced = bool(self._sent_to and programs and not self._sent_to & programs)
        return self._accepted is not None or was_replaced

    def _are_all_found(self) -> bool:
        """Whether the last poll found all present servers."""
        return self.endpoint.client.count_servers() == self.endpoint.presence.count

    def _take_unknown_goal(self, servers: int) -> None:
        """Handle a server that does not know the goal. If it only keeps no results, its status topic soon reports the
        end."""
        presence = self.endpoint.presence
        if presence.changes != servers or not self._are_all_found():
            return  # the present servers were asked since, or are after the next poll
        if self._result.finished_as != UNKNOWN:
            self._end_discarded()
        elif presence.count > 1:
            self._result.taken = True
            self._end(*endings.of_restart(self.endpoint.name))  # another server may have it, and is asked to cancel it
        elif self._result.discarded_at == inf:
            self._result.note_unknown_goal(self._now())
            self._host.on_goal_changed(self)

    def _end_discarded(self) -> None:
        """End the goal: it has ended on the server, and its result is lost."""
        self._result.taken = True
        status, wanted = self._result.finished_as, self.cancellation.wanted
        self._end(*endings.of_discarded_result(status, self.endpoint.name, cancel_wanted=wanted), is_over=True)

    def _end_without_result(self) -> None:
        """End the goal: the status topic reported its ending, but no result arrives."""
        status = self.endpoint.client.statuses.get(self.id)
        ending = endings.of_missing_result(status, self.endpoint.name, cancel_wanted=self.cancellation.wanted)
        self._end(*ending, is_over=ending[0] != "timed-out")

    # --- cancelling ---------------------------------------------------------------------------------------------

    def _ask_cancel(self) -> None:
        presence, cancellation = self.endpoint.presence, self.cancellation
        cancellation.start_over_for(presence.changes)
        if not presence.count:
            cancellation.pause()  # `on_server_changed` follows when it returns
        else:
            if self.phase == "ended" and cancellation.tries >= MAX_TRIES:
                self._note_once(
                    "still-running",
                    f"{self.action} could not be stopped at {self.endpoint.name} in {MAX_TRIES} tries; "
                    "the robot may go on with it",
                )
            cancellation.begin_try(self._now())
            try:
                self.endpoint.client.cancel(self.id, partial(self._take_cancel_answer, presence.changes))
            except PortError as error:
                _LOG.debug("%s could not be cancelled: %s", self.action, error)
        self._host.on_goal_changed(self)

    def _take_cancel_answer(self, servers: int, answer: CancelResponse) -> None:
        """Process the answer to a cancel. `servers`: `ServerPresence.changes` at the request."""
        if self.id in answer.goals:
            self.cancellation.confirm()
            self.cancellation.pause()
            if not self._result.requests:
                self._ask_result()
        elif answer.code in (CANCEL_NONE, CANCEL_REJECTED):
            if self.may_be_running and not self.cancellation.confirmed and self.cancellation.refuse(self._now()):
                self._note_once("cancel-refused", f"{self.endpoint.name} does not stop {self.action}; it goes on")
        elif self.phase == "ended":  # the server does not have it, or the goal is over
            if answer.code == CANCEL_TERMINATED:
                # rcl also gives this answer while it cancels the goal. Only its status or result shows which.
                self.cancellation.pause()
                if self.endpoint.client.statuses.get(self.id) in FINAL_STATUSES:
                    self._mark_over()
                else:
                    self._ask_result()
            elif self._note_unknown(servers):
                self._mark_over()
            elif self.endpoint.presence.changes == servers and self._are_all_found():
                self.cancellation.pause()  # until it answers, or `on_server_changed`
        elif self.phase == "running":
            self.cancellation.pause()
            self._ask_result()  # it ended or was forgotten: the result shows both
        self._host.on_goal_changed(self)

    # --- the end ------------------------------------------------------------------------------------------------

    def _end(self, status: Ending, reason: str, *, is_over: bool = False) -> None:
        """End the goal. Nothing else ends it. `is_over`: nothing of it can still run on the robot."""
        assert self.phase != "ended"
        self.may_be_running = self.may_be_running and not is_over
        self.phase = "ended"
        self._ending = status
        self._ended_at = self._now()
        self._deadline = self.cancellation.deadline = inf
        self.cancellation.pause()
        if self.may_be_running and not self.cancellation.confirmed:
            self.cancellation.tries = 0
            self._ask_cancel()
        if self.cancellation.overdue and status != "canceled":
            self._note_once(
                "late", f"{self.action} {status}{f' ({reason})' if reason else ''}, after its time was over"
            )
        self._host.on_goal_changed(self)
        self._host.report_ended(self.action, status, reason)

    def _mark_over(self) -> None:
        """Note that nothing of it runs on the robot any more."""
        self.may_be_running = False
        self.cancellation.pause()
        self._host.on_goal_changed(self)

    def _since_end(self) -> str:
        return f"{self._now() - self._ended_at:.1f} s"

    def _note_once(self, kind: str, text: str, about: str = "") -> None:
        """Add a note to the record, each kind once."""
        if (kind, about) not in self._noted:
            self._noted.add((kind, about))
            self._host.report_note(self.endpoint, f"{kind}: {text}")

    def _now(self) -> float:
        return self._host.clock.now()
