"""The terminal's driver: what it asks the terminal for, and what it tells about each key."""

from __future__ import annotations

import sys
from typing import Any

from textual import events
from textual.driver import Driver
from textual.message import Message

from rise_tui.quiet.ears import Ears
from rise_tui.quiet.outlet import Outlet


def click_driver() -> type[Driver] | None:
    """A driver that asks the terminal for clicks, drags and the wheel, but not for every movement of the pointer.

    Sweeping the pointer over a stock app costs 1.5 kB for each report. None where there is no such terminal (Windows).
    It writes to an `Outlet`, and reads with `Ears`.
    """
    if sys.platform == "win32":
        return None
    from textual.drivers.linux_driver import LinuxDriver

    class ClickDriver(LinuxDriver):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self.outlet = Outlet(self._file)
            self._file: Any = self.outlet  # what start_application_mode gives to the writer thread
            self._ears: Ears | None = None

        def start_application_mode(self) -> None:
            self.outlet.calm()
            forget = getattr(self._app, "forget_frame", None)
            if forget is not None:  # a terminal that was left for a while shows something else
                forget()
            thread = self._key_thread
            super().start_application_mode()  # type: ignore[no-untyped-call]
            if self._key_thread is not thread:  # else this program is in the background and stays there
                self._ears = Ears(self.fileno, self.outlet, self.process_message)

        def stop_application_mode(self) -> None:
            self.outlet.hurry()
            super().stop_application_mode()

        def write(self, data: str) -> None:
            self.outlet.given(data)
            super().write(data)

        def run_input_thread(self) -> None:
            """The loop itself reads: a thread would have to wait for the interpreter several times for each key."""
            self.exit_event.wait()

        def disable_input(self) -> None:
            if self._ears is not None:
                self._ears.close()
                self._ears = None
            super().disable_input()

        def send_message(self, message: Message) -> None:
            key_read = getattr(self._app, "key_read", None)
            if key_read is not None and isinstance(message, events.Key) and key_read(message):
                return
            self._app.post_message(message)  # the stock one comes from a thread

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
