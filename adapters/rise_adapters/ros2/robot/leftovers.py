"""What an earlier engine of the session has left, and the robot may still be doing."""

from __future__ import annotations

from rise_adapters.ros2.robot.goal_host import Goal
from rise_engine.ports.robot import Clock

UNANSWERED_SECONDS = 60.0
"""The least seconds after a recovery until a goal is given up that nobody can be asked about."""


class Leftovers:
    """The goals of earlier engines."""

    def __init__(self, clock: Clock, *, gives_up: bool) -> None:
        """`gives_up`: there may be no person who releases what nobody can be asked about (`unattended`)."""
        self._clock = clock
        self._gives_up = gives_up
        self._goals: list[tuple[Goal, float]] = []
        """With the session time after which it cannot go on any more."""

    def add(self, goal: Goal, limit: float) -> None:
        """`limit`: seconds after which it counted as timed out for the engine that started it."""
        self._goals.append((goal, self._clock.now() + max(limit, UNANSWERED_SECONDS)))

    @property
    def first(self) -> Goal | None:
        """Nothing new begins beside this, because the two were never meant to happen together."""
        return next((goal for goal, _ in self._goals if goal.may_be_running and goal.holds_its_part), None)

    def poll(self) -> None:
        """Give up, after their time, what nobody can be asked about.

        The answer to a call of a service went to the engine that has gone. A goal that its server never accepted and
        does not know was perhaps never sent.
        """
        for goal, until in self._goals if self._gives_up else ():
            if goal.may_be_running and goal.is_unanswerable and self._clock.now() >= until:
                goal.release("the profile (`unattended`)")
