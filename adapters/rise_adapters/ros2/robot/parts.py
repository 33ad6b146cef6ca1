"""What of a robot goals go to: its action servers and the topics that it listens to, and whether they can be relied on.

ROS 2 tells a client nothing when a server dies, so all this is found by looking (`look`), several times a second.
"""

from __future__ import annotations

import logging
from collections import deque
from typing import Literal, TypeAlias

from rise_adapters.ros2.action_client import ActionClient
from rise_adapters.ros2.port import Message, PortError, Publisher, Transport
from rise_engine.robot import Clock

_LOG = logging.getLogger(__name__)

Fault: TypeAlias = Literal["", "missing", "double", "silent"]
"""What can be wrong with a part."""

SETTLING = 0.5
"""Seconds that one which was gone has to be there before it gets anything; doubled with each further loss ..."""
SETTLING_MOST = 8.0
UNSTEADY_WINDOW = 30.0
"""... within so many seconds. A server that restarts twenty times in ten seconds is reported once, not twenty times."""


class Presence:
    """Whether something that comes and goes is there, and is there to stay."""

    __slots__ = ("_clock", "_losses", "_ready_at", "changes", "count", "ever", "twice_from_start")

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._losses: deque[float] = deque(maxlen=64)
        self._ready_at = 0.0
        self.count = 0
        """How many there are."""
        self.ever = False
        """It was there once."""
        self.changes = 0
        """How often there were suddenly more or fewer: what was asked before may have been answered by another one."""
        self.twice_from_start = False
        """There were several when it appeared. (One that joins later may replace one that died a moment ago, which DDS
        goes on showing for ten seconds.)"""

    def look(self, count: int) -> bool:
        """Take in how many there are now. True when the last one has just gone."""
        before, self.count = self.count, count
        now = self._clock.now()
        if count != before:
            self.changes += 1
        if count and not before:
            self.ever = True
            self.twice_from_start = count > 1
            losses = self.losses
            self._ready_at = now + min(SETTLING * 2 ** (losses - 1), SETTLING_MOST) if losses else now
        elif before and not count:
            self._losses.append(now)
            return True
        elif count == 1:
            self.twice_from_start = False
        return False

    @property
    def losses(self) -> int:
        """How often it has gone lately."""
        since = self._clock.now() - UNSTEADY_WINDOW
        while self._losses and self._losses[0] < since:
            self._losses.popleft()
        return len(self._losses)

    @property
    def settled(self) -> bool:
        """It is there, and has been long enough."""
        return self.count > 0 and self._clock.now() >= self._ready_at


class ActionPart:
    """One action server of the robot."""

    def __init__(self, label: str, client: ActionClient, clock: Clock) -> None:
        self.label = label
        """For a person: `pepper/speech`."""
        self.client = client
        self.presence = Presence(clock)
        self._clock = clock
        self._silent_since: float | None = None

    @property
    def name(self) -> str:
        return self.client.name

    def look(self, count: int | None = None) -> bool:
        """See whether it is there (or be told). True when it has just gone; what it said of goals counts no more."""
        gone = self.presence.look(self.client.servers() if count is None else count)
        if gone:
            self.client.forget()
            self._silent_since = None
        return gone

    @property
    def ready(self) -> bool:
        """A goal can be sent: it is there, once, and to stay."""
        return self.presence.settled and self.presence.count == 1

    def unanswered(self) -> None:
        """It owes an answer that did not come in time."""
        self._silent_since = self._clock.now()

    @property
    def silent(self) -> bool:
        """It owed an answer and has given no sign of life since."""
        since, heard = self._silent_since, self.client.heard
        return since is not None and (heard is None or heard <= since)

    @property
    def fault(self) -> Fault:
        if not self.presence.settled:
            return "missing"
        return "double" if self.presence.count > 1 else "silent" if self.silent else ""

    @property
    def trouble(self) -> str:
        """What is wrong with it, for a person."""
        if not self.presence.count:
            return f"nothing offers {self.name}"
        if not self.presence.settled:
            return f"{self.name} comes and goes"
        return f"more than one server offers {self.name}" if self.presence.count > 1 else f"{self.name} does not answer"

    def close(self) -> None:
        self.client.close()


class TopicPart:
    """One topic that something of the robot listens to."""

    def __init__(self, label: str, transport: Transport, topic: str, type: str, clock: Clock) -> None:
        """Raises PortError."""
        self.label = label
        self.name = transport.resolve(topic)
        self.publisher: Publisher = transport.publisher(topic, type)
        self.presence = Presence(clock)
        self.user: object | None = None
        """The goal that published last: only its end takes back what was said."""

    def look(self, count: int | None = None) -> bool:
        return self.presence.look(self.publisher.subscribers() if count is None else count)

    def say(self, message: Message) -> None:
        """Publish what needs no answer and may be lost."""
        try:
            self.publisher.publish(message)
        except PortError as error:
            _LOG.warning("nothing can be published on %s: %s", self.name, error)

    @property
    def ready(self) -> bool:
        return self.presence.settled

    @property
    def fault(self) -> Fault:
        return "" if self.presence.settled else "missing"

    @property
    def trouble(self) -> str:
        there = self.presence.count
        return f"what listens to {self.name} comes and goes" if there else f"nothing listens to {self.name}"

    def close(self) -> None:
        self.publisher.close()


Part: TypeAlias = ActionPart | TopicPart


def labels(robot: str, names: list[str]) -> dict[str, str]:
    """By full name, short ones for a person: `/pepper/rise/speech` is `pepper/speech`, unless that could be two."""
    split = [name.strip("/").split("/") for name in names]
    short: dict[str, str] = {}
    for name, words in zip(names, split, strict=True):
        length = next((n for n in range(1, len(words)) if sum(other[-n:] == words[-n:] for other in split) == 1), 0)
        short[name] = "/".join((robot, *words[-length:]))
    return short
