"""Other sessions on the same ROS network that conflict with this one.

Some use the same names: nodes could not distinguish them, and each would carry out every task. Others use names in
another namespace, but the same robot.

Every session announces itself on the topic `rise/session` (std_msgs/String, latched, JSON): `id`, `since` (nanoseconds
since 1970), `state`, the carriers of its robot, and a description for people. While it serves, it repeats this twice a
second as a sign of life; without it the reference wrapper stops the robot. A new session announces that it is `asking`,
and listens briefly. It gives way to a session that is `serving`, or that began to ask earlier; two sessions that begin
together decide the same. A crashed session is silent, even if the network still shows it.

A serving session continues to listen. It reports a session that appears later (because two networks are joined).
Neither ends: a running study is not given up for an unknown one.
"""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from time import time_ns
from typing import Literal
from uuid import uuid4

import msgspec
from msgspec import Struct

from rise_adapters.ros2.transport.port import Closable, Message, PortError, QoS, Transport

TOPIC, TYPE = "rise/session", "std_msgs/msg/String"
LISTEN_SECONDS = 1.0
"""Seconds to listen for other sessions. Programs on one network find each other within some hundredths of a second."""
LISTEN_LONGER_SECONDS = 1.0
"""Additional seconds if there is a session that has not announced itself."""
SEARCH_SECONDS = 0.1
"""Seconds between two searches for sessions under other names while it listens."""
SEARCH_BEATS = 10
"""The same while it serves, in signs of life."""
BEAT_SECONDS = 0.5
"""Seconds between two signs of life."""
_POLL_SECONDS = 0.02
_MAX_CHARACTERS = 100
_MAX_NAMES = 3
_LOG = logging.getLogger(__name__)

AnnouncedState = Literal["asking", "serving", "over"]


class SessionAnnouncement(Struct, frozen=True, omit_defaults=True):
    """A session's announcement."""

    id: str
    since: int
    state: AnnouncedState
    title: str = ""
    folder: str = ""
    """The name of its folder."""
    node: str = ""
    host: str = ""
    pid: int = 0
    carriers: tuple[str, ...] = ()
    """The full names of the actions and topics that move its robot."""

    def __str__(self) -> str:
        title, folder, node, host = map(_keep_printable, (self.title, self.folder, self.node, self.host))
        what = " ".join(filter(None, [title and f"“{title}”", folder and f"({folder})"]))
        return f"{what or 'a session'}, node {node} on {host}, process {self.pid}"

    @property
    def rank(self) -> tuple[bool, int, str]:
        """The rank of a session. Of two sessions, the one with the smaller rank stays."""
        return self.state != "serving", self.since, self.id


class NeighbourSessions:
    """This session among others. All methods belong to the transport's loop."""

    def __init__(
        self, transport: Transport, me: SessionAnnouncement | None = None, carriers: Iterable[str] = ()
    ) -> None:
        """`me`: the announcement on an earlier connection. `carriers`: names of the robot. Raises PortError."""
        self.on_other_session: Callable[[SessionAnnouncement], object] = _ignore
        """Called with a session that appears while this one is serving."""
        self.announcement = me or SessionAnnouncement(
            uuid4().hex,
            time_ns(),
            "asking",
            host=socket.gethostname(),
            pid=os.getpid(),
            carriers=tuple(sorted({transport.resolve(name) for name in carriers})),
        )
        self._transport = transport
        self._others: dict[str, SessionAnnouncement] = {}
        """The conflicting sessions."""
        self._heard: dict[str, set[str]] = {}
        """The sessions heard on each topic, conflicting or not."""
        self._subscriptions: list[Closable] = []
        self._beats = 0
        self._timer: asyncio.TimerHandle | None = None
        self._publisher = transport.publisher(TOPIC, TYPE, QoS(depth=1, latched=True))
        self._listen_to(transport.resolve(TOPIC))
        self._announce(node=transport.node)

    @property
    def others(self) -> list[SessionAnnouncement]:
        """The conflicting sessions that serve, the oldest first."""
        return sorted((each for each in self._others.values() if each.state == "serving"), key=lambda each: each.rank)

    async def find_earlier(self) -> SessionAnnouncement | None:
        """Listen briefly. Returns the session that this one must give way to, if any."""
        loop = asyncio.get_running_loop()
        until = loop.time() + LISTEN_SECONDS
        at_most = until + LISTEN_LONGER_SECONDS
        next_search = loop.time()
        while loop.time() < (at_most if self._is_someone_silent() else until):
            if loop.time() >= next_search:
                self._listen_elsewhere()
                next_search = loop.time() + SEARCH_SECONDS
            await asyncio.sleep(_POLL_SECONDS)
        first = min([self.announcement, *self._others.values()], key=lambda each: each.rank)
        return None if first is self.announcement else first

    def shared_with(self, other: SessionAnnouncement) -> list[str]:
        """The carriers with which another session moves the same robot under other names; empty: the names are the
        same."""
        if other.id in self._heard[self._transport.resolve(TOPIC)]:
            return []
        return [name for name in self.announcement.carriers if name in other.carriers]

    def announce_serving(self, title: str, folder: str) -> None:
        """Announce that this session uses the names from now on."""
        self._announce(state="serving", title=title, folder=folder)
        for other in self.others:
            self.on_other_session(other)
        self._timer = asyncio.get_running_loop().call_later(BEAT_SECONDS, self._beat)

    def close(self) -> None:
        """Give up the names."""
        if self._timer is not None:
            self._timer.cancel()
        self._announce(state="over")
        for handle in (self._publisher, *self._subscriptions):
            handle.close()

    def _beat(self) -> None:
        """Send a sign of life, and sometimes search for other sessions."""
        if self._transport.failure():
            return  # the next connection sends its own
        self._timer = asyncio.get_running_loop().call_later(BEAT_SECONDS, self._beat)
        self._announce()
        self._beats += 1
        if self._beats % SEARCH_BEATS == 0:
            self._listen_elsewhere()

    def _listen_elsewhere(self) -> None:
        """Also listen to sessions in other namespaces."""
        for topic in self._transport.topics(f"/{TOPIC}"):
            self._listen_to(topic)

    def _listen_to(self, topic: str) -> None:
        """Listen on a topic, given by its full name."""
        if topic not in self._heard:
            self._heard[topic] = set()
            # Deep enough for several sessions: the latest message of each counts.
            qos = QoS(depth=20, latched=True)
            take = partial(self._take_announcement, topic)
            self._subscriptions.append(self._transport.subscribe(topic, TYPE, take, qos))

    def _is_someone_silent(self) -> bool:
        """Whether some possible sessions have not announced themselves."""
        return any(len(self._transport.publisher_endpoints(topic)) > len(ids) for topic, ids in self._heard.items())

    def _announce(self, **changes: str) -> None:
        self.announcement = msgspec.structs.replace(self.announcement, **changes)
        try:
            self._publisher.publish({"data": msgspec.json.encode(self.announcement).decode()})
        except PortError as error:
            _LOG.warning("other sessions cannot be told of this one: %s", error)

    def _take_announcement(self, topic: str, message: Message) -> None:
        try:
            other = msgspec.json.decode(message["data"], type=SessionAnnouncement)
        except (msgspec.MsgspecError, RecursionError):
            _LOG.warning("%s: this is no word of a session: %.200r", TOPIC, message["data"])
            return
        if other.id == self.announcement.id:
            return
        before = self._others.pop(other.id, None)
        self._heard[topic].discard(other.id)
        if other.state == "over":
            return
        self._heard[topic].add(other.id)
        if topic != self._transport.resolve(TOPIC) and not self.shared_with(other):
            return
        self._others[other.id] = other
        new = before is None or before.state != "serving"
        if new and other.state == "serving" and self.announcement.state == "serving":
            self.on_other_session(other)


def describe_refusal(other: SessionAnnouncement, shared: Sequence[str], transport: Transport) -> list[str]:
    """Why a session does not begin, with the remedy. `shared`: the result of `NeighbourSessions.shared_with`."""
    if shared:
        return [
            f"another session moves the same robot ({transport.about}): {other}; both would use {_join_some(shared)}",
            "each would start and stop what the other one does; end that one, or give this one a robot of its own",
        ]
    return [
        f"another session is on ROS under the same names ({transport.about}): {other}",
        "nodes could not tell the two apart, and tasks would be done twice; end that one, or give this one names of "
        "its own: --ros-args -r __ns:=/lab2 (and to its nodes and its robot, too), or another ROS_DOMAIN_ID",
    ]


def describe_other_session(other: SessionAnnouncement, shared: Sequence[str]) -> str:
    """The sentence for the record of a session that finds another one."""
    if shared:
        return f"another session moves the same robot now, by {_join_some(shared)}: {other}. End one of them"
    return (
        f"another session is on ROS under the same names now: {other}; tasks of nodes may be done by both. "
        "End one of them, or give it a namespace"
    )


def _join_some(names: Sequence[str]) -> str:
    more = len(names) - _MAX_NAMES
    return ", ".join(names[:_MAX_NAMES]) + (f" and {more} more" if more > 0 else "")


def _keep_printable(text: str) -> str:
    """Make text from other programs safe for a line on a screen."""
    return "".join(letter for letter in text if letter.isprintable())[:_MAX_CHARACTERS]


def _ignore(other: SessionAnnouncement) -> None:
    """Do nothing: there is no subscriber."""
