"""The receivers of a robot's goals: its action servers, topics and services, and whether they are reliable.

ROS 2 does not tell a client when a server dies, so polling finds all of this, several times a second.
"""

from __future__ import annotations

import logging
from collections import deque
from contextlib import suppress
from typing import Literal, Protocol, TypeAlias

from rise_adapters.ros2 import compatibility
from rise_adapters.ros2.actions.client import ActionClient
from rise_adapters.ros2.compatibility import EndpointComparison
from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.robot.lifecycle import LifecycleWatch
from rise_adapters.ros2.transport.port import (
    Message,
    PortError,
    Publisher,
    ServiceClient,
    Transport,
)
from rise_engine.ports.robot import Clock

# --- presence ---------------------------------------------------------------------------------------------------------

SETTLING_SECONDS = 0.5
"""Seconds that an endpoint must stay after a loss before it gets anything, doubled with each further loss ..."""
MAX_SETTLING_SECONDS = 8.0
UNSTEADY_SECONDS = 30.0
"""... within this many seconds. A server that restarts twenty times in ten seconds is reported once."""


class ServerPresence:
    """The number of servers (or listeners), since when, and how often it has changed."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._losses: deque[float] = deque(maxlen=64)
        self._settled_at = 0.0
        self.count = 0
        """The present number."""
        self.was_seen = False
        """Whether it ever existed."""
        self.appeared_at = 0.0
        """Session time in seconds."""
        self.changes = 0
        """How often the number has changed: another server may have answered an earlier request."""
        self.appeared_twice = False
        """Whether there were several when it appeared. (One that joins later may replace one that has just died, which
        DDS continues to show for ten seconds.)"""

    def update(self, count: int) -> bool:
        """Take in the present number. True when the last one has just gone."""
        before, self.count = self.count, count
        now = self._clock.now()
        if count != before:
            self.changes += 1
        if count and not before:
            self.was_seen = True
            self.appeared_at = now
            self.appeared_twice = count > 1
            losses = self.recent_losses
            seconds = min(SETTLING_SECONDS * 2 ** (losses - 1), MAX_SETTLING_SECONDS) if losses else 0.0
            self._settled_at = now + seconds
        elif before and not count:
            self._losses.append(now)
            return True
        elif count == 1:
            self.appeared_twice = False
        return False

    @property
    def recent_losses(self) -> int:
        """How often it has gone recently."""
        since = self._clock.now() - UNSTEADY_SECONDS
        while self._losses and self._losses[0] < since:
            self._losses.popleft()
        return len(self._losses)

    @property
    def is_settled(self) -> bool:
        """Whether it is there, and has been for long enough."""
        return self.count > 0 and self._clock.now() >= self._settled_at


_LOG = logging.getLogger(__name__)

Fault: TypeAlias = Literal["", "unfit", "missing", "inactive", "double", "held", "silent", "unheard"]
"""What can be wrong with an endpoint. unfit: it is there, but differs from the profile (`compatibility`).
inactive: it is there, but its lifecycle says that it is not working.
held: it may still be doing something that has ended for the session, and gets nothing else.
unheard: it receives messages, but some of its own do not arrive."""

ASKING_SECONDS = 0.5
"""Seconds after its appearance in which it is asked about earlier goals, before people are told."""

HEARING_SECONDS = 5.0
"""Seconds after its status topic was found in which its last status arrives, also if it is lost once (Fast DDS repeats
after 3 s)."""

PROBE_SECONDS = 2.0
"""Seconds between two questions to a server that owes an answer. If it works again, it answers by itself."""
NO_GOAL = b"\xff" * 16
"""A goal that no server has: its rejection is a sign of life. (In a cancel, zeros would mean all goals.)"""


class OpenOne(Protocol):
    """A goal that has ended for the session, but may still be running."""

    action: str
    type: str

    @property
    def is_accepted(self) -> bool: ...

    def why_open(self) -> str: ...


UNLISTED_SECONDS = 1.0
"""Seconds after its appearance in which every part of an endpoint must be seen and compared before it gets anything.
Parts that the middleware has not listed by then will not be listed."""


class _ComparedEndpoint:
    """Whether there is another side, and the result of `compatibility` about it."""

    def __init__(self, label: str, transport: Transport, mapping: ActionMapping, clock: Clock) -> None:
        self.name = transport.resolve(mapping.name)
        """The full name of the action or topic."""
        self.label = label
        """Its name for a person: `pepper/speech`."""
        self.presence = ServerPresence(clock)
        self.comparison = EndpointComparison()
        """The result of the last comparison."""
        self.open: dict[str, OpenOne] = {}
        """The open goals that hold it, by action. While there are any, it gets nothing else."""
        self._transport = transport
        self._mapping = mapping
        self._clock = clock
        self._compared_version: int | None = None
        """The version of the graph (`Transport.graph_version`) at the last comparison."""

    def compare(self) -> bool:
        """Compare the other side with the profile, unless nothing has changed since the last time. This runs before
        each goal, and takes 2 % of a task (benchmarks/ros). Returns whether it compared."""
        version = self._transport.graph_version()
        if version is not None and version == self._compared_version:
            return False
        self._compared_version = version
        before, self.comparison = self.comparison, compatibility.compare(self._transport, self._mapping)
        if before.complete and not self.comparison.complete:  # another server is appearing
            self.presence.appeared_at = self._clock.now()
        return True

    @property
    def is_compared(self) -> bool:
        """Whether every part has been compared, or the missing ones will no longer be listed."""
        return self.comparison.complete or self._clock.now() >= self.presence.appeared_at + UNLISTED_SECONDS

    @property
    def is_ready(self) -> bool:
        """Whether something can be sent: it is there to stay and, as far as known, fits the profile."""
        return self.fault in ("", "silent", "unheard")

    @property
    def fault(self) -> Fault:
        if self.comparison.unusable:
            return "unfit"
        if not (self.presence.is_settled and self.is_compared):
            return "missing"
        if not self.open:
            return ""
        return "held" if self.is_known else "missing"

    @property
    def is_known(self) -> bool:
        """Whether it has had the time to say what it is doing."""
        return self._clock.now() >= self.presence.appeared_at + ASKING_SECONDS

    @property
    def trouble(self) -> str:
        """What is wrong with it, for a person; empty when it is there and fits."""
        if self.fault in ("unfit", "unheard"):
            return compatibility.describe_misfits(self.comparison.misfits)
        if not self.presence.count:
            return compatibility.describe_absence(self.comparison, self._mapping, self.name)
        if self.open and self.presence.is_settled:
            first, *others = self.open.values()
            more = f" and {len(others)} more" if others else ""
            return f"{self.name} may still be doing {first.type} ({first.why_open()}){more} and gets nothing else"
        return ""

    @property
    def misfit_kind(self) -> str:
        """The kind of its misfit (`other-version`, ...); empty when something can be sent to it."""
        return self.comparison.unusable[0].kind if self.comparison.unusable else ""

    @property
    def misfit(self) -> str:
        """Why nothing may be sent to it, as the reason of an action, with the remedy; empty when it may."""
        unusable = self.comparison.unusable
        return f"{self.misfit_kind}: {compatibility.describe_misfits(unusable)}" if unusable else ""


class ActionEndpoint(_ComparedEndpoint):
    """One action server of the robot."""

    def __init__(self, label: str, transport: Transport, mapping: ActionMapping, clock: Clock) -> None:
        """Raises PortError."""
        super().__init__(label, transport, mapping, clock)
        feedback, status = mapping.feedback_wanted, mapping.status_qos
        self.client = ActionClient(
            transport, mapping.name, mapping.type, now=clock.now, feedback=feedback, status=status
        )
        self.lifecycle = LifecycleWatch(transport, clock.now)
        self.was_heard = False
        """Whether it has told what it was doing when it appeared. Before its first goal, a server says nothing."""
        self._status_found_at: float | None = None
        self._unanswered_at: float | None = None
        self._probed_at = 0.0

    def poll(self, count: int | None = None) -> bool:
        """Check whether it is there, or use the given count. True when it has just gone; its statuses are then void."""
        gone = self.presence.update(self.client.count_servers() if count is None else count)
        if gone:
            self.client.statuses.clear()
            self.was_heard = False
            self._status_found_at = self._unanswered_at = None
            self.lifecycle.follow("")
        elif self.presence.count:
            self.lifecycle.poll()
            if not self.was_heard:
                self.was_heard = self._is_heard_out()
            if self.is_silent and self._clock.now() >= self._probed_at + PROBE_SECONDS:
                self._probe()
        return gone

    def _is_heard_out(self) -> bool:
        """Whether a status from before its appearance would have arrived by now."""
        now = self._clock.now()
        if not self.client.count_status_publishers():
            self._status_found_at = None
        elif self._status_found_at is None:
            self._status_found_at = now
        return self._status_found_at is not None and now >= self._status_found_at + HEARING_SECONDS

    def compare(self) -> bool:
        looked = super().compare()
        if self.presence.count and (looked or not self.lifecycle.node):
            self.lifecycle.follow_server(self.name)
        return looked

    def mark_unanswered(self) -> None:
        """Note that it owes an answer that did not arrive in time."""
        self._unanswered_at = self._probed_at = self._clock.now()

    def _probe(self) -> None:
        """Ask it again. Requests while it stood still may be lost, because its side took ours for dead."""
        self._probed_at = self._clock.now()
        with suppress(PortError):
            self.client.get_result(NO_GOAL, lambda status, result: None)

    @property
    def is_silent(self) -> bool:
        """Whether it owed an answer and has given no sign of life since."""
        since, heard = self._unanswered_at, self.client.heard_at
        return since is not None and (heard is None or heard <= since)

    @property
    def misfit_kind(self) -> str:
        return super().misfit_kind or (f"inactive, {self.lifecycle.state}" if self.fault == "inactive" else "")

    @property
    def misfit(self) -> str:
        return super().misfit or (f"inactive: {self.lifecycle.trouble}" if self.lifecycle.sentence else "")

    @property
    def fault(self) -> Fault:
        fault = super().fault
        if fault not in ("", "held"):
            return fault
        if self.lifecycle.sentence:
            return "inactive"
        if self.presence.count > 1:
            return "double"
        if fault:
            return fault
        return "silent" if self.is_silent else "unheard" if self.comparison.unheard else ""

    @property
    def trouble(self) -> str:
        if trouble := super().trouble:
            return trouble
        if not self.presence.is_settled:
            return f"{self.name} comes and goes"
        if self.lifecycle.sentence:
            return self.lifecycle.trouble
        if self.presence.count > 1:
            return compatibility.describe_several_servers(self.presence.count, self.name)
        return f"{self.name} does not answer" if self.is_compared else f"{self.name} has only just been found"

    def close(self) -> None:
        self.client.close()
        self.lifecycle.close()


class TopicEndpoint(_ComparedEndpoint):
    """One topic that a part of the robot listens to."""

    def __init__(self, label: str, transport: Transport, mapping: ActionMapping, clock: Clock) -> None:
        """Raises PortError."""
        super().__init__(label, transport, mapping, clock)
        self.publisher: Publisher = transport.publisher(mapping.name, mapping.type, mapping.topic_qos)
        self.user: object | None = None
        """The goal that published last. Only its end takes the message back."""
        self.reset_by: object | None = None
        """The goal whose end took back the last message."""
        self.is_stoppable = mapping.stoppable
        """Whether a message can stop what was requested."""
        self.is_harmless = mapping.harmless
        self.unstopped: OpenOne | None = None
        """The last publisher's goal if it has ended and nothing can stop its request."""

    def poll(self, count: int | None = None) -> bool:
        return self.presence.update(self.publisher.count_subscribers() if count is None else count)

    def listeners(self) -> frozenset[bytes]:
        """The programs that listen now (`RemoteEndpoint.program`), as far as they can be distinguished."""
        return frozenset(each.program for each in self._transport.subscriber_endpoints(self.name)) - {b""}

    def publish(self, message: Message) -> None:
        """Publish a message that needs no answer and may be lost."""
        try:
            self.publisher.publish(message)
        except PortError as error:
            _LOG.warning("nothing can be published on %s: %s", self.name, error)

    @property
    def trouble(self) -> str:
        return super().trouble or (
            f"what listens to {self.name} {'comes and goes' if self.is_compared else 'has only just been found'}"
        )

    def close(self) -> None:
        self.publisher.close()


class ServiceEndpoint(_ComparedEndpoint):
    """One service of the robot."""

    def __init__(self, label: str, transport: Transport, mapping: ActionMapping, clock: Clock) -> None:
        """Raises PortError."""
        super().__init__(label, transport, mapping, clock)
        self.client: ServiceClient = transport.client(mapping.name, mapping.type)

    def poll(self, count: int | None = None) -> bool:
        return self.presence.update(self.client.count_servers() if count is None else count)

    @property
    def fault(self) -> Fault:
        fault = super().fault
        return "double" if fault in ("", "held") and self.presence.count > 1 else fault

    @property
    def trouble(self) -> str:
        if trouble := super().trouble:
            return trouble
        if not self.presence.is_settled:
            return f"{self.name} comes and goes"
        if self.presence.count > 1:
            return compatibility.describe_several_servers(self.presence.count, self.name)
        return f"{self.name} has only just been found"

    def close(self) -> None:
        self.client.close()


Endpoint: TypeAlias = ActionEndpoint | TopicEndpoint | ServiceEndpoint


def close_all(endpoints: tuple[Endpoint, ...]) -> None:
    """Close them. The owner of the transport may have closed it, and so them, before."""
    for endpoint in endpoints:
        endpoint.close()


def short_labels(robot: str, names: list[str]) -> dict[str, str]:
    """Short names for a person, by full name: `/pepper/rise/speech` is `pepper/speech`, unless ambiguous."""
    split = [name.strip("/").split("/") for name in names]
    short: dict[str, str] = {}
    for name, words in zip(names, split, strict=True):
        length = next((n for n in range(1, len(words)) if sum(other[-n:] == words[-n:] for other in split) == 1), 0)
        short[name] = "/".join((robot, *words[-length:]))
    return short
