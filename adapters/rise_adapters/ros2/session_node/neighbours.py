"""Other sessions on the same ROS network that go by the same names: nodes could not tell them from this one, and a task
would be done by each of them.

Every session says on the topic `rise/session` (std_msgs/String, latched, JSON) who it is: `id`, `since` (nanoseconds
since 1970), `state`, and what a person needs to find it. One that is about to begin says that it is `asking` and
listens for a moment. It stands back when another one is `serving`, or asks and began to ask earlier; of two that begin
at once, both decide the same. A session that has crashed says nothing any more, whatever the network still shows of it.

Afterwards a session goes on listening. One that appears then (two networks that are joined) is reported, and neither
ends: a study that runs is not given up for one that nobody knows.
"""

from __future__ import annotations

import asyncio
import logging
import os
import socket
from collections.abc import Callable
from time import time_ns
from typing import Literal
from uuid import uuid4

import msgspec
from msgspec import Struct

from rise_adapters.ros2.transport.port import Message, PortError, QoS, Transport

TOPIC, TYPE = "rise/session", "std_msgs/msg/String"
LISTEN_SECONDS = 1.0
"""Seconds for which others are listened for; to find each other takes programs on one network some hundredths."""
LISTEN_LONGER_SECONDS = 1.0
"""Seconds more, when there is another one that has not said anything yet."""
_POLL_SECONDS = 0.02
_MAX_CHARACTERS = 100
_LOG = logging.getLogger(__name__)

AnnouncedState = Literal["asking", "serving", "over"]


class SessionAnnouncement(Struct, frozen=True, omit_defaults=True):
    """What a session says about itself."""

    id: str
    since: int
    state: AnnouncedState
    title: str = ""
    folder: str = ""
    """The name of its folder."""
    node: str = ""
    host: str = ""
    pid: int = 0

    def __str__(self) -> str:
        title, folder, node, host = map(_keep_printable, (self.title, self.folder, self.node, self.host))
        what = " ".join(filter(None, [title and f"“{title}”", folder and f"({folder})"]))
        return f"{what or 'a session'}, node {node} on {host}, process {self.pid}"

    @property
    def rank(self) -> tuple[bool, int, str]:
        """Of two sessions, the smaller one stays."""
        return self.state != "serving", self.since, self.id


class NeighbourSessions:
    """This session among others. All methods belong to the transport's loop."""

    def __init__(self, transport: Transport, me: SessionAnnouncement | None = None) -> None:
        """`me`: as it was known on a connection before this one. Raises PortError."""
        self.on_other_session: Callable[[SessionAnnouncement], object] = _ignore
        """Called with a session that appears while this one is serving."""
        self.announcement = me or SessionAnnouncement(
            uuid4().hex, time_ns(), "asking", host=socket.gethostname(), pid=os.getpid()
        )
        self._transport = transport
        self._others: dict[str, SessionAnnouncement] = {}
        qos = QoS(depth=1, latched=True)
        self._publisher = transport.publisher(TOPIC, TYPE, qos)
        # As deep as there may be others: of each the latest counts.
        self._subscription = transport.subscribe(TOPIC, TYPE, self._take_announcement, QoS(depth=20, latched=True))
        self._announce(node=transport.node)

    @property
    def others(self) -> list[SessionAnnouncement]:
        """Those that serve under these names, the oldest first."""
        return sorted((each for each in self._others.values() if each.state == "serving"), key=lambda each: each.rank)

    async def find_earlier(self) -> SessionAnnouncement | None:
        """Listen for a moment; gives the session that this one has to stand back for, if there is one."""
        loop = asyncio.get_running_loop()
        until = loop.time() + LISTEN_SECONDS
        at_most = until + LISTEN_LONGER_SECONDS
        while loop.time() < (at_most if self._is_someone_silent() else until):  # noqa: ASYNC110  # a graph tells nobody of changes
            await asyncio.sleep(_POLL_SECONDS)
        first = min([self.announcement, *self._others.values()], key=lambda each: each.rank)
        return None if first is self.announcement else first

    def announce_serving(self, title: str, folder: str) -> None:
        """From now on the names are this session's."""
        self._announce(state="serving", title=title, folder=folder)
        for other in self.others:
            self.on_other_session(other)

    def close(self) -> None:
        """Leave the names to others."""
        self._announce(state="over")
        for handle in (self._publisher, self._subscription):
            handle.close()

    def _is_someone_silent(self) -> bool:
        """Whether there are more who may speak than have."""
        return len(self._transport.publisher_endpoints(TOPIC)) > len(self._others)

    def _announce(self, **changes: str) -> None:
        self.announcement = msgspec.structs.replace(self.announcement, **changes)
        try:
            self._publisher.publish({"data": msgspec.json.encode(self.announcement).decode()})
        except PortError as error:
            _LOG.warning("other sessions cannot be told of this one: %s", error)

    def _take_announcement(self, message: Message) -> None:
        try:
            other = msgspec.json.decode(message["data"], type=SessionAnnouncement)
        except (msgspec.MsgspecError, RecursionError):
            _LOG.warning("%s: this is no word of a session: %.200r", TOPIC, message["data"])
            return
        if other.id == self.announcement.id:
            return
        before = self._others.pop(other.id, None)
        if other.state == "over":
            return
        self._others[other.id] = other
        new = before is None or before.state != "serving"
        if new and other.state == "serving" and self.announcement.state == "serving":
            self.on_other_session(other)


def describe_refusal(other: SessionAnnouncement, transport: Transport) -> list[str]:
    """Why a session does not begin, and what to do."""
    return [
        f"another session is on ROS under the same names ({transport.about}): {other}",
        "nodes could not tell the two apart, and tasks would be done twice; end that one, or give this one names of "
        "its own: --ros-args -r __ns:=/lab2 (and to its nodes and its robot, too), or another ROS_DOMAIN_ID",
    ]


def describe_other_session(other: SessionAnnouncement) -> str:
    """For the record of a session that finds that it is not alone."""
    return (
        f"another session is on ROS under the same names now: {other}; tasks of nodes may be done by both. "
        "End one of them, or give it a namespace"
    )


def _keep_printable(text: str) -> str:
    """What others say of themselves, fit for a line on a screen."""
    return "".join(letter for letter in text if letter.isprintable())[:_MAX_CHARACTERS]


def _ignore(other: SessionAnnouncement) -> None:
    """Nobody wants to know."""
