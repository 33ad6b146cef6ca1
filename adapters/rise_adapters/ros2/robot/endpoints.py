"""The receivers of a robot's goals: its action servers, topics and services, and whether they are reliable.

ROS 2 does not report the death of a server, so all of this is polled several times a second.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from math import inf
from typing import Literal, Protocol, TypeAlias

from rise_adapters.ros2 import compatibility
from rise_adapters.ros2.actions.client import ActionClient
from rise_adapters.ros2.compatibility import EndpointComparison
from rise_adapters.ros2.mapping import ActionMapping
from rise_adapters.ros2.robot.lifecycle import LifecycleWatch
from rise_adapters.ros2.robot.listeners import FINDING_SECONDS, LEASE_SECONDS, Listeners
from rise_adapters.ros2.robot.presence import ServerPresence
from rise_adapters.ros2.transport.port import (
    Message,
    PortError,
    Publisher,
    ServiceClient,
    Transport,
)
from rise_engine.ports.robot import Clock

_LOG = logging.getLogger(__name__)

Fault: TypeAlias = Literal["", "unfit", "missing", "inactive", "double", "held", "silent", "unheard"]
"""Faults of an endpoint. unfit: it differs from the profile (`compatibility`). inactive: its lifecycle node is not
active. double: there are several servers. held: an open goal may still run there, so it gets nothing else. silent: it
owes an answer. unheard: some of its messages do not arrive."""

ASKING_SECONDS = 0.5
"""Seconds after it appears for questions about earlier goals, before the fault is reported."""

STATUS_WAIT_SECONDS = 5.0
"""Seconds until a new status topic delivers its last status, even after one loss (Fast DDS repeats after 3 s)."""

PROBE_SECONDS = 2.0
"""Seconds between questions to a server that owes an answer. A server that works again answers the next one."""
NO_GOAL = b"\xff" * 16
"""A goal that no server has: any answer about it is a sign of life. (In a cancel, zeros would mean all goals.)"""


class EndpointGoal(Protocol):
    """An open goal: it has ended for the session, but may still be running."""

    action: str
    type: str

    @property
    def is_accepted(self) -> bool: ...

    def why_open(self) -> str: ...


NOT_HEARD = "it may not have heard that it should stop"

DISCOVERY_SECONDS = 1.0
"""Seconds for all parts of a new endpoint to be seen and compared. Later, the middleware lists no more parts."""


class _ComparedEndpoint:
    """An endpoint compared with the profile: whether it is present, and what `compatibility` found."""

    def __init__(self, label: str, transport: Transport, mapping: ActionMapping, clock: Clock) -> None:
        """Raises PortError."""
        self.name = transport.resolve(mapping.name)
        """The full name of the action or topic."""
        self.label = label
        """Its name for a person: `pepper/speech`."""
        self.presence = ServerPresence(clock)
        self.comparison = EndpointComparison()
        """The result of the last comparison."""
        self.reported_others: object = 0
        """The value of `others` that its goals last got."""
        self.open: dict[str, EndpointGoal] = {}
        """The open goals that hold it, by action. Meanwhile it gets nothing else."""
        self._transport = transport
        self._mapping = mapping
        self._clock = clock
        self._compared_version: int | None = None
        """The version of the graph (`Transport.graph_version`) at the last comparison."""
        self._open()

    def _open(self) -> None:
        """Open what it needs on its transport. Raises PortError."""
        raise NotImplementedError

    def poll(self, count: int | None = None) -> bool:
        """Check whether it is present, or use the given count. Returns whether it has just gone."""
        raise NotImplementedError

    def close(self) -> None:
        raise NotImplementedError

    def move_to(self, transport: Transport) -> None:
        """Continue on another transport, where nothing is found yet. Raises PortError."""
        self.poll(0)
        self.close()
        self._transport, self._compared_version = transport, None
        self.comparison = EndpointComparison()
        self._open()

    @property
    def others(self) -> object:
        """The other side, as a value to compare: a change of it matters to the goals there."""
        return self.presence.changes

    def compare(self) -> bool:
        """Compare the other side with the profile if anything changed since the last comparison. Returns whether it
        did. Before each goal, this takes 2 % of a task (benchmarks/ros)."""
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
        """Whether every part is compared, or the missing ones will not be listed any more."""
        return self.comparison.complete or self._clock.now() >= self.presence.appeared_at + DISCOVERY_SECONDS

    @property
    def is_ready(self) -> bool:
        """Whether a message can be sent: it is settled and, as far as known, fits the profile."""
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
        """Whether it has had time to report what it is doing."""
        return self._clock.now() >= self.presence.appeared_at + ASKING_SECONDS

    @property
    def trouble(self) -> str:
        """The fault, for a person; empty if it is present and fits."""
        if self.fault in ("unfit", "unheard"):
            return compatibility.describe_mismatches(self.comparison.mismatches)
        if not self.presence.count:
            return compatibility.describe_absence(self.comparison, self._mapping, self.name)
        if self.open and self.presence.is_settled:
            first, *others = self.open.values()
            more = f" and {len(others)} more" if others else ""
            return f"{self.name} may still be doing {first.type} ({first.why_open()}){more} and gets nothing else"
        return ""

    @property
    def mismatch_kind(self) -> str:
        """The kind of its mismatch (`other-version`, ...); empty if it can receive messages."""
        return self.comparison.unusable[0].kind if self.comparison.unusable else ""

    @property
    def mismatch(self) -> str:
        """Why it may receive nothing, as the reason of an action, with the remedy; empty if it may."""
        unusable = self.comparison.unusable
        return f"{self.mismatch_kind}: {compatibility.describe_mismatches(unusable)}" if unusable else ""


class ActionEndpoint(_ComparedEndpoint):
    """One action server of the robot."""

    def __init__(self, label: str, transport: Transport, mapping: ActionMapping, clock: Clock) -> None:
        """Raises PortError."""
        super().__init__(label, transport, mapping, clock)
        self.was_heard = False
        """Whether it has reported what it was doing when it appeared. A server says nothing before its first goal."""
        self._was_away = False
        """Whether it has ever gone. Meanwhile other clients may have started goals there."""
        self._programs: frozenset[bytes] = frozenset()
        """The programs that offered it at the last comparison."""
        self._status_found_at: float | None = None
        self._unanswered_at: float | None = None
        self._probed_at = 0.0

    def _open(self) -> None:
        mapping, now = self._mapping, self._clock.now
        feedback, status = mapping.feedback_wanted, mapping.status_qos
        self.client = ActionClient(
            self._transport, mapping.name, mapping.type, now=now, feedback=feedback, status=status
        )
        self.lifecycle = LifecycleWatch(self._transport, now)

    def move_to(self, transport: Transport) -> None:
        before = self.client
        super().move_to(transport)
        self.client.on_feedback, self.client.on_status = before.on_feedback, before.on_status

    def poll(self, count: int | None = None) -> bool:
        """Check whether it is present, or use the given count. True when it has just gone; its statuses are cleared."""
        gone = self.presence.update(self.client.count_servers() if count is None else count)
        if gone:
            self._was_away = True
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

    @property
    def shows_goals(self) -> bool:
        """Whether a goal that runs there would be visible: after an absence, only by a status, if it publishes any."""
        is_mute = not self.client.count_status_publishers()
        is_late = self._clock.now() >= self.presence.appeared_at + STATUS_WAIT_SECONDS
        return self.was_heard or (is_late if self._was_away and is_mute else self.is_known and not self._was_away)

    def _is_heard_out(self) -> bool:
        """Whether a status from before it appeared would have arrived by now."""
        now = self._clock.now()
        if not self.client.count_status_publishers():
            self._status_found_at = None
        elif self._status_found_at is None:
            self._status_found_at = now
        return self._status_found_at is not None and now >= self._status_found_at + STATUS_WAIT_SECONDS

    def compare(self) -> bool:
        looked = super().compare()
        if programs := self.comparison.programs:
            if self._programs and not self._programs & programs:
                self._change_program()
            self._programs = programs
        if self.presence.count and (looked or not self.lifecycle.node):
            self.lifecycle.follow_server(self.name)
        return looked

    def _change_program(self) -> None:
        """Note that its program was restarted, perhaps between two polls. Its goals do not continue."""
        self.presence.changes += 1
        self.presence.appeared_at = self._clock.now()

    def mark_unanswered(self) -> None:
        """Note that it owes an answer that did not arrive in time."""
        self._unanswered_at = self._probed_at = self._clock.now()

    def _probe(self) -> None:
        """Ask it again. Requests during a standstill may be lost, because its middleware considered this side dead."""
        self._probed_at = self._clock.now()
        with suppress(PortError):
            self.client.get_result(NO_GOAL, lambda status, result: None)

    @property
    def is_silent(self) -> bool:
        """Whether it owed an answer and has given no sign of life since."""
        since, heard = self._unanswered_at, self.client.heard_at
        return since is not None and (heard is None or heard <= since)

    @property
    def mismatch_kind(self) -> str:
        return super().mismatch_kind or (f"inactive, {self.lifecycle.state}" if self.fault == "inactive" else "")

    @property
    def mismatch(self) -> str:
        return super().mismatch or (f"inactive: {self.lifecycle.trouble}" if self.lifecycle.sentence else "")

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
    """One topic that a part of the robot listens to. Its last message counts, and the profile's `reset` takes it back.

    While no order is in force, every program that may have one gets the reset as soon as it listens (`Listeners`).
    """

    def __init__(
        self,
        label: str,
        transport: Transport,
        mapping: ActionMapping,
        clock: Clock,
        make_reset: Callable[[str], Message | None],
    ) -> None:
        """`make_reset`: returns the message that takes back an order, with present values (a base ignores old stamps).
        It gets the goal's name, or an empty text. Raises PortError."""
        super().__init__(label, transport, mapping, clock)
        self.user: EndpointGoal | None = None
        """The goal whose order is in force: published last and not taken back."""
        self.reset_by: EndpointGoal | None = None
        """The goal whose order was taken back last."""
        self.is_stoppable = mapping.stoppable
        """Whether a message can stop the action."""
        self.is_harmless = mapping.harmless
        self.unstopped: EndpointGoal | None = None
        """The goal that published last, if it has ended and nothing can stop it."""
        self._listeners = Listeners(clock.now)
        self._make_reset = make_reset
        self._is_lossy = False
        """Whether a message to some listener may be lost."""
        self._taken_back_at = self._reset_at = -inf
        """When the first reset after the last order was published, and when the last reset was."""
        self._warned_of = ""

    def _open(self) -> None:
        mapping = self._mapping
        self.publisher: Publisher = self._transport.publisher(mapping.name, mapping.type, mapping.topic_qos)

    def poll(self, count: int | None = None) -> bool:
        found = self._find_nodes() if count is None else {}
        gone = self.presence.update(self.publisher.count_subscribers() if found else 0)
        found = found if self.presence.count else {}
        self._listeners.update(found, stands=self.user is not None, latched=self._mapping.topic_qos.latched)
        return gone

    @property
    def others(self) -> object:
        return self.presence.count, self._listeners.present

    def find_listeners(self) -> frozenset[bytes]:
        """The programs that listen now and may act on messages."""
        return frozenset(self._find_nodes())

    def _find_nodes(self) -> dict[bytes, str]:
        """These programs with their nodes (empty: unknown). Programs without an id get numbers."""
        own = self._mapping.topic_qos
        ends = [
            end
            for end in self._transport.subscriber_endpoints(self.name)
            if end.type == self._mapping.type and not compatibility.qos_conflict(own, end.qos)
        ]
        unknown = 0 if ends or self._transport.failure() else self.publisher.count_subscribers()
        ends = [end for end in ends if not compatibility.is_observer(end.node)]
        self._is_lossy = not own.reliable or any(end.qos is not None and not end.qos.reliable for end in ends)
        unknown += sum(not end.program for end in ends)
        nodes: dict[bytes, set[str]] = {b"%d" % number: set() for number in range(unknown)}
        for end in ends:
            if end.program:
                nodes.setdefault(end.program, set()).add(end.node)
        return {program: " ".join(sorted(each - {""})) for program, each in nodes.items()}

    def order(self, goal: EndpointGoal, message: Message) -> frozenset[bytes]:
        """Publish a goal's message, which is now in force. Returns the programs that listen. Raises PortError."""
        self.publisher.publish(message)
        found = self._find_nodes()
        self._listeners.order(found, stands=self.user is not None)
        self.user, self.reset_by = goal, None
        return frozenset(found)

    def adopt(self, goal: EndpointGoal) -> None:
        """Note that the order of an earlier engine is in force."""
        self.user = goal
        self._listeners.adopt()

    def take_back(self, goal: EndpointGoal) -> None:
        """Publish the reset, at a goal's end."""
        self.user, self.reset_by = None, goal
        self._taken_back_at = self._clock.now()
        self._publish_reset()

    def begin_stop(self) -> None:
        """Prepare to send the reset to every listener again, because other programs may have published, too."""
        self._listeners.note_other_order()
        self._taken_back_at = self._clock.now()

    def repeat_reset(self, *, everybody: bool) -> None:
        """Publish the reset again if some listener may lack it. `everybody`: also for listeners without an order of
        ours."""
        if self.user is not None or not self.is_stoppable or not (everybody or self._listeners.have_order):
            return
        now, since = self._clock.now(), self._taken_back_at
        is_repeated = (  # at growing intervals
            self._is_lossy
            and now < since + LEASE_SECONDS
            and now >= self._reset_at + max(FINDING_SECONDS, self._reset_at - since)
        )
        if self._listeners.lacks_reset or (is_repeated and self._listeners.present):
            self._publish_reset()

    def release(self, goal: EndpointGoal) -> None:
        """Count the goal's order as over, because a person says so."""
        if self.user is goal or self.reset_by is goal:
            self.user = self.reset_by = None
            self._listeners.excuse_absent()

    def is_open(self, goal: EndpointGoal) -> bool:
        """Whether a listener may still carry out the order of an ended goal."""
        return self.user is goal or (self.reset_by is goal and self.owes_reset)

    @property
    def owes_reset(self) -> bool:
        """Whether the reset may not have reached a program that has an order."""
        return self._listeners.owes_reset

    @property
    def all_received_reset(self) -> bool:
        """Whether all listeners have received the last reset, as far as that can be known."""
        return not (self._listeners.owes_reset or self._listeners.lacks_reset)

    def _publish_reset(self) -> None:
        reset = self._make_reset(self.reset_by.action if self.reset_by is not None else "")
        if reset is None:
            return
        self._reset_at = self._clock.now()
        try:
            self.publisher.publish(reset)
        except PortError as error:
            if str(error) != self._warned_of:
                self._warned_of = str(error)
                _LOG.warning("nothing can be published on %s: %s", self.name, error)
        else:
            self._listeners.note_reset()

    @property
    def trouble(self) -> str:
        return super().trouble or (
            f"the listener of {self.name} {'comes and goes' if self.is_compared else 'has only just been found'}"
        )

    def close(self) -> None:
        self.publisher.close()


class ServiceEndpoint(_ComparedEndpoint):
    """One service of the robot."""

    def _open(self) -> None:
        self.client: ServiceClient = self._transport.client(self._mapping.name, self._mapping.type)

    def poll(self, count: int | None = None) -> bool:
        return self.presence.update(self.client.count_servers() if count is None else count)

    @property
    def others(self) -> object:
        return self.presence.count, self.comparison.programs

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
    """Close endpoints. The owner of the transport may have closed it, and so them, already."""
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
