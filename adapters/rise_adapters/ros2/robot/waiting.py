"""The time that an action waits for its part of the robot, and its outcome."""

from __future__ import annotations

from collections.abc import Callable

from rise_adapters.ros2.robot import endings
from rise_adapters.ros2.robot.endings import Outcome
from rise_adapters.ros2.robot.endpoints import Endpoint
from rise_adapters.ros2.robot.goal_host import TIMER_TOLERANCE, GoalHost
from rise_engine.base.suspend import suspended_seconds

MAX_LATE_SECONDS = 1.0
"""Maximum delay in seconds after the deadline with which a waiting action may begin."""


class Waiting:
    """The wait of one action. It continues while the computer sleeps and the session's clock stands still."""

    def __init__(self, host: GoalHost, seconds: float) -> None:
        self.until = host.clock.now() + seconds
        self._host = host
        self._suspended = suspended_seconds()

    def poll(
        self, endpoint: Endpoint, begin: Callable[[], None], why_absent: Callable[[bool], Outcome | None]
    ) -> Outcome | None:
        """Begin the action if that is possible now. Returns its ending if it can never begin.

        :param why_absent: returns the ending if its part is not ready; gets whether the time is over.
        """
        endpoint.compare()
        held = self._host.why_held()
        slept = suspended_seconds() - self._suspended
        late = self._host.clock.now() + TIMER_TOLERANCE - self.until
        if endpoint.mismatch:
            return "failed", endpoint.mismatch
        if endpoint.is_ready and not held:
            if late + slept >= MAX_LATE_SECONDS:
                return endings.of_late_start(late + slept)
            begin()
            return None
        return ("failed", held) if held and late >= 0 else why_absent(late >= 0)
