"""What all goals of a robot have in common, and what each of them needs of the robot that it belongs to."""

from __future__ import annotations

from typing import Literal, Protocol, TypeAlias

from rise_adapters.ros2.robot.endpoints import Endpoint
from rise_engine.ports.robot import Clock

Phase: TypeAlias = Literal["waiting", "sent", "running", "ended"]
Ending: TypeAlias = Literal["succeeded", "failed", "aborted", "canceled", "timed-out", "lost"]
"""As `ActionReport.status`; aborted: it has failed because the robot gave it up by itself."""

TIMER_TOLERANCE = 1e-5
"""Seconds that a timer may be early."""


class Goal(Protocol):
    """One action on its way to the robot and back.

    It has no timer of its own (but for what a topic repeats): `next_deadline` says when it wants to be polled, and
    `poll` does what is due.
    """

    action: str
    """As the engine calls it."""
    type: str
    """What the robot does, as the profile calls it."""
    phase: Phase
    may_be_running: bool
    """On the robot, whatever the engine thinks of it."""

    @property
    def endpoint(self) -> Endpoint:
        """Where it is sent."""
        ...

    def adopt(self, *, accepted: bool) -> None:
        """Take over one that an engine before this one has sent, and that has ended for the session."""
        ...

    def cancel(self) -> None:
        """Stop it. Before it was sent, that ends it. One that has ended, and may be running, is asked to stop again."""
        ...

    @property
    def is_accepted(self) -> bool:
        """The robot has taken it."""
        ...

    @property
    def holds_its_part(self) -> bool:
        """Whether its server or topic gets nothing else while it has ended and may be running."""
        ...

    def release(self) -> None:
        """A person has looked: one that has ended counts as over on the robot."""
        ...

    def why_open(self) -> str:
        """Of one that has ended and may be running: why it is not over, for a person."""
        ...

    def is_live(self) -> bool:
        """Whether it is still to be polled: it has not ended, or it has to be stopped on the robot."""
        ...

    def next_deadline(self) -> float:
        """Session time, in seconds, at which it wants to be polled; `inf`: never."""
        ...

    def poll(self) -> None:
        """Do what is due."""
        ...

    def on_server_gone(self) -> None:
        """Nothing offers the action (listens to the topic) any more."""
        ...

    def on_server_changed(self) -> None:
        """There are more servers than before, or fewer."""
        ...

    def on_robot_lost(self, reason: str) -> None:
        """The robot is lost as a whole."""
        ...


class GoalHost(Protocol):
    """What a goal needs of its robot."""

    clock: Clock

    def report_accepted(self, action: str) -> None: ...

    def report_ended(self, action: str, status: Ending, reason: str) -> None:
        """The one ending of an action."""
        ...

    def report_note(self, endpoint: Endpoint, text: str) -> None:
        """Something for the record only."""
        ...

    def on_goal_changed(self, goal: Goal) -> None:
        """A goal wants to be polled at another time than before, or has entered another phase."""
        ...
