"""An app that writes only different cells, skips frames that its terminal cannot take, and sees every key first."""

from __future__ import annotations

from typing import Any

from rich.console import RenderableType
from textual import events
from textual._compositor import ChopsUpdate, LayoutUpdate
from textual.app import App
from textual.screen import Screen
from textual.timer import Timer

from rise_tui.rendering.cell_buffer import CellBuffer
from rise_tui.rendering.diff import DiffUpdate
from rise_tui.rendering.key_queue import KeyQueue
from rise_tui.rendering.terminal_driver import TerminalDriver
from rise_tui.rendering.terminal_reader import read_together
from rise_tui.rendering.terminal_writer import TerminalWriter

CATCH_UP_SECONDS = 0.05
"""Seconds between two checks whether a slow terminal accepts more."""


class TerminalApp(App[Any]):
    """An app on a terminal that may be far away, slow, or gone."""

    def __init__(self, **options: Any) -> None:
        super().__init__(driver_class=TerminalDriver, **options)
        self._cells = CellBuffer()
        """What the terminal shows."""
        self._catching_up: Timer | None = None
        self.key_queue = KeyQueue(self, self._pass_on)

    # --- writing ----------------------------------------------------------------------------------------------------

    @property
    def terminal_writer(self) -> TerminalWriter | None:
        """The connection to the terminal; None without one (tests)."""
        writer = getattr(self._driver, "terminal_writer", None)
        return writer if isinstance(writer, TerminalWriter) else None

    def forget_terminal(self) -> None:
        """Forget what the terminal shows: the next paint is written in full."""
        self._cells.forget()

    def repaint_everything(self) -> None:
        """Write every cell again, after something else has written to the terminal."""
        self.forget_terminal()
        self.screen.refresh()

    def on_resize(self, event: events.Resize) -> None:
        """Repaint a window that has its old size again, because its contents are unknown after another size."""
        if event.size == self._size and self._cells.is_known:
            self.repaint_everything()

    def _display(self, screen: Screen[Any], renderable: RenderableType | None) -> None:
        if not isinstance(renderable, LayoutUpdate | ChopsUpdate) or self._batch_count:
            super()._display(screen, renderable)
        elif self._is_behind:  # the newest state is painted when the terminal is ready
            self._catching_up = self._catching_up or self.set_interval(CATCH_UP_SECONDS, self._catch_up)
        else:
            super()._display(screen, DiffUpdate(renderable, self._cells, self.size))  # type: ignore[arg-type]

    @property
    def _is_behind(self) -> bool:
        return self.terminal_writer is not None and self.terminal_writer.is_behind

    def _catch_up(self) -> None:
        if self._catching_up is not None and not self._is_behind:
            self._catching_up.stop()
            self._catching_up = None
            self.screen.refresh()

    # --- keys -------------------------------------------------------------------------------------------------------

    def observe_key(self, event: events.Key, together: bool) -> None:
        """Called once for each key, before anything acts on it, including keys for a binding or a dialog.

        `together`: whether it came in one piece with other keys, as a paste does.
        """

    def admits(self, event: events.Event) -> bool:
        """Whether a keyboard or mouse event may go on. Called once for each; for keys after `observe_key`."""
        return True

    def handle_key_first(self, event: events.Key) -> bool:
        """Carry out a key immediately that nothing else could want; False: it goes its usual way."""
        return False

    def waits_for_keys(self, event: events.Key) -> bool:
        """Whether a key may be meant for what an earlier key opens. It then waits until that is open."""
        return False

    async def on_event(self, event: events.Event) -> None:
        """Handle an event. Input comes once from the driver, and again as it bubbles up; only the first counts."""
        if isinstance(event, events.InputEvent | events.Paste) and not event.is_forwarded:
            if isinstance(event, events.Key):
                self.observe_key(event, read_together(event))
                if self.waits_for_keys(event):
                    self.key_queue.put(event)
                    return
            await self._pass_on(event)
        else:
            await super().on_event(event)

    async def _pass_on(self, event: events.Event) -> None:
        if self.admits(event) and not (isinstance(event, events.Key) and self.handle_key_first(event)):
            await super().on_event(event)
