"""Carries out the kernel's commands: timers on the session's clock, actions on the robot.

An adapter's exception ends here: it becomes a report, and so a record.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any
from uuid import NAMESPACE_OID, uuid4, uuid5

from msgspec.structs import replace

from rise_engine.kernel.commands import (
    CancelAction,
    CancelOpenGoals,
    CancelTimer,
    Command,
    EndStop,
    ReleaseOpenGoals,
    SetTimer,
    StartAction,
    StopRobot,
)
from rise_engine.kernel.inputs import ActionReport, AnyInput, Note, RobotChanged, StopReport, TimerElapsed
from rise_engine.ports.robot import Robot, RobotAmongOthers, RobotWithEstop, RobotWithOpenGoals, Timer
from rise_engine.run.engine.clock import SessionClock
from rise_engine.scenario.model import Scenario
from rise_engine.scenario.reading.lexicon import RobotWording

NOT_BEGUN = "it had not begun yet"

_LOG = logging.getLogger(__name__)


class CommandRunner:
    """One session's timers and robot."""

    def __init__(
        self,
        robot: Robot,
        scenario: Scenario,
        clock: SessionClock,
        post: Callable[[AnyInput], None],
        session_id: str = "",
    ) -> None:
        """:param robot: not connected yet.
        :param scenario: has the robot's name for the record, and the wording of what it says.
        :param clock: the session's.
        :param post: takes the robot's reports, and every elapsed timer.
        :param session_id: the source of the goals' UUIDs, the same for every engine of the session; empty: no other
            engine will continue the session.
        """
        self._robot = robot
        self._robot_name = scenario.robot.name
        self._wording = RobotWording(scenario)
        self._clock = clock
        self._post = post
        self._timers: dict[int, Timer] = {}
        self._goal_namespace = uuid5(NAMESPACE_OID, session_id) if session_id else uuid4()

    def change_wording(self, scenario: Scenario) -> None:
        """Use this scenario's wording for the robot from now on."""
        self._wording = RobotWording(scenario)

    @property
    def has_timers(self) -> bool:
        """Whether any timer is set."""
        return bool(self._timers)

    @property
    def robot_seen(self) -> float | None:
        """Session time of the robot's last sign of life; None if its driver does not know, or has failed."""
        try:
            return self._robot.last_seen()
        except Exception:  # an adapter of another author may fail, or lack this method
            return None

    def connect(self, unfinished: Iterable[StartAction] = (), held_by: Sequence[str] = ()) -> None:
        """Connect to the robot. `unfinished`: an earlier engine's actions; `held_by`: the emergency stops pressed for
        it."""
        goals = [self._with_id(goal) for goal in unfinished]
        robot = self._robot
        if held_by and isinstance(robot, RobotWithEstop):
            self._call_robot("take over its emergency stop", lambda: robot.adopt_estop(tuple(held_by)))
        if goals and isinstance(robot, RobotWithOpenGoals):
            self._call_robot("take over what it may be doing", lambda: robot.adopt(goals))
        if failure := self._call_robot("connect", lambda: self._robot.connect(self._post)):
            self._post(RobotChanged(status="lost", detail=failure))

    def set_timer(self, timer: int, at: float) -> None:
        """Post a `TimerElapsed` for this timer at the session time `at`."""
        self._timers[timer] = self._clock.call_at(at, partial(self._on_timer_elapsed, timer))

    def _on_timer_elapsed(self, timer: int) -> None:
        self._timers.pop(timer, None)
        self._post(TimerElapsed(timer=timer))

    def run(self, command: Command) -> None:
        """Carry out one command. Never raises."""
        match command:
            case SetTimer(timer=timer, at=at):
                self.set_timer(timer, at)
            case CancelTimer(timer=timer):
                handle = self._timers.pop(timer, None)
                if handle is not None:
                    handle.cancel()
            case StartAction():
                parameters = self._wording.parameters_for_robot(command.type, command.parameters)
                goal = self._with_id(command, parameters)
                if failure := self._call_robot(f"start {command.action}", lambda: self._robot.start(goal)):
                    self._post(ActionReport(action=command.action, status="failed", reason=failure))
            case CancelAction(action=action):
                if failure := self._call_robot(f"cancel {action}", lambda: self._robot.cancel(action)):
                    # It continues until it ends, or until its time limit.
                    self._post(Note(text=f"{action} could not be cancelled: {failure}"))
            case CancelOpenGoals() | ReleaseOpenGoals():
                self._settle_open_goals(command)
            case StopRobot():
                if failure := self.stop_robot():
                    self._post(StopReport(unconfirmed=(self._robot_name,)))
                    self._post(Note(text=f"the robot could not be asked to stop: {failure}"))

            case EndStop():
                if isinstance(robot := self._robot, RobotAmongOthers):
                    self._call_robot("end the stop", robot.end_stop)

    def _settle_open_goals(self, command: CancelOpenGoals | ReleaseOpenGoals) -> None:
        robot = self._robot
        assert isinstance(robot, RobotWithOpenGoals)  # only such a robot reports open goals
        settle = robot.cancel_open_goals if isinstance(command, CancelOpenGoals) else robot.release_open_goals
        if failure := self._call_robot("settle open goals", lambda: settle(command.part)):
            self._post(Note(text=f"that had no effect: {failure}"))

    def _with_id(self, goal: StartAction, parameters: dict[str, Any] | None = None) -> StartAction:
        uuid = uuid5(self._goal_namespace, goal.action)
        return replace(goal, goal=uuid.hex, parameters=goal.parameters if parameters is None else parameters)

    def stop_robot(self) -> str:
        """Ask the robot to stop; return a sentence if its adapter fails, otherwise an empty text."""
        return self._call_robot("stop the robot", lambda: self._robot.stop_all())

    def release(self) -> None:
        """Cancel all timers and close the robot's adapter."""
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()
        self._call_robot("close", lambda: self._robot.close())

    def _call_robot(self, what: str, call: Callable[[], None]) -> str:
        """Call the robot's adapter; return a sentence if it fails or cannot do that, otherwise an empty text."""
        try:
            call()
        except Exception as error:  # code of another author
            _LOG.exception("the robot adapter failed to %s", what)
            return f"the robot adapter failed ({error_text(error)})"
        return ""


def error_text(error: Exception) -> str:
    """Format an exception for the record: its kind, and its text if there is any."""
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
