"""The interface of a robot's goals, and what they need from their robot."""

from __future__ import annotations

from typing import Literal, Protocol, TypeAlias

from rise_adapters.ros2.robot.endpoints import Endpoint
from rise_engine.ports.robot import Clock

Phase: TypeAlias = Literal["waiting", "sent", "running", "ended"]
Ending: TypeAlias = Literal["succeeded", "failed", "aborted", "canceled", "timed-out", "lost"]
"""As `ActionReport.status`. aborted: failed because the robot itself gave up."""

TIMER_TOLERANCE = 1e-5
"""Seconds by which a timer may be early."""


class Goal(Protocol):
    """One action on its way to the robot and back.

    It has no timer (except for the repetitions of a topic). `next_deadline` says when to call `poll`, which does what
    is due.
    """

    action: str
    """The engine's name for it."""
    type: str
    """The profile's name for what the robot does."""
    phase: Phase
    may_be_running: bool
    """Whether it may run on the robot, whatever the engine has recorded."""

    @property
    def endpoint(self) -> Endpoint:
        """The receiver of the goal."""
        ...

    def adopt(self, *, accepted: bool) -> None:
        """Take over an open goal of an earlier engine."""
        ...

    def cancel(self) -> None:
        """Stop the goal. A goal that was not sent ends immediately. An open goal is asked to stop again."""
        ...

    @property
    def is_accepted(self) -> bool:
        """Whether the robot has accepted it."""
        ...

    @property
    def is_unanswerable(self) -> bool:
        """Whether its outcome can never be known, because an engine that has gone started it."""
        ...

    @property
    def holds_its_part(self) -> bool:
        """Whether its server or topic gets nothing else while the goal is open."""
        ...

    def release(self, by: str = "somebody") -> None:
        """Count an open goal as over, because a person has checked the robot. `by`: who says so, for the record."""
        ...

    def why_open(self) -> str:
        """Why the goal is still open, for a person."""
        ...

    def is_live(self) -> bool:
        """Whether it still needs polling: it has not ended, or the robot must stop it."""
        ...

    def next_deadline(self) -> float:
        """Session time, in seconds, of its next poll; `inf`: never."""
        ...

    def poll(self) -> None:
        """Do what is due."""
        ...

    def on_server_gone(self) -> None:
        """Note that no server offers the action any more, or nothing listens to the topic."""
        ...

    def on_server_changed(self) -> None:
        """Note that the number of servers has changed."""
        ...

    def on_robot_lost(self, reason: str) -> None:
        """Note that the whole robot is lost."""
        ...


class GoalHost(Protocol):
    """The part of a robot that its goals use."""

    clock: Clock

    def why_held(self) -> str:
        """Why nothing new may begin on the whole robot, for a person; empty: it may."""
        ...

    def report_accepted(self, action: str) -> None: ...

    def report_ended(self, action: str, status: Ending, reason: str) -> None:
        """Report the ending of an action. Each action has one."""
        ...

    def report_note(self, endpoint: Endpoint, text: str) -> None:
        """Add a note to the record."""
        ...

    def on_goal_changed(self, goal: Goal) -> None:
        """Note that a goal has a new polling time or a new phase."""
        ...
