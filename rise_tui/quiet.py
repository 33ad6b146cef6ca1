"""Cheap on the wire (law 8): every detail of Textual 8.2.8 that is not documented, in one place, each with a test.

A new release of Textual that changes one of them fails `tests/console/test_quiet.py`, and nothing else needs reading.
"""

from __future__ import annotations

import sys
from typing import Any, Generic

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


def click_driver() -> type[Driver] | None:
    """A driver that asks the terminal for clicks, drags and the wheel, but not for every movement of the pointer.

    Sweeping the pointer over a stock app costs 1.5 kB for each report. None where there is no such terminal (Windows).
    """
    if sys.platform == "win32":
        return None
    from textual.drivers.linux_driver import LinuxDriver

    class ClickDriver(LinuxDriver):
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
