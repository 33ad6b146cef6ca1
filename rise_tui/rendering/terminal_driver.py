"""The driver of the terminal: what it requests from the terminal, and who reads and writes."""

from __future__ import annotations

from typing import Any

from textual.drivers.linux_driver import LinuxDriver

from rise_tui.rendering.terminal_reader import TerminalReader
from rise_tui.rendering.terminal_writer import TerminalWriter


class TerminalDriver(LinuxDriver):
    """Reads with a `TerminalReader`, writes to a `TerminalWriter`, and requests only clicks, drags and the wheel.

    In a stock app, each reported pointer movement costs 1.5 kB. A report right after a key would also make that key one
    of several, which does not count.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.terminal_writer = TerminalWriter(self._file)
        self._file: Any = self.terminal_writer  # what `start_application_mode` gives to the writer thread

    def start_application_mode(self) -> None:
        self.terminal_writer.stop_hurrying()
        forget = getattr(self._app, "forget_terminal", None)
        if forget is not None:  # the terminal may have changed in the meantime
            forget()
        super().start_application_mode()  # type: ignore[no-untyped-call]

    def stop_application_mode(self) -> None:
        self.terminal_writer.hurry()
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
