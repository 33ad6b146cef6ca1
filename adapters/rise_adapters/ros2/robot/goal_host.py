"""The common interface of a robot's goals, and what each needs from its robot."""

from __future__ import annotations

from typing import Literal, Protocol, TypeAlias

from rise_adapters.ros2.robot.endpoints import Endpoint
from rise_engine.ports.robot import Clock

Phase: TypeAlias = Literal["waiting", "sent", "running", "ended"]
Ending: TypeAlias = Literal["succeeded", "failed", "aborted", "canceled", "timed-out", "lost"]
"""As `ActionReport.status`. aborted: it has failed because the robot itself gave it up."""

TIMER_TOLERANCE = 1e-5
"""Seconds by which a timer may be early."""


class Goal(Protocol):
    """One action on its way to the robot and back.

    It has no timer of its own (except for a topic's repetitions). `next_deadline` says when to poll it, and `poll` does
    what is due.
    """

    action: str
    """The engine's name for it."""
    type: str
    """The profile's name for what the robot does."""
    phase: Phase
    may_be_running: bool
    """Whether it may run on the robot, whatever the engine records."""

    @property
    def endpoint(self) -> Endpoint:
        """The receiver of the goal."""
        ...

    def adopt(self, *, accepted: bool) -> None:
        """Take over a goal that an earlier engine has sent, and that has ended for the session."""
        ...

    def cancel(self) -> None:
        """Stop the goal. If it was not sent, that ends it. An ended goal that may still run is asked to stop again."""
        ...

    @property
    def is_accepted(self) -> bool:
        """Whether the robot has accepted it."""
        ...

    @property
    def is_unanswerable(self) -> bool:
        """Whether nothing can tell what became of it, because it was begun by an engine that has gone."""
        ...

    @property
    def holds_its_part(self) -> bool:
        """Whether its server or topic gets nothing else while it has ended and may still be running."""
        ...

    def release(self, by: str = "somebody") -> None:
        """Count an ended goal as over on the robot, because a person has checked. `by`: who says so, for the record."""
        ...

    def why_open(self) -> str:
        """Why an ended goal that may still be running is not over, for a person."""
        ...

    def is_live(self) -> bool:
        """Whether it still needs polling: it has not ended, or must be stopped on the robot."""
        ...

    def next_deadline(self) -> float:
        """Session time, in seconds, of its next poll; `inf`: never."""
        ...

    def poll(self) -> None:
        """Do what is due."""
        ...

    def on_server_gone(self) -> None:
        """Note that nothing offers the action, or listens to the topic, any more."""
        ...

    def on_server_changed(self) -> None:
        """Note that there are more or fewer servers than before."""
        ...

    def on_robot_lost(self, reason: str) -> None:
        """Note that the whole robot is lost."""
        ...


class GoalHost(Protocol):
    """What a goal needs from its robot."""

    clock: Clock

    def why_held(self) -> str:
        """Why nothing new begins anywhere on the robot, for a person; empty: it may begin."""
        ...

    def report_accepted(self, action: str) -> None: ...

    def report_ended(self, action: str, status: Ending, reason: str) -> None:
        """Report the one ending of an action."""
        ...

    def report_note(self, endpoint: Endpoint, text: str) -> None:
        """Add a note to the record only."""
        ...

    def on_goal_changed(self, goal: Goal) -> None:
        """Note that a goal has a new polling time or a new phase."""
        ...
