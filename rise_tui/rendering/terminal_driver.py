"""The terminal: its driver's requests, the thread that reads keys, and the writer, which never delays the console."""

from __future__ import annotations

import os
import select
from codecs import getincrementaldecoder
from collections.abc import Callable, Iterable
from contextlib import suppress
from threading import Event
from time import monotonic
from typing import Any, TextIO

from textual import constants, events
from textual._xterm_parser import XTermParser
from textual.drivers.linux_driver import LinuxDriver
from textual.message import Message


class TerminalDriver(LinuxDriver):
    """Reads with a `TerminalReader`, writes to a `TerminalWriter`, and requests only clicks, drags and the wheel.

    In a plain Textual app, each reported pointer movement costs 1.5 kB. A report right after a key would also make that
    key one of several, which does not count.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.terminal_writer = TerminalWriter(self._file)
        self._file: Any = self.terminal_writer  # what `start_application_mode` gives to the writer thread

    def start_application_mode(self) -> None:
        self.terminal_writer.stop_ending_quickly()
        forget = getattr(self._app, "forget_terminal", None)
        if forget is not None:  # the terminal may have changed meanwhile
            forget()
        super().start_application_mode()  # type: ignore[no-untyped-call]

    def stop_application_mode(self) -> None:
        self.terminal_writer.end_quickly()
        super().stop_application_mode()

    def write(self, data: str) -> None:
        self.terminal_writer.count_queued(data)
        super().write(data)

    def run_input_thread(self) -> None:
        TerminalReader(self.fileno, self.process_message, self.exit_event).run()

    def _enable_mouse_support(self) -> None:
        if self._mouse:
            self.write("\x1b[?1000h\x1b[?1002h\x1b[?1006h")
            self.flush()

    def _disable_mouse_support(self) -> None:
        super()._disable_mouse_support()
        if self._mouse:
            self.write("\x1b[?1002l")
            self.flush()


# --- reading ----------------------------------------------------------------------------------------------------------

# Unlike Textual's own reader, this one detects for each key whether others came with it.


READ = 4096
PASTE_WAIT_SECONDS = 0.0003
"""Seconds to wait after a key for others: pasted keys come immediately, typed ones do not."""
POLL = constants.ESCAPE_DELAY + 0.005
"""Seconds after which an incomplete sequence is examined: Esc alone is one."""
_TOGETHER = "_read_together"
_FIRST = "_read_first"


def read_together(event: events.Key) -> bool:
    """Whether a key came in one piece with others, as a paste does."""
    return event.__dict__.get(_TOGETHER, False) is True


def read_first(event: events.Key) -> bool:
    """Whether a key begins something: it came alone, first in its piece, or after a key that is not a letter."""
    return event.__dict__.get(_FIRST, True) is True


def mark_together(messages: Iterable[Message], together: bool, *, begins: bool = True) -> bool:
    """Mark the keys among some messages.

    :param begins: whether the first key begins something (`read_first`).
    :returns: whether the next key in the same piece would.
    """
    for message in messages:
        if isinstance(message, events.Key):
            message.__dict__[_TOGETHER], message.__dict__[_FIRST] = together, begins
            begins = not message.is_printable
    return begins


class TerminalReader:
    """Reads one terminal, on its own thread, until it is stopped or the terminal has gone.

    Textual's own reader does not show which keys came in one read, so every key would have to wait for others (25 ms).
    It also ends the whole console on a code that its parser cannot handle.
    """

    def __init__(self, fileno: int, deliver: Callable[[Message], None], stop: Event) -> None:
        self._fileno, self._deliver, self._stop = fileno, deliver, stop
        self._parser = XTermParser()
        self._decode = getincrementaldecoder("utf-8")(errors="replace").decode
        self._begins = True
        """Whether the next key begins something."""

    def run(self) -> None:
        """Read and deliver until the end."""
        while not self._stop.is_set():
            if self._has_more(POLL) and not self._read():
                return
            self._deliver_incomplete()

    def _has_more(self, seconds: float) -> bool:
        return bool(select.select((self._fileno,), (), (), seconds)[0])

    def _read(self) -> bool:
        """Read once and deliver. False: the terminal has gone."""
        try:
            data = os.read(self._fileno, READ)
        except OSError:
            return False
        messages = [message for character in self._decode(data) for message in self._parse(character)]
        keys = sum(isinstance(message, events.Key) for message in messages)
        if keys:
            more = self._has_more(PASTE_WAIT_SECONDS)
            self._begins = mark_together(messages, keys > 1 or more, begins=self._begins) or not more
        for message in messages:
            self._deliver(message)
        return bool(data)

    def _deliver_incomplete(self) -> None:
        """Deliver an incomplete sequence whose rest did not come."""
        messages = list(self._parser.tick())
        if any(isinstance(message, events.Key) and message.key != "escape" for message in messages):
            # Escape and something else came together: alt+enter is not Enter
            mark_together(messages, True, begins=False)
        for message in messages:
            self._deliver(message)

    def _parse(self, character: str) -> list[Message]:
        try:
            return list(self._parser.feed(character))
        except Exception:  # a code that Textual's parser cannot handle, such as a character beyond Unicode
            self._parser = XTermParser()
            return []


# --- writing ----------------------------------------------------------------------------------------------------------


class TerminalWriter:
    """The file that Textual's writer thread writes to.

    With a plain file the thread dies at the first error, or blocks in a write. Its bounded queue (30 writes) then fills
    up, and the loop blocks forever in the next `put`. Here a terminal that is gone accepts everything, so the queue
    always empties. `is_behind` shows when not to queue the next frame.
    """

    PATIENCE = 1.0
    """Seconds without progress after which a stalled terminal is given up, once `end_quickly` was called."""
    POLL = 0.1
    """Seconds between two checks whether `end_quickly` was called."""
    MAX_WAITING = 12
    """Maximum number of waiting writes before frames are skipped."""
    MAX_CHARACTERS = 8192
    """Maximum number of waiting characters before frames are skipped."""

    def __init__(self, file: TextIO) -> None:
        self._file = file
        self._fd = file.fileno()
        with suppress(OSError):
            # Opened again, so that only our descriptor does not block, and not the one shared with the shell.
            self._fd = os.open(os.ttyname(self._fd), os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
        self.is_gone = False
        self.on_gone: Callable[[], None] | None = None
        """Called once, on the writer thread, when a write finds the terminal gone."""
        self._hurried = False
        # One thread increases each counter, so no lock is needed.
        self._queued_writes = self._queued_characters = self._done_writes = self._done_characters = 0

    @property
    def is_behind(self) -> bool:
        """Whether the terminal has not yet accepted earlier writes."""
        return (
            self._queued_writes - self._done_writes > self.MAX_WAITING
            or self._queued_characters - self._done_characters > self.MAX_CHARACTERS
        )

    def end_quickly(self) -> None:
        """End the console: wait no longer than PATIENCE for a stalled terminal. Signal handlers may call this."""
        self._hurried = True

    def stop_ending_quickly(self) -> None:
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
        """Do nothing: no text is buffered."""

    def fileno(self) -> int:
        """The descriptor of the terminal."""
        return self._fd
