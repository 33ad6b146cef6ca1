"""One connection to a session's socket: whole lines in, and bytes out. The engine never waits for it.

An attaching client first gets the state, piece by piece. Later updates wait behind it. A client with too much waiting
data is cut. It can attach again, and then gets the present state.
"""

from __future__ import annotations

import asyncio
import logging
import socket
import struct
import sys
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import suppress
from typing import Protocol, cast

from rise_engine.run.protocol.messages import MAX_LINE_BYTES, RefusedMessage, encode_line
from rise_engine.run.server.hub import AttachedClient

_LOG = logging.getLogger(__name__)

PIECE = 65_536
"""Bytes given to the system at once."""
STATE_PIECES = 4
"""Pieces of the state that one client gets in one turn of the loop."""
BACKLOG = 524_288
"""Maximum bytes that wait for one client."""
ARRIVAL_BACKLOG = 8_388_608
"""The same until it has received the state and the updates behind it."""
STALL_SECONDS = 10.0
"""Time after which a client that does not read its waiting data is cut."""
_BEHIND = encode_line(RefusedMessage("this client fell too far behind the session: attach again"))
LINGER_SECONDS = 2.0
"""Maximum time that a last line waits to be read."""
URGENT = b'"stopAll"'
URGENT_WITHIN = 256
"""A line with this text within so many bytes is handled before those of other clients."""


class ConnectionOwner(Protocol):
    """The owner of connections, which handles their events."""

    def connection_opened(self, connection: ClientConnection) -> None:
        """Handle a new connection, which has sent nothing yet."""
        ...

    def line_arrived(self, connection: ClientConnection, *, urgent: bool) -> None:
        """Handle the first waiting line (`take_line` returns it). Reading continues when all lines are taken."""
        ...

    def connection_closed(self, connection: ClientConnection) -> None:
        """Handle the end of a connection, its last event."""
        ...


class ClientConnection(asyncio.Protocol):
    """One connection, from its opening to its end."""

    def __init__(self, owner: ConnectionOwner) -> None:
        self._owner = owner
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport
        self.opened_at = self._loop.time()
        self.client: AttachedClient | None = None
        """Set once it has attached."""
        self.unanswered = 0
        """The number of its unanswered messages."""
        self.user: int | None = None
        """The user at the other end, if the system tells."""
        self.closing = False
        """Whether its last line was sent, or it was cut. It is neither read nor written any more."""
        self._partial = bytearray()
        self._lines: deque[bytes] = deque()
        self._eof = False
        self._full_since: float | None = None
        """Since when the last data has been waiting, by the loop's clock."""
        self._state: Iterator[bytes] | None = None
        self._queue: deque[bytes] = deque()
        self._backlog = BACKLOG
        self._linger: asyncio.TimerHandle | None = None
        self.waiting = 0
        """Bytes in the queue."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._transport.set_write_buffer_limits(high=0)
        self.user = _user_of(transport.get_extra_info("socket"))
        self._owner.connection_opened(self)

    def connection_lost(self, error: Exception | None) -> None:
        self.closing = True
        if self._linger is not None:
            self._linger.cancel()
        self._clear_queue()
        self._lines.clear()
        self._partial.clear()
        self._owner.connection_closed(self)

    def finish(self, last: bytes) -> None:
        """End this connection with a last line, if any, after all waiting data. The rest of the state is dropped."""
        if self.closing:
            return
        if self._state is not None:
            self._clear_queue()
        if last:
            self._write(last)
        self.closing = True
        with suppress(RuntimeError):
            self._transport.pause_reading()
        self._linger = self._loop.call_later(LINGER_SECONDS, self.abort)
        if not self._queue:
            self._transport.close()

    def abort(self) -> None:
        """Cut the connection."""
        if self.client is not None and not self.closing:
            _LOG.info("%s was cut: it does not read", self.client.name)
        self.closing = True
        self._clear_queue()
        self._transport.abort()

    # --- in -----------------------------------------------------------------------------------------------------

    def data_received(self, data: bytes) -> None:
        if self.closing:
            return
        *lines, rest = data.split(b"\n")
        if lines:
            lines[0] = bytes(self._partial) + lines[0]
            self._partial = bytearray(rest)
        else:
            self._partial += rest
            if len(self._partial) <= MAX_LINE_BYTES:
                return
            lines = [bytes(self._partial)]  # too long: its owner checks the length
            self._partial.clear()
        self._lines.extend(lines)
        with suppress(RuntimeError):
            self._transport.pause_reading()  # further data waits on the client's side
        self._owner.line_arrived(self, urgent=URGENT in lines[0][:URGENT_WITHIN])

    def eof_received(self) -> bool:
        self._eof = True
        if not self._lines and not self.closing:
            self._transport.close()
        return True

    @property
    def has_line(self) -> bool:
        """Whether `take_line` has a line to give."""
        return bool(self._lines) and not self.closing

    def take_line(self) -> bytes:
        """Return the next line, without its end, while `has_line`. It may be longer than MAX_LINE_BYTES."""
        line = self._lines.popleft()
        if not self._lines:
            if self._eof:
                self._loop.call_soon(self._transport.close)  # after the immediate reply to this line
            else:
                self._transport.resume_reading()
        return line

    # --- out ----------------------------------------------------------------------------------------------------

    @property
    def is_stalled(self) -> bool:
        """Whether it has read nothing for too long."""
        return self._full_since is not None and self._loop.time() > self._full_since + STALL_SECONDS

    def send_state(self, pieces: Iterator[bytes]) -> None:
        """Send these pieces first, a few in each turn of the loop, and make each one only when it can be sent."""
        self._state = pieces
        self._backlog = ARRIVAL_BACKLOG
        self._send_waiting()

    def send(self, pieces: Iterable[bytes]) -> None:
        """Send pieces of at most PIECE bytes when the client reads; cut a client that is too far behind."""
        if self.closing or self._transport.is_closing():
            return
        if self.waiting > self._backlog:
            if self._state is None:
                self.finish(_BEHIND)  # a client that still reads learns immediately to attach again
            else:
                self.abort()
            return
        for piece in pieces:
            self._write(piece)

    def _write(self, data: bytes) -> None:
        if self._full_since is not None or self._state is not None or self._queue:
            self._queue.append(data)
            self.waiting += len(data)
        else:
            self._transport.write(data)

    def pause_writing(self) -> None:
        self._full_since = self._loop.time()

    def resume_writing(self) -> None:
        # The transport calls this during its own write. If a write or close failed here, asyncio would call
        # connection_lost twice, which fails. So the rest is sent in the next turn.
        self._full_since = None
        self._loop.call_soon(self._send_waiting)

    def _send_waiting(self) -> None:
        if self._full_since is not None or self._transport.is_closing():
            return
        if self._state is not None:
            self._send_pieces(self._state)
            if self._full_since is None:
                self._loop.call_soon(self._send_waiting)
            return
        self._send_queue()
        if not self._queue:
            self._backlog = BACKLOG
            if self.closing:
                self._transport.close()

    def _send_pieces(self, state: Iterator[bytes]) -> None:
        for _ in range(STATE_PIECES):
            piece = next(state, b"")
            if not piece:
                self._state = None
                return
            self._transport.write(piece)
            if self._full_since is not None or self._transport.is_closing():
                return

    def _send_queue(self) -> None:
        queue = self._queue
        while queue and self._full_since is None and not self._transport.is_closing():
            pieces = [queue.popleft()]
            size = len(pieces[0])
            while queue and size + len(queue[0]) <= PIECE:
                pieces.append(queue.popleft())
                size += len(pieces[-1])
            self.waiting -= size
            self._transport.write(b"".join(pieces))

    def _clear_queue(self) -> None:
        self._state = None
        self._queue.clear()
        self.waiting = 0


def split_into_pieces(data: bytes) -> list[bytes]:
    """Split data into pieces for `ClientConnection.send`."""
    return [data[at : at + PIECE] for at in range(0, len(data), PIECE)]


def _user_of(connected: socket.socket) -> int | None:
    """Return the id of the user whose program is at the other end; None if the system does not tell."""
    if sys.platform == "darwin":
        # struct xucred {u_int version; uid_t uid; ...}, by getsockopt(SOL_LOCAL, LOCAL_PEERCRED)
        return int(struct.unpack("=II", connected.getsockopt(0, 1, 76)[:8])[1])
    if hasattr(socket, "SO_PEERCRED"):
        return int(struct.unpack("3i", connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[1])
    return None
