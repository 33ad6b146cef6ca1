"""Stop-all: every action server of the robot is asked to cancel everything, including other clients' goals.

A server has confirmed when it has answered and every known goal there has ended. Our goals end with their results,
those of others with the server's status topic. If the answer does not name a goal, the server is asked about its id,
because its last status may be from before a restart. A goal of ours that the server has not answered may still begin,
so it has not ended. The report names the servers that cannot confirm, with the reason. A missing server never counts as
confirmed, because it could not be asked.

The first report comes when all have confirmed, or after ANSWER_SECONDS. Later changes are reported until something is
started: a goal that begins or ends late, or a server that returns and is then asked. If another client begins a goal
after the report, the confirmation is withdrawn until the next stop. That goal is not ours to cancel, but the wizard
must know of it.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import TypeAlias

from rise_adapters.ros2.actions.client import (
    ALL_GOALS,
    CANCEL_NONE,
    CANCEL_REJECTED,
    CANCEL_UNKNOWN,
    CANCELING,
    FINAL_STATUSES,
    CancelResponse,
)
from rise_adapters.ros2.robot.action_goal import ActionGoal
from rise_adapters.ros2.robot.endpoints import NOT_HEARD, ActionEndpoint, Endpoint, ServiceEndpoint, TopicEndpoint
from rise_adapters.ros2.robot.goal_host import TIMER_TOLERANCE
from rise_engine.kernel.inputs import StopReport
from rise_engine.ports.robot import Clock, Timer

_LOG = logging.getLogger(__name__)

ANSWER_SECONDS = 2.5
"""Seconds until the report. The kernel waits STOP_LIMIT, 3 s."""
REPEAT_SECONDS = 0.8
"""Seconds until a server that has not answered is asked again, before the first report."""
SLOW_REPEAT_SECONDS = 2.0
"""The same after the first report. A request during a standstill of the server may be lost."""

MAX_BY_ID = 20
"""The maximum number of other clients' goals that one server is asked about by id in one stop."""

FindGoals: TypeAlias = Callable[[ActionEndpoint], Mapping[bytes, ActionGoal]]
"""Our remembered goals at a server, by id."""


class CancelAll:
    """One action server that was asked to cancel everything."""

    def __init__(self, endpoint: ActionEndpoint, find_goals: FindGoals) -> None:
        self.endpoint = endpoint
        self.answer: CancelResponse | None = None
        """The answer of the present servers."""
        self.is_asked = False
        """Whether the present servers were asked."""
        self._servers = endpoint.presence.changes
        self._own_goals = partial(find_goals, endpoint)
        self._known: set[bytes] = set()
        """Goals that it is cancelling, or has reported as unfinished."""
        self._stopping: set[bytes] = set()
        """Goals that it confirmed to cancel."""
        self._listed: set[bytes] = set()
        """Goals that its status topic has named. One that it no longer names is over."""
        self._asked_by_id: set[bytes] = set()
        """Other clients' goals that it was asked about by id."""
        self._over: set[bytes] = set()
        """Those of them that it reported as unknown or over."""
        self._has_confirmed = False
        self.is_over = False
        """Whether the stop is over: other clients may begin goals again, and late answers have no effect."""
        self.is_reported = False
        """Whether the stop was reported. After that, goals that other clients begin are only reported."""
        self._moved_since = False
        """Whether another client has begun a goal there since the report."""

    def ask(self, changed: Callable[[], None]) -> None:
        """Ask it to cancel everything. `changed` is called with each answer."""
        self.is_asked = True
        try:
            self.endpoint.client.cancel(ALL_GOALS, partial(self._take_answer, self._servers, changed))
        except Exception as error:  # the other servers must be asked after any error
            _LOG.warning("%s could not be asked to stop: %s", self.endpoint.name, error)

    def _take_answer(self, servers: int, changed: Callable[[], None], answer: CancelResponse) -> None:
        if servers == self._servers and (self.answer is None or self._has_rejected or answer.goals):
            self.answer = answer
        self._known.update(answer.goals)
        self._stopping.update(answer.goals)
        own = self._own_goals()
        for goal in answer.goals:
            if goal in own:
                own[goal].cancellation.confirm()
        if not self.is_over:
            self._ask_about_others(changed)
        changed()

    @property
    def _has_rejected(self) -> bool:
        """Whether it answered that goals run and it cancels none. Such an answer confirms nothing."""
        return self.answer is not None and self.answer.code == CANCEL_REJECTED and not self.answer.goals

    @property
    def needs_asking(self) -> bool:
        """Whether to ask it, again or for the first time. Its status may not show a goal that it does not stop."""
        return self.answer is None or (self._has_rejected and not self.find_running())

    def find_running(self) -> set[bytes]:
        """Goals that may be running there."""
        statuses = self.endpoint.client.statuses
        self._known |= self.endpoint.client.unfinished_goals()
        self._listed |= self._known & statuses.keys()
        own = self._own_goals()
        over = {
            goal
            for goal in self._known
            if statuses.get(goal) in FINAL_STATUSES or (goal in self._listed and goal not in statuses)
        }
        others = self._known - over - self._over - own.keys()
        return {id for id, goal in own.items() if goal.may_be_running} | others

    def is_confirmed(self) -> bool:
        """Whether the one server, present or gone since it confirmed, has answered, and no goal runs there."""
        running = self.find_running()  # first, because it also notes listed goals
        presence = self.endpoint.presence
        if presence.changes != self._servers:
            self._servers = presence.changes
            self.answer, self.is_asked = None, False
            self._over.clear()  # another server said so
            self._asked_by_id.clear()
            self._has_confirmed = self._has_confirmed and not presence.count
        if running and self._has_confirmed:
            self._has_confirmed = False
            if not self.is_reported:
                self.answer = None  # ask it again
            elif presence.count:
                self._moved_since = True
        elif not (running or self._moved_since or self.answer is None) and presence.count:
            is_free = presence.count == 1 and not self.endpoint.open
            self._has_confirmed = is_free and self.endpoint.shows_goals and not self._has_rejected
        return self._has_confirmed

    def why_unconfirmed(self) -> str:
        """Why it has not confirmed, for a person."""
        endpoint, own = self.endpoint, self._own_goals()
        presence = endpoint.presence
        if not presence.count:
            return endpoint.mismatch_kind or ("gone" if presence.was_seen else "never seen")
        if self._moved_since:
            return "something was begun there after the stop"
        if presence.count > 1:
            return f"{presence.count} servers, and only one can have answered"
        if not (endpoint.shows_goals or self.find_running()):
            return "it has only just appeared"
        if self.answer is None:
            return "asked, no answer"
        ours = [goal for goal in own.values() if goal.may_be_running and goal.phase == "ended"]
        if ours:
            return ours[0].why_open()
        running = self.find_running()
        if self.answer.code in (CANCEL_NONE, CANCEL_REJECTED) and not (running and self._is_stopping(running)):
            return "it refused to stop"
        return "still running"

    def _is_stopping(self, goals: set[bytes]) -> bool:
        """Whether it has confirmed to stop all these goals."""
        statuses, own = self.endpoint.client.statuses, self._own_goals()
        return all(
            goal in self._stopping
            or statuses.get(goal) == CANCELING
            or (goal in own and own[goal].cancellation.confirmed)
            for goal in goals
        )

    def _ask_about_others(self, changed: Callable[[], None]) -> None:
        """Ask about other clients' goals that seem to run and that its answer does not name. Our goals ask for
        themselves."""
        unclear = self.find_running() - self._stopping - self._asked_by_id - self._own_goals().keys()
        for goal in sorted(unclear)[: max(MAX_BY_ID - len(self._asked_by_id), 0)]:
            self._asked_by_id.add(goal)
            servers = self.endpoint.presence.changes
            try:
                self.endpoint.client.cancel(goal, partial(self._take_answer_about, goal, servers, changed))
            except Exception as error:
                _LOG.warning("%s could not be asked about a goal: %s", self.endpoint.name, error)

    def _take_answer_about(
        self, goal: bytes, servers: int, changed: Callable[[], None], answer: CancelResponse
    ) -> None:
        self._stopping.update(answer.goals)
        if answer.code == CANCEL_UNKNOWN and self.endpoint.presence.changes == servers:
            self._over.add(goal)
        changed()


class StopAll:
    """One stop, from the request until something is started or everything is stopped again."""

    def __init__(
        self,
        clock: Clock,
        endpoints: Iterable[Endpoint],
        find_goals: FindGoals,
        report: Callable[[StopReport], None],
    ) -> None:
        """`report` is first called within ANSWER_SECONDS, and again with each change."""
        self._clock = clock
        self._report = report
        self._until = clock.now() + ANSWER_SECONDS
        self._timer: Timer | None = None
        self._cancels: list[CancelAll] = []
        self._topics: list[TopicEndpoint] = []
        """Parts that cannot confirm."""
        self._unstoppable: list[str] = []
        self._services: list[ServiceEndpoint] = []
        self._reported: StopReport | None = None
        self._is_abandoned = False
        for endpoint in endpoints:
            if isinstance(endpoint, ActionEndpoint):
                self._cancels.append(CancelAll(endpoint, find_goals))
            elif isinstance(endpoint, ServiceEndpoint):
                self._services.append(endpoint)
            elif not endpoint.is_stoppable:
                if not endpoint.is_harmless:
                    self._unstoppable.append(endpoint.label)
            else:
                self._topics.append(endpoint)

    @property
    def is_answered(self) -> bool:
        """Whether it was reported."""
        return self._reported is not None

    def begin(self) -> None:
        self._keep_asking()

    def poll(self) -> None:
        """Check after a change whether all have confirmed."""
        if self._is_abandoned:
            return
        confirmed = [cancel.is_confirmed() for cancel in self._cancels]  # all of them: see `find_running`
        if self._reported is not None:
            self._ask(cancel for cancel in self._cancels if not cancel.is_asked)  # newly found
            if self._make_report() != self._reported:
                if self._timer is None:
                    self._timer = self._clock.call_at(self._clock.now() + REPEAT_SECONDS, self._keep_asking)
                self._finish()
        elif all(confirmed):
            self._finish()

    def abandon(self) -> None:
        """Stop reporting and asking."""
        self._is_abandoned = True
        for cancel in self._cancels:
            cancel.is_over = True
        if self._timer is not None:
            self._timer.cancel()

    def _keep_asking(self) -> None:
        """Ask the servers that have not answered, now and later, until all have confirmed."""
        self._timer = None
        now = self._clock.now()
        if self._reported is None and now + TIMER_TOLERANCE >= self._until:
            self._finish()
        if self._is_abandoned or (self._reported is not None and not self._reported.unconfirmed):
            return
        self._ask(cancel for cancel in self._cancels if cancel.needs_asking)
        again = min(now + REPEAT_SECONDS, self._until) if self._reported is None else now + SLOW_REPEAT_SECONDS
        self._timer = self._clock.call_at(again, self._keep_asking)
        self.poll()

    def _ask(self, cancels: Iterable[CancelAll]) -> None:
        for cancel in tuple(cancels):
            if cancel.endpoint.presence.count:
                cancel.ask(self.poll)

    def _finish(self) -> None:
        """Report the present state."""
        if self._reported is None:
            for cancel in self._cancels:
                if cancel.answer is None and cancel.endpoint.presence.count == 1:
                    cancel.endpoint.mark_unanswered()
        self._reported = report = self._make_report()
        for cancel in self._cancels:
            cancel.is_reported = True
        self._report(report)

    def _make_report(self) -> StopReport:
        confirmed, unconfirmed = [], []
        topics = [f"{each.label} ({_why_topic_unconfirmed(each)})" for each in self._topics]
        for cancel in self._cancels:
            if cancel.is_confirmed():
                confirmed.append(cancel.endpoint.label)
            else:
                unconfirmed.append(f"{cancel.endpoint.label} ({cancel.why_unconfirmed()})")
        calls = [f"{each.label} (nothing stops a call of a service)" for each in self._services if each.open]
        return StopReport(
            confirmed=tuple(sorted(confirmed)),
            unconfirmed=(*sorted(unconfirmed), *sorted(topics)),  # last: those that can never confirm
            unstoppable=tuple(sorted([*self._unstoppable, *calls])),
        )


def _why_topic_unconfirmed(topic: TopicEndpoint) -> str:
    """Why a topic has not confirmed, for a person. (`TopicEndpoint.repeat_reset` sends the reset to its listeners.)"""
    if topic.presence.count:
        return "told to stop; a topic gives no answer" if topic.all_received_reset else NOT_HEARD
    return topic.mismatch_kind or ("gone" if topic.presence.was_seen else "never seen")
