"""The open goals of earlier engines of the session."""

from __future__ import annotations

from rise_adapters.ros2.robot.goal_host import Goal
from rise_engine.ports.robot import Clock

UNANSWERED_SECONDS = 60.0
"""The minimum number of seconds from a recovery until an unanswerable goal is given up."""


class EarlierGoals:
    """The goals of earlier engines."""

    def __init__(self, clock: Clock, *, gives_up: bool) -> None:
        """`gives_up`: whether unanswerable goals are given up, because there may be no person to release them."""
        self._clock = clock
        self._gives_up = gives_up
        self._goals: list[tuple[Goal, float]] = []
        """Each with the session time after which it cannot be running any more."""

    def add(self, goal: Goal, limit: float) -> None:
        """:param limit: seconds after which it timed out for the engine that started it."""
        self._goals.append((goal, self._clock.now() + max(limit, UNANSWERED_SECONDS)))

    @property
    def first(self) -> Goal | None:
        """The first goal beside which nothing new may begin, because the author did not plan the two together."""
        return next((goal for goal, _ in self._goals if goal.may_be_running and goal.holds_its_part), None)

    def poll(self) -> None:
        """Give up unanswerable goals whose time is over.

        The answer to a service call went to the engine that has gone. A goal that its server never accepted and does
        not know was perhaps never sent.
        """
        for goal, until in self._goals if self._gives_up else ():
            if goal.may_be_running and goal.is_unanswerable and self._clock.now() >= until:
                goal.release("the profile (`unattended`)")
