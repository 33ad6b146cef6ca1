"""The terminal's driver: what it asks the terminal for, and what it tells about each key."""

from __future__ import annotations

import os
import select
import sys
from codecs import getincrementaldecoder
from collections.abc import Iterable
from typing import Any

from textual import events
from textual.driver import Driver
from textual.message import Message

from rise_tui.quiet.outlet import Outlet

READ = 4096
TICK = 0.1
"""Seconds between two looks at a sequence that is not complete: Esc alone is one."""
ALONE = 0.001
"""Seconds for which a key waits whether something follows it: what is pasted comes at once, and fingers do not."""
SWITCH = 0.0001
"""Seconds for which the thread that reads keys waits for the loop to let go of the interpreter; usually 5 ms."""
_TOGETHER = "_read_together"


def read_together(event: events.Key) -> bool | None:
    """Whether a key came in one piece with others; None when no terminal has brought it."""
    found = event.__dict__.get(_TOGETHER)
    return found if isinstance(found, bool) else None


def mark_together(messages: Iterable[Message], *, more: bool) -> bool:
    """Mark the keys of one read; `more`: something follows at once. Returns whether there is a key among them."""
    keys = [message for message in messages if isinstance(message, events.Key)]
    for key in keys:
        key.__dict__[_TOGETHER] = more or len(keys) > 1
    return bool(keys)


def click_driver() -> type[Driver] | None:
    """A driver that asks the terminal for clicks, drags and the wheel, but not for every movement of the pointer.

    Sweeping the pointer over a stock app costs 1.5 kB for each report. None where there is no such terminal (Windows).
    It writes to an `Outlet`, and marks keys that come together (`read_together`).
    """
    if sys.platform == "win32":
        return None
    from textual._xterm_parser import XTermParser
    from textual.drivers.linux_driver import LinuxDriver

    class ClickDriver(LinuxDriver):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self.outlet = Outlet(self._file)
            self._file: Any = self.outlet  # what start_application_mode gives to the writer thread

        def start_application_mode(self) -> None:
            sys.setswitchinterval(SWITCH)
            self.outlet.calm()
            forget = getattr(self._app, "forget_frame", None)
            if forget is not None:  # a terminal that was left for a while shows something else
                forget()
            super().start_application_mode()  # type: ignore[no-untyped-call]

        def stop_application_mode(self) -> None:
            self.outlet.hurry()
            super().stop_application_mode()

        def write(self, data: str) -> None:
            self.outlet.given(data)
            super().write(data)

        def run_input_thread(self) -> None:
            """As the stock one, but it knows what came in one read, and nothing that a terminal sends ends it."""
            self._parser = XTermParser(self._debug)
            decode = getincrementaldecoder("utf-8")(errors="replace").decode
            while not self.exit_event.is_set():
                messages: list[Message] = []
                if self._readable(TICK):
                    try:
                        data = os.read(self.fileno, READ)
                    except OSError:
                        data = b""
                    if not data:
                        break  # the terminal has gone
                    for character in decode(data):
                        messages += self._parsed(character)
                    if mark_together(messages, more=False):
                        self.outlet.key_read()
                        mark_together(messages, more=self._readable(ALONE))
                messages += self._parser.tick()
                for message in messages:
                    self.process_message(message)

        def _parsed(self, character: str) -> list[Message]:
            try:
                return list(self._parser.feed(character))
            except Exception:  # a code that Textual's parser trips over, such as a character beyond Unicode
                self._parser = XTermParser(self._debug)
                return []

        def _readable(self, seconds: float) -> bool:
            return bool(select.select([self.fileno], [], [], seconds)[0])

        def _enable_mouse_support(self) -> None:
            if self._mouse:
                self.write("\x1b[?1000h\x1b[?1002h\x1b[?1006h")
                self.flush()

        def _disable_mouse_support(self) -> None:
            super()._disable_mouse_support()
            if self._mouse:
                self.write("\x1b[?1002l")
                self.flush()

    return ClickDriver
