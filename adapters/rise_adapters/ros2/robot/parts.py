"""What of a robot goals go to: its action servers and the topics that it listens to, and whether they can be relied on.

ROS 2 tells a client nothing when a server dies, so all this is found by looking (`look`), several times a second.
"""

from __future__ import annotations

import logging
from collections import deque
from typing import TYPE_CHECKING, Literal, TypeAlias

from rise_adapters.ros2 import ends
from rise_adapters.ros2.action_client import ActionClient
from rise_adapters.ros2.port import Message, PortError, Publisher, Transport
from rise_engine.robot import Clock

if TYPE_CHECKING:
    from rise_adapters.ros2.carriers import Carrier

_LOG = logging.getLogger(__name__)

Fault: TypeAlias = Literal["", "unfit", "missing", "double", "silent", "unheard"]
"""What can be wrong with a part. unfit: it is there, and is another one than the profile says (`ends`). unheard: what
is sent reaches it, and some of what it says does not arrive."""

UNLISTED = 1.0
"""Seconds after its appearance in which everything of a part must have been seen and compared before it gets anything.
What the middleware has not listed by then it does not list."""

SETTLING = 0.5
"""Seconds that one which was gone has to be there before it gets anything; doubled with each further loss ..."""
SETTLING_MOST = 8.0
UNSTEADY_WINDOW = 30.0
"""... within so many seconds. A server that restarts twenty times in ten seconds is reported once, not twenty times."""


class Presence:
    """Whether something that comes and goes is there, and is there to stay."""

    __slots__ = ("_clock", "_losses", "_ready_at", "changes", "count", "ever", "since", "twice_from_start")

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._losses: deque[float] = deque(maxlen=64)
        self._ready_at = 0.0
        self.count = 0
        """How many there are."""
        self.ever = False
        """It was there once."""
        self.since = 0.0
        """When it appeared."""
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
            self.since = now
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


class _Examined:
    """What `ends` says about a part's other side."""

    def __init__(self, transport: Transport, carrier: Carrier, clock: Clock) -> None:
        self.presence = Presence(clock)
        self.found = ends.NOTHING
        """What was seen when it was examined last."""
        self._transport = transport
        self._carrier = carrier
        self._clock = clock

    def examine(self) -> None:
        """Compare what is there with what the profile says."""
        before, self.found = self.found, ends.look(self._transport, self._carrier)
        if before.whole and not self.found.whole:  # another one is appearing
            self.presence.since = self._clock.now()

    @property
    def compared(self) -> bool:
        """Everything of it has been compared, or what is missing will not be listed any more."""
        return self.found.whole or self._clock.now() >= self.presence.since + UNLISTED

    @property
    def there(self) -> bool:
        """It is there, and to stay, and is what the profile says, as far as can be known."""
        return self.presence.settled and self.compared and not self.found.wrong

    @property
    def word(self) -> str:
        """The kind of what does not fit (`other-version`, ...); empty when something can be sent to it."""
        return self.found.wrong[0].word if self.found.wrong else ""

    @property
    def misfit(self) -> str:
        """Why nothing may be sent to it: the reason of an action that is not, with what to do. Empty when it may."""
        return f"{self.word}: {ends.together(self.found.wrong)}" if self.word else ""


class ActionPart(_Examined):
    """One action server of the robot."""

    def __init__(self, label: str, client: ActionClient, transport: Transport, carrier: Carrier, clock: Clock) -> None:
        super().__init__(transport, carrier, clock)
        self.label = label
        """For a person: `pepper/speech`."""
        self.client = client
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
        return self.there and self.presence.count == 1

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
        if self.found.wrong:
            return "unfit"
        if not self.there:
            return "missing"
        if self.presence.count > 1:
            return "double"
        return "silent" if self.silent else "unheard" if self.found.unheard else ""

    @property
    def trouble(self) -> str:
        """What is wrong with it, for a person."""
        if self.found.wrong or (self.fault == "unheard"):
            return ends.together(self.found.all)
        if not self.presence.count:
            return ends.nothing(self.found, self._carrier, self.name)
        if not self.presence.settled:
            return f"{self.name} comes and goes"
        if self.presence.count > 1:
            return ends.several(self.presence.count, self.name)
        return f"{self.name} does not answer" if self.compared else f"{self.name} has only just been found"

    def close(self) -> None:
        self.client.close()


class TopicPart(_Examined):
    """One topic that something of the robot listens to."""

    def __init__(self, label: str, transport: Transport, carrier: Carrier, clock: Clock) -> None:
        """Raises PortError."""
        super().__init__(transport, carrier, clock)
        self.label = label
        self.name = transport.resolve(carrier.name)
        self.publisher: Publisher = transport.publisher(carrier.name, carrier.type, carrier.topic_qos)
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
        return self.there

    @property
    def fault(self) -> Fault:
        return "unfit" if self.found.wrong else "" if self.there else "missing"

    @property
    def trouble(self) -> str:
        if self.found.wrong:
            return ends.together(self.found.wrong)
        if not self.presence.count:
            return ends.nothing(self.found, self._carrier, self.name)
        return f"what listens to {self.name} {'comes and goes' if self.compared else 'has only just been found'}"

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
