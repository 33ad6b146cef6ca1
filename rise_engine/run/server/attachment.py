"""What an attached client is sent: first the state, then records and replies, and never more than it takes."""

from __future__ import annotations

import asyncio
import logging
from collections import deque
from collections.abc import Iterator

from rise_engine.kernel.task_view import TaskView
from rise_engine.run.protocol.messages import ReadyMessage, TasksMessage, encode_line
from rise_engine.run.server.connection import ClientConnection, split_into_pieces
from rise_engine.run.server.hub import AttachedClient

_LOG = logging.getLogger(__name__)

STATE_SECONDS = 10.0
"""For which a client in all may keep the pieces of the state waiting."""
BACKLOG = 524_288
"""Bytes that may wait for one client."""
ARRIVAL_BACKLOG = 8_388_608
"""The same while it is still getting the state."""
BEHIND_SECONDS = 10.0
"""For which a client may leave what waits for it, before it is cut off also if it would take the state anew."""


class Attachment:
    """One attached client's share of what is sent. What happens while it gets the state waits in its connection."""

    def __init__(self, connection: ClientConnection, client: AttachedClient, *, resyncs: bool) -> None:
        """`resyncs`: when it lies too far behind it takes the state anew; otherwise it is cut off."""
        self.connection = connection
        self.client = client
        self.unanswered = 0
        """Its messages that are not answered yet."""
        self.getting_state = False
        self.missed_tasks: set[int] | None = None
        """Set while it lies so far behind that it gets no records: the tasks that have changed meanwhile."""
        self._resyncs = resyncs
        self._loop = asyncio.get_running_loop()
        self._backlog = ARRIVAL_BACKLOG
        self._waiting_when_missed = 0
        self._patience = STATE_SECONDS
        self._stalled_at = 0.0
        self._pieces: deque[bytes] = deque()
        self._task_portions: Iterator[list[TaskView]] = iter(())
        self._stall_timer: asyncio.TimerHandle | None = None
        self._behind_timer: asyncio.TimerHandle | None = None

    @property
    def has_caught_up(self) -> bool:
        """It lay behind, and has taken all that waited for it: the state is to be sent anew."""
        connection = self.connection
        waits = self.getting_state or connection.waiting or connection.full or connection.closing
        return self.missed_tasks is not None and not waits

    def close(self) -> None:
        """Its connection has ended."""
        self._cancel_timers()
        self._pieces.clear()
        self._task_portions = iter(())

    def send(self, pieces: list[bytes]) -> None:
        """Send records. One who leaves too much waiting gets no more (`missed`), or is cut off."""
        self._send_within(self._backlog, pieces)
        connection = self.connection
        if self._resyncs and connection.waiting > self._backlog and not connection.closing:
            self.missed_tasks = set()  # from the next record on
            self._waiting_when_missed = connection.waiting
            self._behind_timer = self._loop.call_later(BEHIND_SECONDS, self._cut_off)

    def send_replies(self, data: bytes) -> None:
        """Send replies, also to one who gets no records."""
        limit = self._backlog
        if self._resyncs:
            limit += max(self._backlog, self._waiting_when_missed)
        self._send_within(limit, split_into_pieces(data))

    def _send_within(self, limit: int, pieces: list[bytes]) -> None:
        if self.connection.waiting > limit:
            self._cut_off()
        self.connection.send(pieces)

    def _cut_off(self) -> None:
        if not self.connection.closing:
            _LOG.info("%s was dropped: it does not read", self.client.name)
            self.connection.abort()

    # --- the state ----------------------------------------------------------------------------------------------

    def begin_state(self, first: bytes, task_portions: Iterator[list[TaskView]]) -> None:
        """Send the state at this moment: `first` at once, then the other tasks, by `send_state`."""
        self._cancel_timers()
        self.missed_tasks = None
        self.getting_state = True
        self._waiting_when_missed = 0
        self._backlog, self._patience = ARRIVAL_BACKLOG, STATE_SECONDS
        self._pieces.extend(split_into_pieces(first))
        self._task_portions = task_portions
        self.connection.hold_back()

    def send_state(self) -> bool:
        """Send one portion of it, or as much as the client takes; gives whether more can be sent now."""
        connection = self.connection
        if connection.closing:
            return False
        if not self._pieces:
            portion = next(self._task_portions, None)
            if portion is None:
                self._end_state()
                return False
            self._pieces.extend(split_into_pieces(encode_line(TasksMessage(portion))))
        while self._pieces and not connection.full:
            connection.send_first(self._pieces.popleft())
        if connection.full:
            self._stalled_at = self._loop.time()
            self._stall_timer = self._loop.call_later(self._patience, connection.abort)
        return not connection.full

    def _end_state(self) -> None:
        self.getting_state = False
        self.connection.send_first(encode_line(ReadyMessage()))
        self.connection.release()
        self.resume()

    def resume(self) -> None:
        """The connection takes more, after it was full."""
        if self.getting_state:
            self._patience -= self._loop.time() - self._stalled_at
            if self._stall_timer is not None:
                self._stall_timer.cancel()
        elif not self.connection.waiting:
            self._backlog = BACKLOG

    def _cancel_timers(self) -> None:
        for timer in (self._stall_timer, self._behind_timer):
            if timer is not None:
                timer.cancel()
