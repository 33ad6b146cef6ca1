"""The way to the terminal, and what is known of how quickly it takes things."""

from __future__ import annotations

import os
import select
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import TextIO


class Outlet:
    """What Textual's writer thread writes to: a terminal that may stall, or be gone, and never holds the console up.

    The stock thread dies of the first error or blocks in a write; its bounded queue fills, and the loop blocks for ever
    in the next `put`. Here a terminal that is gone takes everything and shows nothing, so that the queue always drains;
    and whoever paints asks first whether the terminal has taken what it was given (`stall_wait`).
    """

    PATIENCE = 1.0
    """Seconds without progress after which a stalled terminal is given up, once `hurry` was called."""
    _ROUND = 0.1

    KEY_SECONDS = 0.006
    """For so long after a key nothing else is begun on the loop: its command is sent in less."""
    KEYS_SECONDS = 0.1
    """While keys come and come, something is painted at least this often."""
    WAITING_WRITES, WAITING_SIZE = 12, 8192
    """Writes, and characters, that may wait for the terminal before painting waits too. Textual's queue holds 30."""
    LOOK_AGAIN = 0.02

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._fd = file.fileno()
        with suppress(OSError):
            # Opened anew: not to block is then ours alone, and not also the shell's that shares our descriptor.
            self._fd = os.open(os.ttyname(self._fd), os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
        self.gone = False
        self.lost: Callable[[], None] | None = None
        """Called once, on the writer thread, when a write finds the terminal gone."""
        self._hurried = False
        self._key_at, self._kept_from = float("-inf"), float("inf")
        self.listening = -1
        """What keys come from, while somebody reads there."""
        # Counted up by one thread each, so that no lock is needed.
        self._given_writes = self._given_size = self._taken_writes = self._taken_size = 0

    def hurry(self) -> None:
        """The console ends: do not wait long for a terminal that takes nothing. May be called in a signal handler."""
        self._hurried = True

    def calm(self) -> None:
        """The console goes on after it was suspended."""
        self._hurried = False

    # --- what painting has to wait for ------------------------------------------------------------------------------

    def key_read(self) -> None:
        """A key has come."""
        self._key_at = monotonic()

    def key_wait(self) -> float:
        """Seconds for which a key on its way should have the loop; 0 when there is none."""
        now = monotonic()
        if self.listening >= 0 and select.select((self.listening,), (), (), 0)[0]:
            self._key_at = now  # it has come, but the loop has not got to it
        left = self._key_at + self.KEY_SECONDS - now
        if left <= 0:
            self._kept_from = float("inf")
            return 0.0
        self._kept_from = min(self._kept_from, now)
        return left if now - self._kept_from < self.KEYS_SECONDS else 0.0

    def given(self, text: str) -> None:
        """This goes to the writer thread."""
        self._given_writes += 1
        self._given_size += len(text)

    def stall_wait(self) -> float:
        """Seconds after which to look again whether the terminal takes more; 0 when it does."""
        waits = (
            self._given_writes - self._taken_writes > self.WAITING_WRITES
            or self._given_size - self._taken_size > self.WAITING_SIZE
        )
        return self.LOOK_AGAIN if waits and not self._hurried else 0.0

    # --- the file of the writer thread --------------------------------------------------------------------------------

    def write(self, text: str) -> None:
        data = memoryview(text.encode(self._file.encoding or "utf-8", "backslashreplace"))
        progress = monotonic()
        while data and not self.gone:
            try:
                if select.select((), (self._fd,), (), self._ROUND)[1]:
                    data = data[os.write(self._fd, data) :]
                    progress = monotonic()
            except BlockingIOError:
                pass
            except (OSError, ValueError):
                self.gone = True
                if self.lost is not None:
                    self.lost()
            if self._hurried and monotonic() - progress > self.PATIENCE:
                self.gone = True
        self._taken_writes += 1
        self._taken_size += len(text)

    def flush(self) -> None:
        """Nothing is kept back."""

    def fileno(self) -> int:
        return self._fd
