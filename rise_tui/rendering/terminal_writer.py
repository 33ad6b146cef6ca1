"""The way to the terminal: it may stall, or be gone, and never holds the console up."""

from __future__ import annotations

import os
import select
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import TextIO


class TerminalWriter:
    """The file that Textual's writer thread writes to.

    With a plain file the thread dies of the first error or blocks in a write; its bounded queue (30 writes) fills, and
    the loop blocks for ever in the next `put`. Here a terminal that is gone takes everything and shows nothing, so the
    queue always drains; and `is_behind` says when the next frame should not be queued at all.
    """

    PATIENCE = 1.0
    """Seconds without progress after which a stalled terminal is given up, once `hurry` was called."""
    POLL = 0.1
    """Seconds between two looks whether `hurry` was called."""
    MOST_WAITING = 12
    """Writes that may wait for the terminal before frames are skipped."""
    MOST_CHARACTERS = 8192
    """Characters that may wait."""

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._fd = file.fileno()
        with suppress(OSError):
            # Opened anew: not to block is then ours alone, and not also the shell's that shares our descriptor.
            self._fd = os.open(os.ttyname(self._fd), os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
        self.is_gone = False
        self.on_gone: Callable[[], None] | None = None
        """Called once, on the writer thread, when a write finds the terminal gone."""
        self._hurried = False
        # Each is counted up by one thread, so no lock is needed.
        self._queued_writes = self._queued_characters = self._done_writes = self._done_characters = 0

    @property
    def is_behind(self) -> bool:
        """Whether the terminal has not taken what it was given before."""
        return (
            self._queued_writes - self._done_writes > self.MOST_WAITING
            or self._queued_characters - self._done_characters > self.MOST_CHARACTERS
        )

    def hurry(self) -> None:
        """The console ends: wait no longer than PATIENCE for a terminal that takes nothing. For signal handlers too."""
        self._hurried = True

    def stop_hurrying(self) -> None:
        """The console goes on after it was suspended."""
        self._hurried = False

    def count_queued(self, text: str) -> None:
        """This was given to the writer thread."""
        self._queued_writes += 1
        self._queued_characters += len(text)

    # --- the file of the writer thread --------------------------------------------------------------------------------

    def write(self, text: str) -> None:
        """Write all of it, or find the terminal gone. Blocks the writer thread, and only that."""
        data = memoryview(text.encode(self._file.encoding or "utf-8", "backslashreplace"))
        progress = monotonic()
        while data and not self.is_gone:
            try:
                if select.select((), (self._fd,), (), self.POLL)[1]:
                    data = data[os.write(self._fd, data) :]
                    progress = monotonic()
            except BlockingIOError:
                pass
            except (OSError, ValueError):
                self.is_gone = True
                if self.on_gone is not None:
                    self.on_gone()
            if self._hurried and monotonic() - progress > self.PATIENCE:
                self.is_gone = True
        self._done_writes += 1
        self._done_characters += len(text)

    def flush(self) -> None:
        """Nothing is kept back."""

    def fileno(self) -> int:
        """The descriptor that is written to."""
        return self._fd
