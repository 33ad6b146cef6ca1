"""An action that a topic carries: it is published, takes its expected time, and is taken back by the carrier's reset.

Nobody answers on a topic. That something listens counts as acceptance, that the time is over as success.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rise_adapters.ros2.ends import WORDS
from rise_adapters.ros2.port import Message, PortError
from rise_adapters.ros2.robot.goals import EARLY, Ending, Home, Phase
from rise_adapters.ros2.robot.parts import TopicPart

if TYPE_CHECKING:
    from rise_adapters.ros2.carriers import Carrier


class TopicGoal:
    """One message of ours on one topic, until its time is over."""

    open = False
    """Nothing is known of what the listener does."""

    def __init__(
        self,
        home: Home,
        part: TopicPart,
        action: str,
        carrier: Carrier,
        message: Message,
        reset: Message | None,
        expected: float,
    ) -> None:
        self.action = action
        self.phase: Phase = "waiting"
        self._home = home
        self.part = part
        self._message = message
        self._reset = reset
        self._expected = expected
        self._deadline = home.clock.now() + carrier.deadlines.server

    def cancel(self) -> None:
        if self.phase == "waiting":
            self._end("canceled", "it had not been sent yet")
        elif self.phase == "running":
            self._end("canceled", "")

    def matters(self) -> bool:
        return self.phase != "ended"

    def due(self) -> float:
        return self._deadline

    def look(self) -> None:
        now = self._home.clock.now() + EARLY
        if self.phase == "waiting":
            self.part.examine()
            if self.part.misfit:
                self._end("failed", self.part.misfit)
            elif self.part.ready:
                self._publish()
            elif now >= self._deadline:
                why = self.part.trouble + ("" if self.part.found.seen else "; is the robot's wrapper running?")
                self._end("failed", f"server-missing: {why}")
        elif self.phase == "running" and now >= self._deadline:
            self._end("succeeded", "")

    def server_gone(self) -> None:
        if self.phase == "running":
            self._end("lost", f"server-gone: what listened to {self.part.name} has gone away in the middle of it")

    def server_changed(self) -> None:
        """More or fewer listen: nothing to ask them."""

    def lose(self, reason: str) -> None:
        if self.phase == "waiting":
            self._end(
                "failed", reason if reason.startswith(("server-missing", *WORDS)) else f"server-missing: {reason}"
            )
        elif self.phase != "ended":
            self._end("lost", reason)

    def _publish(self) -> None:
        try:
            self.part.publisher.publish(self._message)
        except PortError as error:
            self._end("failed", f"not-sent: {error}")
            return
        self.part.user = self
        self.phase = "running"
        self._deadline = self._home.clock.now() + self._expected
        self._home.accepted(self.action)
        self._home.changed(self)

    def _end(self, status: Ending, reason: str) -> None:
        assert self.phase != "ended"
        self.phase = "ended"
        if self.part.user is self:  # a later one has the topic to itself
            self.part.user = None
            if self._reset is not None:
                self.part.say(self._reset)
        self._home.changed(self)
        self._home.ended(self.action, status, reason)
