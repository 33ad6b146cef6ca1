"""Screens that repaint less, and a few rows at a time."""

from __future__ import annotations

import asyncio
from time import perf_counter
from typing import Any, Generic

from textual._styles_cache import StylesCache
from textual.await_complete import AwaitComplete
from textual.reactive import Reactive
from textual.screen import ModalScreen, Screen, ScreenResultType
from textual.widget import Widget

from rise_tui.quiet.app import QuietApp
from rise_tui.quiet.compositor import RowCompositor
from rise_tui.quiet.outlet import Outlet
from rise_tui.quiet.slices import SLICE, outlet_of

BATCH = 0.002
ROWS = 1
"""Rows that are painted between two looks at the clock."""


class QuietScreen(Screen[ScreenResultType], Generic[ScreenResultType]):
    """A screen that does not repaint whole when the focus moves: 47 kB become 9 kB at 120x40.

    `Screen.focused` is declared with a repaint. Widgets here show their focus themselves.

    On a terminal it paints a few rows at a time, and the loop takes what has come between two pieces; it waits while a
    key is on its way, and while the terminal does not take what it was given. What waits stays where Textual keeps it,
    so that it is one with whatever else becomes due meanwhile: frames are skipped, never what they show. The pieces of
    one frame are written at once.
    """

    focused: Reactive[Widget | None] = Reactive(None, repaint=False)

    _due: asyncio.Handle | None = None

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self._rows = self._compositor = RowCompositor()
        self._in_frame = False
        self.paint_seconds = 0.0
        """What the latest frame took, without what happened between its pieces."""

    def _on_timer_update(self) -> None:
        app, outlet = self.app, outlet_of(self.app)
        if outlet is None or not isinstance(app, QuietApp):
            super()._on_timer_update()
            return
        self._update_timer.pause()
        self._cancel_due()
        if wait := self._batch_wait(app) or outlet.key_wait() or (0.0 if self._in_frame else outlet.stall_wait()):
            self._go_on(wait)
        elif self._may_paint(app) and not (self._layout_required or self._scroll_required or self._repaint_required):
            self._paint(app, outlet)
        else:
            super()._on_timer_update()

    def _compositor_refresh(self) -> None:
        """What there is to paint after a layout."""
        app, outlet = self.app, outlet_of(self.app)
        if outlet is None or not isinstance(app, QuietApp):
            super()._compositor_refresh()
            return
        self._cancel_due()
        if wait := self._batch_wait(app) or outlet.stall_wait():
            self._go_on(wait)
        elif self._may_paint(app):
            self._paint(app, outlet)
        else:
            self._in_frame = False
            super()._compositor_refresh()

    async def _invoke_and_clear_callbacks(self) -> None:
        """What waits until the screen is painted waits for the last piece."""
        if not (self._in_frame and self.is_current):
            await super()._invoke_and_clear_callbacks()

    def _may_paint(self, app: QuietApp) -> bool:
        return self.is_active and not app._batch_count

    def _batch_wait(self, app: QuietApp) -> float:
        """Seconds after which to look again whether a batch of changes is complete.

        The stock screen makes a frame in the midst of it, which is then not shown.
        """
        return BATCH if app._batch_count and self.is_active else 0.0

    def _paint(self, app: QuietApp, outlet: Outlet) -> None:
        """Begin a frame, or go on with it, for as long as a key may wait."""
        began = perf_counter()
        if not self._in_frame:
            self._in_frame, self.paint_seconds = True, 0.0
        self._rows.update_widgets(self._dirty_widgets)
        self._dirty_widgets.clear()
        took = 0.0
        while self._rows.has_more and (at := perf_counter()) + took < began + SLICE and not outlet.key_wait():
            self._rows.paint_piece(ROWS, app._background_screens, app.prepare)
            took = perf_counter() - at
        if self._rows.has_more:
            self._go_on()
        else:
            self._in_frame = False
            app.display_prepared(self)
            app._update_mouse_over(self)
            if self._callbacks:
                self.call_next(self._invoke_and_clear_callbacks)
        self.paint_seconds += perf_counter() - began

    def _go_on(self, wait: float = 0.0) -> None:
        loop = asyncio.get_running_loop()
        self._due = loop.call_later(wait, self._on_timer_update) if wait else loop.call_soon(self._on_timer_update)

    def _cancel_due(self) -> None:
        if self._due is not None:
            self._due.cancel()
            self._due = None


class QuietModal(ModalScreen[ScreenResultType], QuietScreen[ScreenResultType], Generic[ScreenResultType]):
    """The same for dialogs; and when it closes, what it showed is forgotten.

    Textual keeps the painted lines of the last 1,024 widgets: each is part of the key of a cache of colours.
    """

    focused: Reactive[Widget | None] = Reactive(None, repaint=False)

    def on_unmount(self) -> None:
        StylesCache.get_inner_outer.cache_clear()

    def dismiss(self, result: ScreenResultType | None = None) -> AwaitComplete:
        """Once: the stock one takes away whatever is on top, at a second key the console below."""
        return super().dismiss(result) if self.is_active else AwaitComplete.nothing()  # type: ignore[no-untyped-call]


class EmptyScreen(Screen[None]):
    """What is below the console. A terminal is blank to begin with, so it is painted only when the console has gone."""

    def _compositor_refresh(self) -> None:
        if self.stack_updates > 1:
            super()._compositor_refresh()
