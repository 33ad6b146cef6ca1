"""Cheap on the wire (law 8): every detail of Textual 8.2.8 that is not documented, in one place, each with a test.

A new release of Textual that changes one of them fails `tests/console/test_quiet.py`, and nothing else needs reading.
"""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Callable
from contextlib import suppress
from time import monotonic
from typing import Any, Generic, TextIO

from textual import events
from textual.app import App
from textual.driver import Driver
from textual.geometry import Size
from textual.reactive import Reactive
from textual.screen import ModalScreen, Screen, ScreenResultType
from textual.scroll_view import ScrollView
from textual.widget import Widget


class QuietScreen(Screen[ScreenResultType], Generic[ScreenResultType]):
    """A screen that does not repaint whole when the focus moves: 47 kB become 9 kB at 120x40.

    `Screen.focused` is declared with a repaint. Widgets here show their focus themselves.
    """

    focused: Reactive[Widget | None] = Reactive(None, repaint=False)


class QuietModal(ModalScreen[ScreenResultType], Generic[ScreenResultType]):
    """The same for dialogs."""

    focused: Reactive[Widget | None] = Reactive(None, repaint=False)


class QuietScrollView(ScrollView):
    """A line-API view whose growth repaints nothing: appending a row of a log costs that row.

    `Widget.virtual_size` is declared with a layout of the whole screen.
    """

    virtual_size: Reactive[Size] = Reactive(Size(0, 0), repaint=False)

    def resize_content(self, size: Size) -> None:
        """Give the content its size: moves the scrollbar and nothing else."""
        if size == self.virtual_size:
            return
        self.virtual_size = size
        if self.container_size:
            self._scroll_update(size)

    def _on_focus(self, event: events.Focus) -> None:
        """As `Widget._on_focus`, but without repainting all of it: a subclass repaints what shows its focus."""
        event.prevent_default()
        self.has_focus = True
        if self.parent is not None:
            self.parent.post_message(events.DescendantFocus(self))

    def _on_blur(self, event: events.Blur) -> None:
        event.prevent_default()
        self.has_focus = False
        if self.parent is not None:
            self.parent.post_message(events.DescendantBlur(self))

    @property
    def row_width(self) -> int:
        """Cells of one row, without the scrollbar."""
        return self.scrollable_content_region.width


class KeyWatch(App[Any]):
    """An app that sees every key first, also those that a binding or a dialog takes.

    `App.on_event` receives an input event once from the driver and again when it bubbles up; only the first counts.
    """

    def key_arrived(self, event: events.Key) -> None:
        """Called for each key before anything acts on it."""

    async def on_event(self, event: events.Event) -> None:
        if isinstance(event, events.Key) and not event.is_forwarded:
            self.key_arrived(event)
        await super().on_event(event)


class Outlet:
    """What Textual's writer thread writes to: a terminal that may stall, or be gone, and never holds the console up.

    The stock thread dies of the first error or blocks in a write; its bounded queue fills, and the loop blocks for ever
    in the next `put`. Here a terminal that is gone takes everything and shows nothing, so that the queue always drains.
    """

    PATIENCE = 1.0
    """Seconds without progress after which a stalled terminal is given up, once `hurry` was called."""
    _ROUND = 0.1

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

    def hurry(self) -> None:
        """The console ends: do not wait long for a terminal that takes nothing. May be called in a signal handler."""
        self._hurried = True

    def calm(self) -> None:
        """The console goes on after it was suspended."""
        self._hurried = False

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

    def flush(self) -> None:
        """Nothing is kept back."""

    def fileno(self) -> int:
        return self._fd


def outlet_of(app: App[Any]) -> Outlet | None:
    """Where an app writes to; None without a terminal (tests, Windows)."""
    outlet = getattr(app._driver, "outlet", None)
    return outlet if isinstance(outlet, Outlet) else None


def click_driver() -> type[Driver] | None:
    """A driver that asks the terminal for clicks, drags and the wheel, but not for every movement of the pointer.

    Sweeping the pointer over a stock app costs 1.5 kB for each report. None where there is no such terminal (Windows).
    It writes to an `Outlet`.
    """
    if sys.platform == "win32":
        return None
    from textual.drivers.linux_driver import LinuxDriver

    class ClickDriver(LinuxDriver):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            self.outlet = Outlet(self._file)
            self._file: Any = self.outlet  # what start_application_mode gives to the writer thread

        def start_application_mode(self) -> None:
            self.outlet.calm()
            super().start_application_mode()  # type: ignore[no-untyped-call]

        def stop_application_mode(self) -> None:
            self.outlet.hurry()
            super().stop_application_mode()

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
