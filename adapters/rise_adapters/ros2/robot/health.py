"""The state of a whole robot, from its endpoints: connected, degraded or lost, with a description."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Sequence
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_adapters.ros2.compatibility import MISMATCH_KINDS, MISMATCH_WORDS, describe_mismatches
from rise_adapters.ros2.robot.endpoints import Endpoint, TopicEndpoint
from rise_adapters.ros2.robot.estop_input import EstopInput
from rise_adapters.ros2.robot.goal_host import Goal
from rise_adapters.ros2.transport.port import Transport
from rise_engine.kernel.records import OpenGoal
from rise_engine.ports.robot import Clock

Status: TypeAlias = Literal["connected", "degraded", "lost"]


class RobotHealth(Struct, frozen=True):
    """A robot's status, and the faults of its endpoints."""

    status: Status
    faults: frozenset[tuple[str, str]] = frozenset()
    """Pairs of an endpoint's label and the kind of its mismatch or fault."""
    open: tuple[OpenGoal, ...] = ()
    """Its open goals."""

    def is_news_after(self, before: RobotHealth) -> bool:
        """Whether to report this state. (For a robot that stays lost: only new mismatches and further open goals.)"""
        if self.status == "lost" == before.status:
            return self._mismatches() != before._mismatches() or not self._open() <= before._open()
        return (self.status, self.faults, self._open()) != (before.status, before.faults, before._open())

    def _open(self) -> set[tuple[str, bool]]:
        return {(goal.action, goal.accepted) for goal in self.open}

    def _mismatches(self) -> frozenset[tuple[str, str]]:
        return frozenset(each for each in self.faults if each[1].startswith((*MISMATCH_KINDS, "inactive")))


UNSTEADY_TIMES, UNSTEADY_SECONDS = 3, 30.0
"""An emergency stop with so many faults in so many seconds counts as faulty until it has worked for as long."""


class EstopWatch:
    """The reported fault of the emergency stop. An intermittent fault is reported once."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._began: deque[float] = deque(maxlen=UNSTEADY_TIMES)
        self._is_faulty = False
        self._reported: frozenset[tuple[str, str]] = frozenset()

    def faults(self, estop: EstopInput | None) -> frozenset[tuple[str, str]]:
        """As `RobotHealth.faults`."""
        if estop is None:
            return frozenset()
        now, began = self._clock.now(), self._began
        was_faulty, self._is_faulty = self._is_faulty, bool(estop.fault)
        if self._is_faulty and not was_faulty:
            began.append(now)
        is_unsteady = len(began) == UNSTEADY_TIMES and now < began[0] + UNSTEADY_SECONDS
        present = frozenset({(estop.label, str(estop.fault))} if estop.fault else ())
        self._reported = (
            self._reported | present if self._reported and is_unsteady else present
        )  # another fault is reported
        return self._reported


def assess(
    transport: Transport,
    endpoints: Sequence[Endpoint],
    busy: Collection[Endpoint],
    estop: frozenset[tuple[str, str]] = frozenset(),
) -> RobotHealth:
    """Return the robot's present state. `busy`: endpoints with a running goal of ours; `estop`: its emergency stop's
    faults."""
    goals = open_goals(endpoints)
    if transport.failure():
        return RobotHealth("lost", open=goals)
    faults = frozenset((each.label, each.mismatch_kind or each.fault) for each in endpoints if each.fault)
    if faults and all(_is_useless(each, busy) for each in endpoints):
        return RobotHealth("lost", faults, goals)
    faults |= estop
    return RobotHealth("degraded" if faults else "connected", faults, goals)


def open_goals(endpoints: Sequence[Endpoint]) -> tuple[OpenGoal, ...]:
    """The robot's open goals."""
    found = []
    for each in endpoints:
        found += [
            OpenGoal(each.label, goal.action, goal.type, goal.why_open(), accepted=goal.is_accepted)
            for goal in each.open.values()
        ]
        if isinstance(each, TopicEndpoint) and (goal := each.unstopped) is not None:
            found.append(OpenGoal(each.label, goal.action, goal.type, goal.why_open(), holds=False))
    return tuple(found)


def why_held(estop: EstopInput | None, earlier: Goal | None) -> str:
    """Why nothing new may begin on a robot (`GoalHost.why_held`). `earlier`: an open goal of an earlier engine."""
    if estop is not None and estop.pressed:
        return f"estop-pressed: the emergency stop at {estop.name} is pressed"
    if estop is not None and estop.fault:
        return f"estop-unknown: {estop.trouble}"
    if earlier is None:
        return ""
    what = f"{earlier.endpoint.name} may still be doing {earlier.type} ({earlier.why_open()})"
    return f"held: {what}, and nothing begins beside that"


def _is_useless(endpoint: Endpoint, busy: Collection[Endpoint]) -> bool:
    """Whether it can receive nothing and runs no goal of ours. (A program that does not fit may join a working
    server.)"""
    if endpoint.fault in ("unfit", "inactive"):
        return endpoint not in busy
    return endpoint.fault == "missing"


def describe(
    status: Status, title: str, transport: Transport, endpoints: Sequence[Endpoint], estop: EstopInput | None = None
) -> str:
    """Describe the state. `title`: the robot's. The remedy comes first, because a small screen cuts the end."""
    failure = transport.failure()
    if failure:
        return f"the connection to ROS is gone: {failure}"
    if status == "connected":
        return f"{title} on ROS 2 ({transport.about})"
    mismatches = [mismatch for each in endpoints for mismatch in each.comparison.mismatches]
    troubles = [
        *([describe_mismatches(mismatches)] if mismatches else []),
        *(each.trouble for each in endpoints if each.fault not in ("", "unfit", "unheard")),
        *([estop.trouble] if estop is not None and estop.fault else []),
    ]
    trouble = "; ".join(dict.fromkeys(troubles))
    if status == "degraded":
        return trouble or "the emergency stop comes and goes"
    if mismatches:
        kind = mismatches[0].kind
        return f"{kind}: {title} {MISMATCH_WORDS[kind]} ({trouble})"
    if any(each.fault == "inactive" for each in endpoints):
        return f"inactive: {title} is not active ({trouble})"
    if any(each.presence.was_seen for each in endpoints):
        return f"server-gone: the program of {title} has gone; start it again ({trouble})"
    return f"server-missing: {title} is not there; is its wrapper running? ({trouble})"
