"""A robot on ROS 2, behind the engine's port: `Ros2Robot` keeps its goals and watches its presence.

Every action of the profile goes to an action server or a service, or is published on a topic. One timer polls the
servers (ROS does not report a dead one) and the goals that are due.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import cycle
from math import inf

from msgspec.structs import replace

from rise_adapters.ros2.actions.client import ALL_GOALS
from rise_adapters.ros2.compatibility import describe_uncompared
from rise_adapters.ros2.graph_checks import describe_other_client, other_clients
from rise_adapters.ros2.mapping import ActionMapping, read_options
from rise_adapters.ros2.robot import health
from rise_adapters.ros2.robot.action_goal import ActionGoal
from rise_adapters.ros2.robot.earlier_goals import EarlierGoals
from rise_adapters.ros2.robot.endpoints import (
    ActionEndpoint,
    Endpoint,
    ServiceEndpoint,
    TopicEndpoint,
    close_all,
    short_labels,
)
from rise_adapters.ros2.robot.estop_input import EstopInput
from rise_adapters.ros2.robot.goal_host import TIMER_TOLERANCE, Ending, Goal
from rise_adapters.ros2.robot.health import RobotHealth
from rise_adapters.ros2.robot.simple_goals import ServiceGoal, TopicGoal
from rise_adapters.ros2.robot.stop_all import StopAll
from rise_adapters.ros2.transport.port import Message, PortError, Transport
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, Note, RobotChanged
from rise_engine.ports.robot import Clock, ReportCallback, RobotReport, Timer
from rise_engine.scenario.durations import limit_seconds
from rise_engine.scenario.model import RobotProfile

_LOG = logging.getLogger(__name__)

POLL_RUNNING = 0.25
"""Seconds between two polls of the servers while something runs."""
POLL_WAITING = 0.05
"""The same while a goal waits for its server."""
POLL_IDLE = 0.5
"""The same while nothing runs, and all servers are present."""
POLL_SOONEST = 0.001
UNKNOWN_GOAL = "unknown/"
"""The prefix of the name of another client's goal. The goal's id follows in hexadecimal digits."""
MAX_REMEMBERED = 200
"""The number of goals kept to recognise late messages about them."""
MAX_ERRORS = 20
"""The maximum number of different errors that are logged before a poll succeeds."""
CLOSE_DELAY_SECONDS = 0.5
"""Seconds that a client stays open after `close`, so that its last cancel is sent."""


class Ros2Robot:
    """Implements `rise_engine.ports.robot.Robot` over a transport that its caller opens and closes."""

    def __init__(
        self, profile: RobotProfile, clock: Clock, transport: Transport, mappings: Mapping[str, ActionMapping]
    ) -> None:
        """`mappings` by the action's name in the profile. Raises PortError if a type is not available."""
        self.clock = clock
        self._profile = profile
        self._mappings = mappings
        self._frame = str(profile.options.get("frame", "base_link"))
        self._goals: dict[str, Goal] = {}
        """By the engine's name, oldest first."""
        self._by_id: dict[bytes, ActionGoal] = {}
        self._live: dict[str, Goal] = {}
        """The goals that need polling."""
        self._report: ReportCallback = _ignore
        self._timer: Timer | None = None
        self._next_poll = inf
        """The time of the next timer event."""
        self._went_well = True
        """Whether the last poll had no error. After an error, goals may be due that were not polled."""
        self._errors: set[str] = set()
        """Errors logged since the last poll without one."""
        self._stop: StopAll | None = None
        self._reported: RobotHealth | None = None
        """The robot's state in the last report."""
        self._grace_until = inf
        self._seen_at: float | None = None
        self._uncompared: set[str] = set()
        """Endpoints that do not announce their types, and were noted already."""
        self._other_clients: set[str] = set()
        """Other nodes that may move the robot, and were noted already."""
        self._is_connected = self._closed = False
        self._estop: EstopInput | None = None
        self._held_by: Sequence[str] = ()
        self._estop_watch = health.EstopWatch(clock)
        self._earlier_goals = EarlierGoals(clock, gives_up=read_options(profile).unattended == "go on")
        self._transport = transport
        self._make_endpoints()

    def _make_endpoints(self) -> None:
        transport = self._transport
        names = {action: transport.resolve(mapping.name) for action, mapping in self._mappings.items()}
        labels = short_labels(self._profile.name, list(dict.fromkeys(names.values())))
        endpoint_of: dict[str, Endpoint] = {}
        made: dict[tuple[str, str], Endpoint] = {}
        # Actions may share a server. If one of them needs feedback, the server is opened for that one.
        by_feedback = sorted(self._mappings.items(), key=lambda item: item[1].feedback_wanted is None)
        for action, mapping in by_feedback:
            key = names[action], mapping.type
            if key not in made:
                made[key] = self._make_endpoint(mapping, labels[names[action]])
            endpoint_of[action] = shared = made[key]
            if isinstance(shared, TopicEndpoint):
                other = next(each for each in endpoint_of if endpoint_of[each] is shared)
                resets = [self._profile.actions[each].carrier.get("reset") for each in (other, action)]
                if resets[0] != resets[1]:  # two spellings of one name in the profile
                    raise PortError(f"the resets of {other} and {action}, which both go to {shared.name}, differ")
                shared.is_harmless = shared.is_harmless and mapping.harmless
        self._endpoint_of = endpoint_of
        """By the action's name in the profile. Actions may share an endpoint."""
        self._endpoints = tuple(made.values())
        self._turn = cycle(self._endpoints)

    def _make_endpoint(self, mapping: ActionMapping, label: str) -> Endpoint:
        if mapping.kind == "topic":
            make_reset = partial(self._make_reset, mapping)
            return TopicEndpoint(label, self._transport, mapping, self.clock, make_reset)
        if mapping.kind == "service":
            return ServiceEndpoint(label, self._transport, mapping, self.clock)
        endpoint = ActionEndpoint(label, self._transport, mapping, self.clock)
        endpoint.client.on_feedback = self._take_feedback
        endpoint.client.on_status = partial(self._take_status, endpoint)
        return endpoint

    # --- the port -----------------------------------------------------------------------------------------------

    def connect(self, report: ReportCallback) -> None:
        """Begin. Discovery takes time: reports start when every server is present, or the longest deadline is over."""
        self._report, self._is_connected = report, True
        deadlines = [mapping.deadlines.server for mapping in self._mappings.values()]
        self._grace_until = self.clock.now() + max(deadlines, default=0.0)
        if goals := health.open_goals(self._endpoints):  # first: nothing is known yet about the robot
            why = "goals were open when an engine ended; the robot is asked about them"
            self._report(RobotChanged(status="degraded", detail=why, open=goals))
        for endpoint in self._endpoints:
            if isinstance(endpoint, ActionEndpoint) and endpoint.client.statuses:
                self._check_unknown_goals(endpoint)
        self._open_estop()
        self._poll()

    def adopt(self, goals: Sequence[StartAction]) -> None:
        """As `rise_engine.ports.robot.RobotWithOpenGoals.adopt`; before `connect`."""
        for goal in goals:
            mapping = self._mappings.get(goal.type)
            if mapping is None:
                continue
            if goal.action.startswith(UNKNOWN_GOAL):
                self._adopt_unknown(goal.type, bytes.fromhex(goal.action.removeprefix(UNKNOWN_GOAL)))
            else:
                made = self._goals[goal.action] = self._make_goal(goal, mapping, {})
                self._earlier_goals.add(made, limit_seconds(self._profile.actions[goal.type], goal.parameters))
                made.adopt(accepted=goal.accepted)

    def adopt_estop(self, held_by: Sequence[str]) -> None:
        """As `rise_engine.ports.robot.RobotWithEstop.adopt_estop`; before `connect`."""
        self._held_by = held_by

    def cancel_open_goals(self, part: str) -> None:
        for goal in self._goals_at(part):
            goal.cancel()

    def release_open_goals(self, part: str) -> None:
        for goal in self._goals_at(part):
            goal.release()
        self._reported = None  # report the state even if the robot is lost
        self._report_state()

    def _goals_at(self, part: str) -> list[Goal]:
        """Open goals that hold a part; empty: any part."""
        return [
            goal
            for goal in tuple(self._goals.values())
            if goal.phase == "ended" and goal.may_be_running and part in ("", goal.endpoint.label)
        ]

    def _open_estop(self) -> None:
        """Listen to the profile's emergency stop. Raises PortError."""
        if (estop := read_options(self._profile).estop) is not None:
            before, now = self._estop, self.clock.now
            self._estop = EstopInput(estop, self._transport, now, lambda report: self._report(report), before)
            if before is None and self._estop.source in self._held_by:
                self._estop.inherit()

    def start(self, goal: StartAction) -> None:
        mapping = self._mappings.get(goal.type)
        if mapping is None:
            self.report_ended(goal.action, "failed", f"not-sent: nothing carries {goal.type} to {self._profile.title}")
            return
        if self._stop is not None and self._stop.is_answered:
            self.end_stop()
        if self._earlier_goals.first is not None:  # otherwise the engine cancels that after 5 s
            server = mapping.deadlines.server + mapping.deadlines.cancel
            mapping = replace(mapping, deadlines=replace(mapping.deadlines, server=server))
        try:
            node, frame = self._transport.node, self._frame
            message = mapping.make_message(goal.parameters, node=node, goal=goal.action, frame=frame)
            made = self._make_goal(goal, mapping, message)
        except (PortError, ValueError) as error:
            self.report_ended(goal.action, "failed", f"not-sent: {error}")
            return
        self._goals[goal.action] = made
        self._forget_oldest()
        self._poll_endpoints((made.endpoint,))
        made.poll()
        self.on_goal_changed(made)

    def _make_goal(self, goal: StartAction, mapping: ActionMapping, message: Message) -> Goal:
        """Make a goal from a message with present values; later messages are made when needed. Raises ValueError."""
        node, frame = self._transport.node, self._frame
        make_message = partial(mapping.make_message, goal.parameters, node=node, goal=goal.action, frame=frame)
        endpoint = self._endpoint_of[goal.type]
        if isinstance(endpoint, TopicEndpoint):
            return TopicGoal(self, endpoint, goal, mapping, make_message)
        limit = limit_seconds(self._profile.actions[goal.type], goal.parameters)
        if isinstance(endpoint, ServiceEndpoint):
            return ServiceGoal(self, endpoint, goal, mapping, make_message, limit)
        made = ActionGoal(self, endpoint, goal, mapping, message, limit)
        self._by_id[made.id] = made
        return made

    def cancel(self, action: str) -> None:
        goal = self._goals.get(action)
        if goal is not None:
            goal.cancel()

    def stop_all(self) -> None:
        """Stop everything. A repeated call asks the robot again; only one report follows."""
        if self._stop is not None:
            self._stop.abandon()
        topics = [each for each in self._endpoints if isinstance(each, TopicEndpoint)]
        steps: list[Callable[[], object]] = [topic.begin_stop for topic in topics]
        steps += [goal.cancel for goal in tuple(self._goals.values())]
        steps += [self._poll_endpoints, *(partial(topic.repeat_reset, everybody=True) for topic in topics)]
        self._attempt(steps)
        self._stop = StopAll(self.clock, self._endpoints, self._find_goals, lambda report: self._report(report))
        self._stop.begin()

    def end_stop(self) -> None:
        """End the stop, because it was released."""
        if self._stop is not None:
            self._stop.abandon()
            self._stop = None

    def _make_reset(self, mapping: ActionMapping, goal: str) -> Message | None:
        """The message that takes back everything on a topic, also what other programs have published."""
        return mapping.make_reset(node=self._transport.node, goal=goal, frame=self._frame)

    def last_seen(self) -> float | None:
        """When a server was last present: its lease renews that. ROS offers no other sign of life."""
        if any(endpoint.presence.count for endpoint in self._endpoints):
            self._seen_at = self.clock.now()
        return self._seen_at

    def close(self) -> None:
        """Cancel what still runs, without waiting for an answer."""
        if self._closed:
            return
        self._closed = True
        self._report = _ignore
        self._attempt([goal.cancel for goal in self._goals.values()])
        if self._stop is not None:
            self._stop.abandon()
        if self._timer is not None:
            self._timer.cancel()
        if self._estop is not None:
            self._estop.close()
        # The middleware could lose a request if its client closed immediately.
        self.clock.call_at(self.clock.now() + CLOSE_DELAY_SECONDS, partial(close_all, self._endpoints))

    def switch_transport(self, transport: Transport) -> None:
        """Continue on another transport, because the previous one has failed. Running goals are lost. The owner closes
        both.

        :raises PortError: a type is not available there.
        """
        if self._reported is None or self._reported.status != "lost":
            self._report_lost(f"the connection to ROS is gone: {self._transport.failure() or 'reconnecting'}")
        self._transport = transport
        self._open_estop()  # first, so that the button is heard even if the rest fails
        for endpoint in self._endpoints:
            endpoint.move_to(transport)
        if self._stop is not None:  # newly found servers are asked, too
            self.stop_all()
        self._poll()

    # --- for goals (`GoalHost`) ---------------------------------------------------------------------------------

    def why_held(self) -> str:
        return health.why_held(self._estop, self._earlier_goals.first)

    def report_accepted(self, action: str) -> None:
        self._report(ActionReport(action=action, status="accepted"))

    def report_ended(self, action: str, status: Ending, reason: str) -> None:
        if status == "aborted":
            self._report(ActionReport(action=action, status="failed", reason=reason, aborted=True))
        else:
            self._report(ActionReport(action=action, status=status, reason=reason))

    def report_note(self, endpoint: Endpoint, text: str) -> None:
        self._report(Note(text=text, source=f"ros:{endpoint.name}"))

    def on_goal_changed(self, goal: Goal) -> None:
        if self._closed:
            return
        if goal.is_live():
            self._live[goal.action] = goal
        else:
            self._live.pop(goal.action, None)
        self._note_open(goal)
        self._set_timer()
        if self._stop is not None:
            self._stop.poll()

    def _note_open(self, goal: Goal) -> None:
        """Let a goal that ends here but may still run hold its part. This is reported before its end."""
        was_open = goal.action in goal.endpoint.open
        is_open = (goal.phase == "ended" or was_open) and goal.may_be_running and goal.holds_its_part
        if is_open:
            goal.endpoint.open[goal.action] = goal
        else:
            goal.endpoint.open.pop(goal.action, None)
        if is_open and not was_open and self._reported is not None:
            self._report_state()

    def _find_goals(self, endpoint: ActionEndpoint) -> Mapping[bytes, ActionGoal]:
        """Our goals at an endpoint. A released goal is judged by the server's status, like those of other clients."""
        ours = [goal for goal in self._by_id.values() if goal.endpoint is endpoint]
        return {goal.id: goal for goal in ours if not (goal.is_unknown or goal.is_released)}

    # --- polling ------------------------------------------------------------------------------------------------

    def _set_timer(self) -> None:
        """Set the timer for the next due goal, and for the next regular poll."""
        if self._closed:
            return
        if any(goal.phase == "waiting" for goal in self._live.values()):
            interval = POLL_WAITING
        elif self._reported is None or self._live or any(endpoint.fault for endpoint in self._endpoints):
            interval = POLL_RUNNING
        else:
            interval = POLL_IDLE
        now = self.clock.now()
        when = min((goal.next_deadline() for goal in self._live.values()), default=inf)
        if self._reported is None:
            when = min(when, self._grace_until)
        soonest = POLL_SOONEST if self._went_well else POLL_RUNNING
        when = max(now + soonest, min(when, now + interval))
        if when < self._next_poll:
            if self._timer is not None:
                self._timer.cancel()
            self._next_poll = when
            self._timer = self.clock.call_at(when, self._poll)

    def _poll(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer, self._next_poll = None, inf
        if self._closed:
            return
        steps: list[Callable[[], object]] = [self._poll_endpoints]
        if self._estop is not None and not self._transport.failure():
            steps.append(self._estop.poll)
        steps.append(self._earlier_goals.poll)
        self._went_well = True
        self._attempt(steps)
        self._attempt([goal.poll for goal in self._live.values()])
        self._attempt([self._report_state])
        if self._went_well:
            self._errors.clear()
        self._set_timer()

    def _attempt(self, steps: Iterable[Callable[[], object]]) -> None:
        """Do all steps. An error of one does not prevent the others, and is logged once while it lasts."""
        for step in steps:
            try:
                step()
            except Exception as error:
                self._went_well = False
                if repr(error) not in self._errors and len(self._errors) < MAX_ERRORS:
                    self._errors.add(repr(error))
                    _LOG.exception("a part of the robot could not be asked or told")

    def _poll_endpoints(self, some: Iterable[Endpoint] | None = None) -> None:
        """Check which servers are present (all, or the given ones), and notify their goals. Endpoints that appear or
        change are compared with the profile. So is another one each time, because its program may change between two
        polls."""
        turn = next(self._turn, None) if some is None else None
        polled = tuple(self._endpoints if some is None else some)
        self._attempt(partial(self._poll_endpoint, endpoint, turn) for endpoint in polled)
        changed = [endpoint for endpoint in polled if endpoint.others != endpoint.reported_others]
        if not changed:
            return
        if self._reported is not None and self._assess_health().status == "lost":
            self._report_state()  # report the loss first, so that nothing new begins in response
        for endpoint in changed:
            endpoint.reported_others = endpoint.others
            there = [goal for goal in self._goals.values() if goal.endpoint is endpoint]
            self._attempt(goal.on_server_changed if endpoint.presence.count else goal.on_server_gone for goal in there)
        if self._stop is not None:
            self._stop.poll()

    def _poll_endpoint(self, endpoint: Endpoint, turn: Endpoint | None) -> None:
        before, lost = endpoint.others, bool(self._transport.failure())
        endpoint.poll(0 if lost else None)
        if not lost and (endpoint is turn or endpoint.others != before or not endpoint.comparison.complete):
            self._compare_endpoint(endpoint)
        if isinstance(endpoint, TopicEndpoint):
            endpoint.repeat_reset(everybody=self._stop is not None)

    def _compare_endpoint(self, endpoint: Endpoint) -> None:
        looked = endpoint.compare()
        unknown = endpoint.comparison.unannounced or not endpoint.comparison.complete
        is_there = endpoint.presence.is_settled and endpoint.is_compared
        if unknown and is_there and endpoint.name not in self._uncompared:
            self._uncompared.add(endpoint.name)
            self.report_note(endpoint, describe_uncompared(endpoint.name))
        if looked and isinstance(endpoint, ActionEndpoint):
            for node in other_clients(self._transport, endpoint.name):
                if node not in self._other_clients:
                    self._other_clients.add(node)
                    self.report_note(endpoint, describe_other_client(node, endpoint.name))

    # --- the robot's state --------------------------------------------------------------------------------------

    def _assess_health(self) -> RobotHealth:
        busy = [goal.endpoint for goal in self._live.values() if goal.phase == "running"]
        return health.assess(self._transport, self._endpoints, busy, self._estop_watch.faults(self._estop))

    def _report_state(self) -> None:
        """Report the robot's state if it has changed."""
        now = self._assess_health()
        if self._reported is None:
            if now.status != "connected" and not self._transport.failure() and self._is_discovering():
                return
        elif not now.is_news_after(self._reported):
            return
        detail = health.describe(now.status, self._profile.title, self._transport, self._endpoints, self._estop)
        if now.status == "lost":
            self._report_lost(detail)
        else:
            self._reported = now
            self._report(RobotChanged(status=now.status, detail=detail, open=now.open))

    def _is_discovering(self) -> bool:
        """Whether missing endpoints may still be found, or the emergency stop may still report its state."""
        if self._estop is not None and self._estop.is_new:
            return True
        is_early = self.clock.now() + TIMER_TOLERANCE < self._grace_until
        return is_early and any(each.fault == "missing" for each in (*self._endpoints, self._estop) if each is not None)

    def _report_lost(self, detail: str) -> None:
        """Report that the whole robot is lost. Unsent goals have failed. The state of the others is unknown."""
        goals = [goal for goal in self._goals.values() if goal.phase != "ended"]
        for goal in goals:
            if goal.may_be_running:
                goal.endpoint.open[goal.action] = goal  # already now, so that the loss is reported once
        now = self._assess_health()
        self._reported = RobotHealth("lost", now.faults, now.open)
        for goal in goals:
            if goal.phase == "waiting":
                goal.on_robot_lost(detail)
        self._report(RobotChanged(status="lost", detail=detail, open=now.open))
        for goal in goals:
            goal.on_robot_lost(detail)

    # --- from the wire ------------------------------------------------------------------------------------------

    def _take_feedback(self, id: bytes, feedback: Message) -> None:
        goal = self._by_id.get(id)
        if goal is not None:
            goal.take_feedback()

    def _take_status(self, endpoint: ActionEndpoint, statuses: Mapping[bytes, int]) -> None:
        self._check_unknown_goals(endpoint)
        for goal in tuple(self._by_id.values()):
            if goal.id in statuses or (goal.endpoint is endpoint and goal.is_live()):
                goal.take_status(statuses)
        if self._stop is not None:
            self._stop.poll()

    def _check_unknown_goals(self, endpoint: ActionEndpoint) -> None:
        """Check once what a newly found server is doing. Goals of an earlier engine are known by then."""
        if self._is_connected and not endpoint.was_heard:
            endpoint.was_heard = True
            type = next(action for action, its in self._endpoint_of.items() if its is endpoint)
            for id in endpoint.client.unfinished_goals() - self._by_id.keys():
                self._adopt_unknown(type, id)

    def _adopt_unknown(self, type: str, id: bytes) -> None:
        """Take over a goal that ran before this session found the server. Its server gets nothing else meanwhile. Its
        name contains the whole id, for an engine that continues the session. (Short ids of earlier versions do not.)"""
        endpoint = self._endpoint_of[type]
        if isinstance(endpoint, ActionEndpoint) and len(id) == len(ALL_GOALS):
            goal = StartAction(f"{UNKNOWN_GOAL}{id.hex()}", type, {}, 0.0, goal=id.hex())
            made = ActionGoal(self, endpoint, goal, self._mappings[type], {}, 0.0)
            self._goals[goal.action] = self._by_id[id] = made
            made.adopt(accepted=True, unknown=True)

    def _forget_oldest(self) -> None:
        """Limit the number of remembered goals."""
        if len(self._goals) <= MAX_REMEMBERED:
            return
        goals = self._goals.values()
        needed = {goal.action for goal in goals if goal.is_live() or (goal.may_be_running and goal.holds_its_part)}
        oldest = next((goal for goal in goals if goal.action not in needed), None)
        if oldest is not None:
            del self._goals[oldest.action]
            if isinstance(oldest, ActionGoal):
                del self._by_id[oldest.id]


def _ignore(report: RobotReport) -> None:
    """Do nothing. This is the report callback before `connect` and after `close`."""
