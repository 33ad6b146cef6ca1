"""One connection to a session's socket: lines in, one at a time; the state and what follows out, never waited for."""

from __future__ import annotations

import asyncio
import logging
import socket
import struct
import sys
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, cast

from rise_engine.kernel.inputs import Submit
from rise_engine.link.client import Reply
from rise_engine.link.early import Early
from rise_engine.link.messages import (
    LINE_LIMIT,
    MESSAGE_LIMIT,
    VERSION,
    About,
    Answer,
    AskAbout,
    Attach,
    Control,
    End,
    Ended,
    Ready,
    Refused,
    Send,
    Tasks,
    from_client,
    line,
)
from rise_engine.link.room import Member, NotAdmitted
from rise_engine.view import TaskView

if TYPE_CHECKING:
    from rise_engine.link.server import Server

_LOG = logging.getLogger(__name__)

MAX_CLIENTS = 200
MAX_OPEN = 256
"""Messages of one client that are not answered yet."""
ATTACH_SECONDS = 5.0
"""Within which a connection has to say who it is."""
STATE_SECONDS = 10.0
"""For which a client in all may keep the pieces of the state waiting."""
BACKLOG = 524_288
"""Bytes that may wait for one client."""
ARRIVAL_BACKLOG = 8_388_608
"""The same while it is still getting the state."""
PIECE = 65_536
"""Bytes that are given to the system at once."""
BEHIND_SECONDS = 10.0
"""For which a client may leave what waits for it, before it is cut off also if it would take the state anew."""
LINGER_SECONDS = 2.0
"""For which a last line may wait to be read."""


class Peer(asyncio.BufferedProtocol):
    """One connection."""

    def __init__(self, server: Server) -> None:
        self.server = server
        self.member: Member | None = None
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport
        # In:
        self._in = bytearray()
        self._start = 0
        """Where the next line begins."""
        self._searched = 0
        """Up to where there is no line end."""
        self._queued = False
        """It has a whole line and waits for its turn."""
        self._paused = False
        """Nothing more of it is read."""
        self._eof = False
        self._closing = False
        self._unanswered = 0
        # Out:
        self._full = False
        self._queue: deque[bytes] = deque()
        self._waiting = 0
        self._backlog = ARRIVAL_BACKLOG
        self._answers: list[bytes] = []
        self._early: Early | None = None
        """An answer that may leave without a turn of the loop, until that is where it is given."""
        self._held: Early | None = None
        """The same while it is not known how much of it has left: nothing else can be sent before."""
        self._resyncs = False
        """It takes the state anew when it lies too far behind."""
        self.behind: set[int] | None = None
        """It does, and no records are kept for it: the tasks that have changed meanwhile."""
        self._arriving = False
        self._pieces: deque[bytes] = deque()
        self._portions: Iterator[list[TaskView]] = iter(())
        self._patience = STATE_SECONDS
        self._full_since = 0.0
        self._timer: asyncio.TimerHandle | None = None
        self._behind_timer: asyncio.TimerHandle | None = None

    @property
    def idle(self) -> bool:
        """Whether it has not said who it is."""
        return self.member is None and not self._closing

    # --- the connection -----------------------------------------------------------------------------------------

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        self._transport.set_write_buffer_limits(high=0)
        server = self.server
        server.peers[self] = None
        user = _user_of(transport.get_extra_info("socket"))
        if user is not None and user not in server.allowed:
            self.refuse("this session belongs to another user")
        elif len(server.peers) > MAX_CLIENTS and not server.make_room(self):
            self.refuse(f"{MAX_CLIENTS} clients are connected to this session already")
        else:
            self._timer = self._loop.call_later(
                ATTACH_SECONDS, self.refuse, f"you have not attached within {ATTACH_SECONDS:g} seconds"
            )

    def connection_lost(self, error: Exception | None) -> None:
        self._closing = True
        self._stop_timers()
        for early in (self._early, self._held):
            if early is not None:
                early.close()
        self._queue.clear()
        self._pieces.clear()
        self._in.clear()
        self.server.lost(self)

    def refuse(self, reason: str) -> None:
        """End this connection with a sentence."""
        self.finish(Refused(reason))

    def finish(self, last: Refused | Ended | About | None) -> None:
        """End this connection with a last line, after all that waits."""
        if self._closing:
            return
        self._closing = True
        self.server.forget(self)
        self._stop_timers()
        if self._arriving:  # what has come meanwhile is of no use without the state
            self._arriving = False
            self._pieces.clear()
            self._queue.clear()
        if last is not None:
            self._write(line(last))
        with suppress(RuntimeError):
            self._transport.pause_reading()
        self._timer = self._loop.call_later(LINGER_SECONDS, self.abort)
        if not self._queue and self._held is None:
            self._transport.close()

    def _stop_timers(self) -> None:
        for timer in (self._timer, self._behind_timer):
            if timer is not None:
                timer.cancel()

    def abort(self) -> None:
        """Cut the connection."""
        self._closing = True
        self.server.forget(self)
        self._queue.clear()
        self._transport.abort()

    # --- in -----------------------------------------------------------------------------------------------------

    def get_buffer(self, sizehint: int) -> memoryview:
        return self.server.buffer  # one for all: what arrives in it is taken before anything else is read

    def buffer_updated(self, nbytes: int) -> None:
        if self._closing:
            return
        self._in += self.server.buffer[:nbytes]
        self._look_for_line(arrived=True)

    def eof_received(self) -> bool:
        self._eof = True
        if not self._queued and not self._closing:
            self._transport.close()
        return True

    def _look_for_line(self, *, arrived: bool = False) -> None:
        if self._in.find(b"\n", self._searched) >= 0:
            if arrived and self.server.at_leisure():  # the usual case: nobody waits, and this is all that it says
                self.server.turn_taken(self.take_turn())
                return
            self._queued = True
            if not self._paused:
                self._paused = True
                with suppress(RuntimeError):
                    self._transport.pause_reading()  # what it writes now waits with itself
            # Whoever waits with a stop-all is not kept behind others who wait with long messages.
            self.server.has_line(self, first=arrived and b'"stopAll"' in self._in[self._start : self._start + 256])
            return
        self._searched = len(self._in)
        if self._searched - self._start > LINE_LIMIT:
            self.refuse(f"a line has more than {LINE_LIMIT:,} bytes")
        elif self._eof:
            self._transport.close()
        else:
            del self._in[: self._start]
            self._searched -= self._start
            self._start = 0
            if self._paused:
                self._paused = False
                self._transport.resume_reading()

    def take_turn(self) -> int:
        """Take one line; gives its length."""
        self._queued = False
        if self._closing:
            return 0
        end = self._in.index(b"\n", self._searched)
        data = bytes(self._in[self._start : end])
        self._start = self._searched = end + 1
        if self._start > PIECE:
            del self._in[: self._start]
            self._start = self._searched = 0
        try:
            if len(data) > LINE_LIMIT:
                self.refuse(f"a line has more than {LINE_LIMIT:,} bytes")
            else:
                self._take(data)
        except Exception:  # the engine's own failure ends the session; nothing else may hurt other clients
            _LOG.exception("a client's message failed")
            self.refuse("this message could not be handled; the engine's log says why")
        if not self._closing:
            self._look_for_line()
        return len(data)

    def _take(self, data: bytes) -> None:
        try:
            message = from_client(data)
        except ValueError as problem:
            self.refuse(str(problem))
            return
        member, room = self.member, self.server.room
        room.engine.catch_up()  # whoever has been answered early finds that everybody knows of it
        if self._closing:  # it took too little of that
            return
        match message:
            case Attach():
                self._attach(message)
            case AskAbout():
                self.finish(self.server.about())
            case _ if member is None:
                self.refuse("attach first")
            case Send() if len(data) > MESSAGE_LIMIT:
                self._answer(message.id, Reply(False, f"a message may have {MESSAGE_LIMIT:,} bytes at most"))
            case Send(message=input) if self._unanswered >= MAX_OPEN and not _is_stop(input):
                self._answer(message.id, Reply(False, f"{MAX_OPEN} of your messages are not answered yet; wait"))
            case Send():
                self._unanswered += 1
                answer = partial(self._answered, message.id)
                room.send(member, message.message, answer)
                if self._clear:
                    self.server.hasten(self, message.id, answer)
            case Control():
                self._unanswered += 1
                room.control(member, message.verb, partial(self._answered, message.id))
            case End():
                room.end(member, message.reason, partial(self._answer, message.id))

    def _attach(self, message: Attach) -> None:
        if message.version != VERSION:
            self.refuse(
                f"this session speaks version {VERSION} of the protocol, and you speak version {message.version}; "
                "use the same release of rise-tui for both"
            )
        elif self.member is not None:
            self.refuse("you are attached already")
        else:
            try:
                self.member = self.server.admit(self, message.name, message.role)
            except NotAdmitted as problem:
                self.refuse(str(problem))
                return
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
            self._resyncs = message.resync
            self._begin_state(*self.server.state_for(self.member, scenario=message.scenario))

    def _answered(self, id: int, reply: Reply) -> None:
        self._unanswered -= 1
        self._answer(id, reply)

    def _answer(self, id: int, reply: Reply) -> None:
        early = self._early
        if early is not None and early.id == id:
            self._early = None
            if self._has_left(early):
                return
        if not self._closing:
            self._answers.append(line(Answer(id, reply.accepted, reply.reason, reply.task)))
            self.server.has_answer(self)

    # --- out ----------------------------------------------------------------------------------------------------

    def send_answers(self) -> None:
        if self._answers:
            self._push([self.take_answers()], 2 * self._backlog if self._resyncs else self._backlog)

    def take_answers(self) -> bytes:
        answers, self._answers = self._answers, []
        return b"".join(answers)

    @property
    def _clear(self) -> bool:
        """Nothing waits to be sent."""
        waits = self._full or self._arriving or self._queue or self._closing or self._early or self._held
        return not waits and self.behind is None and self._transport.get_write_buffer_size() == 0

    def early(self, id: int, records: int, data: bytes) -> Early:
        """Its next bytes, for whoever is first to send them. Only while nothing else waits for it."""
        self._early = Early(self._transport, id, records, data)
        return self._early

    def _has_left(self, early: Early) -> bool:
        """Whether it has, or is leaving now; if not, it goes the usual way."""
        if not early.left():
            return False
        if self._held is None:
            self._finish(early)
        return True

    def _finish(self, early: Early) -> None:
        if early.finish():
            self._held = None
            self._send_waiting()
        else:
            self._held = early
            self._loop.call_soon(self._finish, early)

    def push(self, pieces: list[bytes], *, answers: bool = False) -> None:
        """Send these pieces of a line when the client takes them, `answers`: with its answers.

        A client for whom too much waits gets the state anew once it has taken that, or is dropped.
        """
        if answers:
            pieces = [*pieces[:-1], pieces[-1] + self.take_answers()]
        self._push(pieces, self._backlog)
        if self._resyncs and self._waiting > self._backlog and not self._closing:
            self._fall_behind()  # from the next record on

    def _push(self, pieces: list[bytes], most: int) -> None:
        if self._closing or self._transport.is_closing():
            return
        if self._waiting > most:
            self._drop()
            return
        for piece in pieces:
            self._write(piece)

    def _drop(self) -> None:
        _LOG.info("%s was dropped: it does not read", self.member.name if self.member else "a client")
        self.abort()

    def _fall_behind(self) -> None:
        self.behind = set()
        self.server.left_behind(self)
        self._behind_timer = self._loop.call_later(BEHIND_SECONDS, self._drop)

    def _catch_up(self) -> None:
        """It has taken all that waited: from here on it is sent everything again, and before it the state."""
        if self._closing or self.behind is None or self._queue or self._full or self._held is not None:
            return
        self._stop_timers()
        changed, self.behind = self.behind, None
        assert self.member is not None
        self._backlog, self._patience = ARRIVAL_BACKLOG, STATE_SECONDS
        self._begin_state(*self.server.state_again(self, self.member, changed))

    def _write(self, data: bytes) -> None:
        if self._early is not None:
            self._has_left(self._early)
        if self._full or self._arriving or self._queue or self._held is not None:
            self._queue.append(data)
            self._waiting += len(data)
        else:
            self._transport.write(data)

    def pause_writing(self) -> None:
        self._full = True

    def resume_writing(self) -> None:
        # The transport calls this in the middle of a write of its own. Whoever writes or closes now, and fails, has its
        # connection_lost called twice by asyncio, the second time on nothing: so it is done in the next turn.
        self._full = False
        self._loop.call_soon(self._go_on)

    def _go_on(self) -> None:
        if self._full or self._transport.is_closing():
            return
        if self._closing or not self._arriving:
            self._send_waiting()
        else:
            self._go_on_with_state()

    def _send_waiting(self) -> None:
        queue = self._queue
        while queue and not self._full and self._held is None and not self._transport.is_closing():
            piece = [queue.popleft()]
            size = len(piece[0])
            while queue and size + len(queue[0]) <= PIECE:
                piece.append(queue.popleft())
                size += len(piece[-1])
            self._waiting -= size
            self._transport.write(b"".join(piece))
        if not queue:
            self._backlog = BACKLOG
            if self._closing:
                self._transport.close()
            elif self.behind is not None:
                self._loop.call_soon(self._catch_up)

    # --- the state for somebody who has just come; what happens meanwhile waits in the queue ---------------------

    def _begin_state(self, first: bytes, portions: Iterator[list[TaskView]]) -> None:
        self._arriving = True
        self._pieces.extend(in_pieces(first))
        self._portions = portions
        self.server.has_state(self)

    def send_state(self) -> None:
        """One portion of it, or as much as the client takes."""
        if self._closing:
            return
        pieces = self._pieces
        if not pieces:
            portion = next(self._portions, None)
            if portion is None:
                self._arriving = False
                self._queue.appendleft(line(Ready()))
                self._waiting += len(self._queue[0])
                self._send_waiting()
                return
            pieces.extend(in_pieces(line(Tasks(portion))))
        while pieces and not self._full:
            if self._transport.is_closing():  # it has vanished, and connection_lost is on its way
                return
            self._transport.write(pieces.popleft())
        if self._full:
            self._full_since = self._loop.time()
            self._timer = self._loop.call_later(self._patience, self.abort)
        else:
            self.server.has_state(self)

    def _go_on_with_state(self) -> None:
        self._patience -= self._loop.time() - self._full_since
        if self._timer is not None:
            self._timer.cancel()
        self.server.has_state(self)


def in_pieces(data: bytes) -> list[bytes]:
    return [data[at : at + PIECE] for at in range(0, len(data), PIECE)]


def _is_stop(message: object) -> bool:
    return isinstance(message, Submit) and message.function == "stopAll"


def _user_of(connected: socket.socket) -> int | None:
    """The user at the other end, where the system tells."""
    if sys.platform == "darwin":
        # struct xucred {u_int version; uid_t uid; ...}, by getsockopt(SOL_LOCAL, LOCAL_PEERCRED)
        return int(struct.unpack("=II", connected.getsockopt(0, 1, 76)[:8])[1])
    if hasattr(socket, "SO_PEERCRED"):
        return int(struct.unpack("3i", connected.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[1])
    return None
