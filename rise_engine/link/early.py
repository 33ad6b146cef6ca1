"""An answer that leaves as soon as it may: on the journal's thread, when that comes back from the disk.

The engine's loop would first have to be woken, and a wizard's program waits meanwhile. So while the disk is at work,
the loop writes down what the asker gets next: the records of the step and the answer. Whoever comes first takes it. The
loop does when anything else is to go to that client before; and it alone tells everybody else.
"""

from __future__ import annotations

import asyncio
import os
from threading import Lock


class Early:
    """The next bytes of one client. `send` belongs to the journal's thread, everything else to the engine's.

    Neither waits for the other while both run: a thread that has written to a socket gets Python's lock back only when
    the other one lets go of it.
    """

    def __init__(self, transport: asyncio.Transport, id: int, records: int, data: bytes) -> None:
        """`data`: so many records in one line, and the answer to the message `id`. Nothing may wait in `transport`."""
        self.id = id
        self.records = records
        self._transport = transport
        self._descriptor: int = transport.get_extra_info("socket").fileno()
        self._data = data
        self._claims = [None]
        """Whoever takes this out has it."""
        self._left: bool | None = None
        self._sent: int | None = None
        """Bytes; None until that is known."""
        self._sending = Lock()

    def send(self) -> None:
        with self._sending:
            if not self._claim():
                return
            try:
                self._sent = os.write(self._descriptor, self._data)
            except OSError:  # no room, or nobody there: the loop finds out
                self._sent = 0

    def left(self) -> bool:
        """Whether the journal's thread has taken it. If it has not, it never will: it goes the usual way."""
        if self._left is None:
            self._left = not self._claim()
        return self._left

    def finish(self) -> bool:
        """Send what had no room. False when that is not known yet; until it is, nothing else may be sent."""
        if self._sent is None:
            return False
        rest, self._data = self._data[self._sent :], b""
        if rest and not self._transport.is_closing():
            self._transport.write(rest)
        return True

    def close(self) -> None:
        """Before the connection is closed: from here on nobody writes to it."""
        if self.left():
            with self._sending:
                pass

    def _claim(self) -> bool:
        try:
            self._claims.pop()
        except IndexError:
            return False
        return True
