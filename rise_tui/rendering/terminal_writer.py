"""The connection to the terminal: it may stall or be gone, and never delays the console."""

from __future__ import annotations

import os
import select
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import TextIO


class TerminalWriter:
    """The file that Textual's writer thread writes to.

    With a plain file the thread dies at the first error, or blocks in a write. Its bounded queue (30 writes) then fills
    up, and the loop blocks forever in the next `put`. Here a terminal that is gone accepts everything and shows
    nothing, so the queue always empties. `is_behind` says when not to queue the next frame.
    """

    PATIENCE = 1.0
    """Seconds without progress after which a stalled terminal is given up, once `hurry` was called."""
    POLL = 0.1
    """Seconds between two checks whether `hurry` was called."""
    MOST_WAITING = 12
    """Writes that may wait for the terminal before frames are skipped."""
    MOST_CHARACTERS = 8192
    """Characters that may wait before frames are skipped."""

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._fd = file.fileno()
        with suppress(OSError):
            # Opened again, so that only our descriptor does not block, and not the one that we share with the shell.
            self._fd = os.open(os.ttyname(self._fd), os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
        self.is_gone = False
        self.on_gone: Callable[[], None] | None = None
        """Called once, on the writer thread, when a write finds the terminal gone."""
        self._hurried = False
        # One thread increases each counter, so no lock is needed.
        self._queued_writes = self._queued_characters = self._done_writes = self._done_characters = 0

    @property
    def is_behind(self) -> bool:
        """Whether the terminal has not yet taken what was written before."""
        return (
            self._queued_writes - self._done_writes > self.MOST_WAITING
            or self._queued_characters - self._done_characters > self.MOST_CHARACTERS
        )

    def hurry(self) -> None:
        """End the console: wait no longer than PATIENCE for a stalled terminal. Signal handlers may call this."""
        self._hurried = True

    def stop_hurrying(self) -> None:
        """Go on after the console was suspended."""
        self._hurried = False

    def count_queued(self, text: str) -> None:
        """Count a text that was given to the writer thread."""
        self._queued_writes += 1
        self._queued_characters += len(text)

    # --- the file of the writer thread --------------------------------------------------------------------------------

    def write(self, text: str) -> None:
        """Write all of the text, or find the terminal gone. Blocks only the writer thread."""
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
        """Do nothing: no text is held back."""

    def fileno(self) -> int:
        """The descriptor of the terminal."""
        return self._fd
