"""One connection to a session's socket: whole lines in, and bytes out that nobody waits for. Knows no session."""

from __future__ import annotations

import asyncio
import socket
import struct
import sys
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from typing import Protocol, cast

from rise_engine.run.protocol.messages import MAX_LINE_BYTES

PIECE = 65_536
"""Bytes that are given to the system at once."""
LINGER_SECONDS = 2.0
"""For which a last line may wait to be read."""
URGENT = b'"stopAll"'
URGENT_WITHIN = 256
"""A line that has this text within so many bytes is taken before those of others."""


class ConnectionOwner(Protocol):
    """Learns what happens on its connections."""

    def connection_opened(self, connection: ClientConnection) -> None:
        """It is there, and has sent nothing yet."""
        ...

    def line_arrived(self, connection: ClientConnection, *, urgent: bool) -> None:
        """It has a whole line, after it had none; `take_line` gives it. Nothing more is read until all are taken."""
        ...

    def connection_drained(self, connection: ClientConnection) -> None:
        """It can be sent more, after it was full."""
        ...

    def connection_closed(self, connection: ClientConnection) -> None:
        """It has ended. Nothing more is reported about it."""
        ...


class ClientConnection(asyncio.Protocol):
    """One connection, from its opening to its end."""

    def __init__(self, owner: ConnectionOwner) -> None:
        self._owner = owner
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport
        self.opened_at = self._loop.time()
        self.user: int | None = None
        """The user at the other end, where the system tells."""
        self.closing = False
        """It has been sent its last line, or is cut: nothing more is taken from it or sent."""
        self.full = False
        """What was sent last has not left yet."""
        self._partial = bytearray()
        self._lines: deque[bytes] = deque()
        self._eof = False
        self._queue: deque[bytes] = deque()
        self._holding = False
        self._linger: asyncio.TimerHandle | None = None
        self.waiting = 0
        """Bytes that wait to be sent."""

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
        """End this connection with a last line, if any, after all that waits; but what is held back is dropped."""
        if self.closing:
            return
        self.closing = True
        if self._holding:
            self._holding = False
            self._clear_queue()
        if last:
            self._write(last)
        with suppress(RuntimeError):
            self._transport.pause_reading()
        self._linger = self._loop.call_later(LINGER_SECONDS, self.abort)
        if not self._queue:
            self._transport.close()

    def abort(self) -> None:
        """Cut the connection."""
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
            lines = [bytes(self._partial)]  # too long as it is: whoever takes it sees that
            self._partial.clear()
        self._lines.extend(lines)
        with suppress(RuntimeError):
            self._transport.pause_reading()  # what it writes now waits with itself
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
        """The next line, without its end, while `has_line`. It may be longer than MAX_LINE_BYTES."""
        line = self._lines.popleft()
        if not self._lines:
            if self._eof:
                self._loop.call_soon(self._transport.close)  # what comes of this line at once still leaves
            else:
                self._transport.resume_reading()
        return line

    # --- out ----------------------------------------------------------------------------------------------------

    def send(self, pieces: Iterable[bytes]) -> None:
        """Send these, of which none is longer than PIECE, as soon as the client takes them."""
        if not self.closing and not self._transport.is_closing():
            for piece in pieces:
                self._write(piece)

    def hold_back(self) -> None:
        """From now on let what is sent wait until `release`; only `send_first` goes before it."""
        self._holding = True

    def send_first(self, data: bytes) -> None:
        """Send this before all that is held back. Not while the connection is `full`."""
        if not self._transport.is_closing():  # it has vanished, and its end is on its way
            self._transport.write(data)

    def release(self) -> None:
        """Send what was held back."""
        self._holding = False
        self._send_waiting()

    def _write(self, data: bytes) -> None:
        if self.full or self._holding or self._queue:
            self._queue.append(data)
            self.waiting += len(data)
        else:
            self._transport.write(data)

    def pause_writing(self) -> None:
        self.full = True

    def resume_writing(self) -> None:
        # The transport calls this in the middle of a write of its own. Whoever writes or closes now, and fails, has its
        # connection_lost called twice by asyncio, the second time on nothing: so it is done in the next turn.
        self.full = False
        self._loop.call_soon(self._send_after_full)

    def _send_after_full(self) -> None:
        if self.full or self._transport.is_closing():
            return
        if not self._holding:
            self._send_waiting()
        if not (self.full or self.closing):
            self._owner.connection_drained(self)

    def _send_waiting(self) -> None:
        queue = self._queue
        while queue and not self.full and not self._transport.is_closing():
            pieces = [queue.popleft()]
            size = len(pieces[0])
            while queue and size + len(queue[0]) <= PIECE:
                pieces.append(queue.popleft())
                size += len(pieces[-1])
            self.waiting -= size
            self._transport.write(b"".join(pieces))
        if self.closing and not queue:
            self._transport.close()

    def _clear_queue(self) -> None:
        self._queue.clear()
        self.waiting = 0


def split_into_pieces(data: bytes) -> list[bytes]:
    """The data in pieces as `ClientConnection.send` takes them."""
    return [data[at : at + PIECE] for at in range(0, len(data), PIECE)]


def _user_of(connected: socket.socket) -> int | None:
    """The number of the user whose program is at the other end; None where the system does not tell."""
    if sys.platform == "darwin":
        # struct xucred {u_int version; uid_t uid; ...}, by getsockopt(SOL_LOCAL, LOCAL_PEERCRED)
        return int(struct.unpack("=II", connected.getsockopt(0, 1, 76)[:8])[1])
    if hasattr(socket, "SO_PEERCRED"):
        return int(struct.unpack("3i", connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[1])
    return None
