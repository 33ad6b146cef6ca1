"""The status topic of an action server: how its goals stand (action_msgs/msg/GoalStatusArray)."""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence

from rise_adapters.ros2.actions.server_goal import ServerGoal
from rise_adapters.ros2.transport.port import PortError, Publisher
from rise_engine.ports.robot import Clock, Timer

_LOG = logging.getLogger(__name__)

STATUS_SECONDS = 0.01
"""Between two status arrays, and for each goal in it ..."""
STATUS_SECONDS_PER_GOAL = 0.002


class StatusPublisher:
    """Publishes the array after a change, and the more seldom the longer it is."""

    def __init__(self, publisher: Publisher, clock: Clock, goals: Callable[[], Sequence[ServerGoal]]) -> None:
        """`goals` gives those that the array is to list."""
        self._publisher = publisher
        self._clock = clock
        self._goals = goals
        self._timer: Timer | None = None
        self._next_at = 0.0
        self._closed = False

    def publish_soon(self) -> None:
        """Something has changed."""
        if self._timer is None and not self._closed:
            self._timer = self._clock.call_at(max(self._clock.now(), self._next_at), self._publish)

    def close(self, *, silently: bool = False) -> None:
        """Publish how all stands at the end (unless `silently`), and nothing any more."""
        self._closed = True
        if self._timer is not None:
            self._timer.cancel()
        if not silently:
            self._publish()
        self._publisher.close()

    def _publish(self) -> None:
        self._timer = None
        listed = self._goals()
        try:
            self._publisher.publish(
                {"status_list": [{"goal_info": goal.info, "status": goal.status} for goal in listed]}
            )
        except PortError as error:
            _LOG.warning("the status of goals could not be published: %s", error)
        self._next_at = self._clock.now() + STATUS_SECONDS + STATUS_SECONDS_PER_GOAL * len(listed)
