"""A robot on ROS 2, behind the engine's port: `Ros2Robot` keeps its goals, and watches whether it is there.

Every action of the profile has a carrier: an action server that it is sent to, or a topic that it is published on. One
timer drives everything: it looks at the servers (ROS says nothing when one dies) and at the goals whose time has come.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Mapping
from functools import partial
from itertools import cycle
from math import inf
from typing import TYPE_CHECKING, Literal, TypeAlias

from rise_adapters.ros2 import ends
from rise_adapters.ros2.action_client import ActionClient
from rise_adapters.ros2.port import Message, PortError, Transport
from rise_adapters.ros2.robot.goals import EARLY, ActionGoal, Ending
from rise_adapters.ros2.robot.parts import ActionPart, Part, TopicPart, labels
from rise_adapters.ros2.robot.stopping import StopAll
from rise_adapters.ros2.robot.topic_goals import TopicGoal
from rise_engine.kernel.commands import StartAction
from rise_engine.kernel.inputs import ActionReport, Note, RobotChanged, StopReport
from rise_engine.robot import Clock, Report, RobotReport, Timer
from rise_engine.scenario.durations import limit_seconds
from rise_engine.scenario.model import RobotProfile

if TYPE_CHECKING:
    from rise_adapters.ros2.carriers import Carrier

_LOG = logging.getLogger(__name__)

Goal: TypeAlias = ActionGoal | TopicGoal
Status: TypeAlias = Literal["connected", "degraded", "lost"]
Standing: TypeAlias = tuple[Status, frozenset[tuple[str, str]]]
"""A robot's status, and what is wrong with which of its parts."""

LOOK = 0.25
"""Seconds between two looks at the servers while something runs ..."""
LOOK_WAITING = 0.05
"""... while a goal waits for its server ..."""
LOOK_IDLE = 0.5
"""... and while nothing does, and all are there."""
LOOK_SOONEST = 0.001
REMEMBERED = 200
"""Goals that are kept, to recognise what comes after their end."""
FAREWELL = 0.5
"""Seconds for which a client that has just cancelled something stays open after `close`."""


class Ros2Robot:
    """Implements `rise_engine.robot.Robot` over a transport that somebody else has opened and will close."""

    def __init__(
        self, profile: RobotProfile, clock: Clock, transport: Transport, carriers: Mapping[str, Carrier]
    ) -> None:
        """`carriers` by the action's name in the profile. Raises PortError when a type cannot be had."""
        self.clock = clock
        self._profile = profile
        self._carriers = carriers
        self._frame = str(profile.options.get("frame", "base_link"))
        self._goals: dict[str, Goal] = {}
        """By the engine's name, oldest first."""
        self._by_id: dict[bytes, ActionGoal] = {}
        self._live: dict[str, Goal] = {}
        """Those that have not ended, or have to be stopped on the robot."""
        self._report: Report = _nobody
        self._timer: Timer | None = None
        self._next = inf
        """When the timer goes off."""
        self._stop: StopAll | None = None
        self._told: Standing | None = None
        """How the robot stood when that was reported last."""
        self._grace_until = inf
        self._seen: float | None = None
        self._uncompared: set[str] = set()
        """Names of parts that do not say what their types are, which was said already."""
        self._closed = False
        self._use(transport)

    def _use(self, transport: Transport) -> None:
        self._transport = transport
        self._carried: dict[tuple[str, str], Part] = {}
        """By name, as the profile writes it, and type."""
        made: dict[tuple[str, str], Part] = {}
        names = list(dict.fromkeys(transport.resolve(carrier.name) for carrier in self._carriers.values()))
        label = labels(self._profile.name, names)
        for carrier in self._carriers.values():
            name = transport.resolve(carrier.name)
            if (name, carrier.type) not in made:
                made[name, carrier.type] = self._make_part(carrier, label[name])
            self._carried[carrier.name, carrier.type] = made[name, carrier.type]
        self._parts = tuple(made.values())
        self._turn = cycle(self._parts)

    def _make_part(self, carrier: Carrier, label: str) -> Part:
        if carrier.kind == "topic":
            return TopicPart(label, self._transport, carrier, self.clock)
        client = ActionClient(
            self._transport,
            carrier.name,
            carrier.type,
            now=self.clock.now,
            feedback=carrier.feedback_qos,
            status=carrier.status_qos,
        )
        part = ActionPart(label, client, self._transport, carrier, self.clock)
        client.on_feedback = self._feedback
        client.on_status = partial(self._status, part)
        return part

    def _part_of(self, carrier: Carrier) -> Part:
        return self._carried[carrier.name, carrier.type]

    @property
    def parts(self) -> tuple[str, ...]:
        """What is asked when everything is to stop: `pepper/speech`."""
        return tuple(sorted(part.label for part in self._parts))

    # --- the port -----------------------------------------------------------------------------------------------

    def connect(self, report: Report) -> None:
        """Discovery takes its time: until every server is there, or the longest deadline is over, nothing is said."""
        self._report = report
        deadlines = [carrier.deadlines.server for carrier in self._carriers.values()]
        self._grace_until = self.clock.now() + max(deadlines, default=0.0)
        self._look()

    def start(self, goal: StartAction) -> None:
        carrier = self._carriers.get(goal.type)
        if carrier is None:
            self.ended(goal.action, "failed", f"not-sent: nothing carries {goal.type} to {self._profile.title}")
            return
        node, frame = self._transport.node, self._frame
        try:
            message = carrier.message(goal.parameters, node=node, goal=goal.action, frame=frame)
            reset = carrier.reset(node=node, goal=goal.action, frame=frame) if carrier.kind == "topic" else None
        except (PortError, ValueError) as error:
            self.ended(goal.action, "failed", f"not-sent: {error}")
            return
        part = self._part_of(carrier)
        made: Goal
        if isinstance(part, ActionPart):
            limit = limit_seconds(self._profile.actions[goal.type], goal.parameters)
            made = ActionGoal(self, part, goal.action, carrier, message, goal.expected, limit)
            self._by_id[made.id] = made
        else:
            made = TopicGoal(self, part, goal.action, carrier, message, reset, goal.expected)
        self._goals[goal.action] = made
        self._forget_oldest()
        self._look_at_parts((part,))
        made.look()
        self.changed(made)

    def cancel(self, action: str) -> None:
        goal = self._goals.get(action)
        if goal is not None:
            goal.cancel()

    def stop_all(self) -> None:
        """Asked again meanwhile, it asks the robot again, and answers once."""
        if self._stop is not None:
            self._stop.drop()
        self._look_at_parts()
        idle = [part for part in self._parts if isinstance(part, TopicPart) and part.user is None]
        for goal in tuple(self._goals.values()):
            goal.cancel()
        for carrier in self._carriers.values():
            part = self._part_of(carrier)
            if isinstance(part, TopicPart) and part in idle:  # whatever others have published there
                reset = carrier.reset(node=self._transport.node, goal="", frame=self._frame)
                if reset is not None:
                    part.say(reset)
        self._stop = stop = StopAll(self.clock, self._parts, self, self._stopped)
        stop.begin()

    def seen(self) -> float | None:
        """The middleware renews its word that a server is there within each server's lease; more ROS does not say."""
        if any(part.presence.count for part in self._parts):
            self._seen = self.clock.now()
        return self._seen

    def close(self) -> None:
        """What still runs is cancelled, without waiting for an answer."""
        if self._closed:
            return
        self._closed = True
        self._report = _nobody
        for goal in tuple(self._goals.values()):
            goal.cancel()
        if self._stop is not None:
            self._stop.drop()
        if self._timer is not None:
            self._timer.cancel()
        # A request that has only just been sent could be lost with its client.
        self.clock.call_at(self.clock.now() + FAREWELL, partial(_close_all, self._parts))

    def use(self, transport: Transport) -> None:
        """Go on over another transport, because the one before is gone: what ran is lost. The owner closes both.

        Raises PortError when a type cannot be had there.
        """
        if self._told is None or self._told[0] != "lost":
            self._lose(f"the connection to ROS is gone: {self._transport.lost() or 'it is made anew'}")
        keys = {part: key for key, part in self._carried.items()}
        before = self._parts
        self._use(transport)
        _close_all(before)
        for goal in self._by_id.values():
            moved = self._carried[keys[goal.part]]
            assert isinstance(moved, ActionPart)
            goal.move(moved)
        self._look()

    # --- what goals need ----------------------------------------------------------------------------------------

    def accepted(self, action: str) -> None:
        self._report(ActionReport(action=action, status="accepted"))

    def ended(self, action: str, status: Ending, reason: str) -> None:
        self._report(ActionReport(action=action, status=status, reason=reason))

    def note(self, part: Part, text: str) -> None:
        self._report(Note(text=text, source=f"ros:{part.name}"))

    def changed(self, goal: Goal) -> None:
        if self._closed:
            return
        if goal.matters():
            self._live[goal.action] = goal
        else:
            self._live.pop(goal.action, None)
        self._arm()
        if self._stop is not None:
            self._stop.look()

    # --- what stopping everything needs ---------------------------------------------------------------------------

    def ours(self, part: ActionPart) -> Mapping[bytes, ActionGoal]:
        """Our goals at a server that are remembered."""
        return {id: goal for id, goal in self._by_id.items() if goal.part is part}

    # --- looking ------------------------------------------------------------------------------------------------

    def _arm(self) -> None:
        """Look again when the first goal wants it, and in any case soon."""
        if self._closed:
            return
        if any(goal.phase == "waiting" for goal in self._live.values()):
            interval = LOOK_WAITING
        elif self._told is None or self._live or any(part.fault for part in self._parts):
            interval = LOOK
        else:
            interval = LOOK_IDLE
        now = self.clock.now()
        when = min((goal.due() for goal in self._live.values()), default=inf)
        if self._told is None:
            when = min(when, self._grace_until)
        when = max(now + LOOK_SOONEST, min(when, now + interval))
        if when < self._next:
            if self._timer is not None:
                self._timer.cancel()
            self._next = when
            self._timer = self.clock.call_at(when, self._look)

    def _look(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer, self._next = None, inf
        if self._closed:
            return
        self._look_at_parts()
        for goal in tuple(self._live.values()):
            goal.look()
        self._tell()
        self._arm()

    def _look_at_parts(self, parts: Iterable[Part] | None = None) -> None:
        """See which servers are there (of all parts, unless some are named), and tell their goals. What appears or
        changes is compared with what the profile says; one part is each time, because a program can be replaced by
        another one between two looks."""
        lost = bool(self._transport.lost())
        news: list[tuple[Part, bool]] = []
        turn = next(self._turn, None) if parts is None else None
        for part in self._parts if parts is None else parts:
            before = part.presence.count
            gone = part.look(0 if lost else None)
            if part.presence.count != before:
                news.append((part, gone))
            if not lost and (part is turn or part.presence.count != before or not part.found.whole):
                self._examine(part)
        if not news:
            return
        if self._told is not None and self._standing()[0] == "lost":
            self._tell()  # first that the robot is lost: then nothing new is begun in answer to what is lost with it
        for part, gone in news:
            for goal in tuple(self._goals.values()):
                if goal.part is part:
                    if gone:
                        goal.server_gone()
                    elif part.presence.count:
                        goal.server_changed()
        if self._stop is not None:
            self._stop.look()

    def _examine(self, part: Part) -> None:
        part.examine()
        unknown = part.found.unannounced or not part.found.whole
        if unknown and part.presence.settled and part.compared and part.name not in self._uncompared:
            self._uncompared.add(part.name)
            self.note(part, ends.uncompared(part.name))

    # --- how the robot stands -----------------------------------------------------------------------------------

    def _standing(self) -> Standing:
        if self._transport.lost():
            return "lost", frozenset()
        wrong = frozenset((part.label, part.word or part.fault) for part in self._parts if part.fault)
        if wrong and all(map(self._useless, self._parts)):
            return "lost", wrong
        return ("degraded" if wrong else "connected"), wrong

    def _useless(self, part: Part) -> bool:
        """Nothing can be sent to it, and it does nothing of ours. (Beside what is doing something another program may
        have appeared that does not fit.)"""
        if part.fault == "unfit":
            return not any(goal.part is part and goal.phase == "running" for goal in self._live.values())
        return part.fault == "missing"

    def _tell(self) -> None:
        """Report how the robot stands, when that has changed."""
        standing = self._standing()
        status = standing[0]
        if self._told is None:
            early = self.clock.now() + EARLY < self._grace_until and any(
                part.fault == "missing" for part in self._parts
            )
            if early and status != "connected" and not self._transport.lost():
                return  # not everything has been discovered yet
        elif standing == self._told or (status == self._told[0] == "lost" and _unfit(standing) == _unfit(self._told)):
            return
        detail = self._detail(status)
        if status == "lost":
            self._lose(detail)
        else:
            self._told = standing
            self._report(RobotChanged(status=status, detail=detail))

    def _detail(self, status: Status) -> str:
        why = self._transport.lost()
        if why:
            return f"the connection to ROS is gone: {why}"
        if status == "connected":
            return f"{self._profile.title} on ROS 2 ({self._transport.about})"
        misfits = [misfit for part in self._parts for misfit in part.found.all]
        trouble = "; ".join(
            [
                *([ends.together(misfits)] if misfits else []),
                *(part.trouble for part in self._parts if part.fault not in ("", "unfit", "unheard")),
            ]
        )
        if status == "degraded":
            return trouble
        # What to do comes first: on a small screen the rest is cut.
        if misfits:
            word = misfits[0].word
            return f"{word}: {self._profile.title} {ends.IN_SHORT[word]} ({trouble})"
        if any(part.presence.ever for part in self._parts):
            return f"server-gone: the program of {self._profile.title} has gone; start it again ({trouble})"
        return f"server-missing: {self._profile.title} is not there; is its wrapper running? ({trouble})"

    def _lose(self, detail: str) -> None:
        """Nothing of the robot is there. What was not sent has failed; what the robot was doing, nobody knows."""
        self._told = ("lost", self._standing()[1])
        goals = [goal for goal in self._goals.values() if goal.phase != "ended"]
        for goal in goals:
            if goal.phase == "waiting":
                goal.lose(detail)
        self._report(RobotChanged(status="lost", detail=detail))
        for goal in goals:
            goal.lose(detail)

    # --- from the wire ------------------------------------------------------------------------------------------

    def _feedback(self, id: bytes, feedback: Message) -> None:
        goal = self._by_id.get(id)
        if goal is not None:
            goal.feedback()

    def _status(self, part: ActionPart, statuses: Mapping[bytes, int]) -> None:
        named = [self._by_id[id] for id in statuses if id in self._by_id]
        missed = [goal for goal in self._live.values() if goal.part is part and goal not in named]
        for goal in (*named, *missed):
            if isinstance(goal, ActionGoal):
                goal.status(statuses)
        if self._stop is not None:
            self._stop.look()

    # --- small things -------------------------------------------------------------------------------------------

    def _stopped(self, report: StopReport) -> None:
        self._stop = None
        self._report(report)

    def _forget_oldest(self) -> None:
        """Keep what is remembered within bounds."""
        if len(self._goals) <= REMEMBERED:
            return
        for action, goal in tuple(self._goals.items()):
            if not goal.matters() and action not in self._live:
                del self._goals[action]
                if isinstance(goal, ActionGoal):
                    del self._by_id[goal.id]
                return


def _unfit(standing: Standing) -> frozenset[tuple[str, str]]:
    return frozenset(each for each in standing[1] if each[1] in ends.WORDS)


def _close_all(parts: tuple[Part, ...]) -> None:
    for part in parts:
        try:
            part.close()
        except Exception:  # whoever owns the transport may have closed it before
            _LOG.debug("%s could not be let go of", part.name, exc_info=True)


def _nobody(report: RobotReport) -> None:
    """Nobody listens before `connect` and after `close`."""
