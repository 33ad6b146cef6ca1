"""An app that writes only different cells, skips frames that its terminal cannot accept, and sees every key first."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any, Protocol, runtime_checkable

from rich.console import RenderableType
from textual import events
from textual._compositor import ChopsUpdate, LayoutUpdate
from textual.app import App
from textual.message_pump import MessagePump
from textual.screen import Screen
from textual.timer import Timer

from rise_tui.rendering.cell_buffer import CellBuffer, DiffUpdate
from rise_tui.rendering.terminal_driver import TerminalDriver, TerminalWriter, read_together

CATCH_UP_SECONDS = 0.05
"""Seconds between two checks whether a slow terminal accepts more."""

MOVES = {"ctrl+n": "down", "ctrl+p": "up"}
"""Keys that are another key on every screen, as in a shell."""


class TerminalApp(App[Any]):
    """An app on a terminal that may be far away, slow, or gone."""

    def __init__(self, **options: Any) -> None:
        super().__init__(driver_class=TerminalDriver, **options)
        self._cells = CellBuffer()
        """The terminal's contents."""
        self._catching_up: Timer | None = None
        self.key_queue = KeyQueue(self, self._pass_on)

    # --- writing ----------------------------------------------------------------------------------------------------

    @property
    def terminal_writer(self) -> TerminalWriter | None:
        """The connection to the terminal; None without one (tests)."""
        writer = getattr(self._driver, "terminal_writer", None)
        return writer if isinstance(writer, TerminalWriter) else None

    def forget_terminal(self) -> None:
        """Forget the terminal's contents: the next paint is written in full."""
        self._cells.forget()

    def repaint_everything(self) -> None:
        """Write every cell again, after something else has written to the terminal."""
        self.forget_terminal()
        self.screen.refresh()

    def on_resize(self, event: events.Resize) -> None:
        """Repaint a window that has its old size again: its contents are unknown after another size."""
        if event.size == self._size and self._cells.is_known:
            self.repaint_everything()

    def _display(self, screen: Screen[Any], renderable: RenderableType | None) -> None:
        if (focused := screen.focused) is not None:  # braille displays and screen readers follow the terminal's cursor
            self.cursor_position = getattr(focused, "cursor_screen_offset", focused.region.offset)
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
        """Whether a keyboard or mouse event may pass. Called once for each; for keys after `observe_key`."""
        return True

    def handle_key_first(self, event: events.Key) -> bool:
        """Carry out a key immediately that nothing else could use; False: it goes its usual way."""
        return False

    def waits_for_keys(self, event: events.Key) -> bool:
        """Whether a key may be for something that an earlier key opens. It then waits until that is open."""
        return False

    async def on_event(self, event: events.Event) -> None:
        """Handle an event. Input comes once from the driver, and again as it bubbles up; only the first counts."""
        if isinstance(event, events.InputEvent | events.Paste) and not event.is_forwarded:
            if isinstance(event, events.Key):
                event.key = MOVES.get(event.key, event.key)
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


def repaint_everything(app: App[Any]) -> None:
    """Write every cell again, if the app is on a terminal of ours."""
    if isinstance(app, TerminalApp):
        app.repaint_everything()


# --- keys, one after the other ----------------------------------------------------------------------------------------

# Textual gives a key to the widget with the focus when the key arrives. Over a slow line several keys come in one
# piece. Then `/` and the letters after it would all go to the list in which `/` opens a line.


CHECK_SECONDS = 0.004
"""Seconds between two checks whether a screen has opened, or work is done."""
MAX_CHECKS = 500
"""Maximum number of checks whether a key's effect is complete. The limit counts checks, not seconds: on a busy machine
everything takes longer, and a key that did not wait would go to the wrong field."""
MAX_ROUNDS = 3
"""Walks from the focus up to the app: for a key's message, that message's answer, and what it opens."""


@runtime_checkable
class WorkingScreen(Protocol):
    """A screen whose keys begin work that opens something at its end."""

    @property
    def is_working(self) -> bool:
        """Whether such work is in progress."""


class KeyQueue:
    """Passes keys on in order."""

    def __init__(self, app: App[Any], pass_on: Callable[[events.Key], Awaitable[None]]) -> None:
        self._app, self._pass_on = app, pass_on
        self._keys: deque[events.Key] = deque()
        self._task: asyncio.Task[None] | None = None

    @property
    def is_empty(self) -> bool:
        """Whether every key has been carried out."""
        return self._task is None

    def put(self, event: events.Key) -> None:
        """Pass this key on after earlier keys have been carried out."""
        self._keys.append(event)
        if self._task is None:
            self._task = asyncio.create_task(self._run())

    async def _run(self) -> None:
        try:
            while self._keys:
                await self._pass_on(self._keys.popleft())
                carried_out = asyncio.create_task(self._carried_out())
                try:
                    for _ in range(MAX_CHECKS):
                        if (await asyncio.wait([carried_out], timeout=CHECK_SECONDS))[0]:
                            carried_out.result()
                            break
                finally:
                    carried_out.cancel()
        finally:
            self._task = None

    async def _carried_out(self) -> None:
        """Return when the last key, and the work that it began, is done."""
        for _ in range(MAX_ROUNDS):
            await self._settle_messages()
            while not self._is_ready:  # noqa: ASYNC110 - no event announces this
                await asyncio.sleep(CHECK_SECONDS)

    async def _settle_messages(self) -> None:
        """Wait until everything from the focus up to the app has handled its present messages."""
        stack = self._app.screen_stack
        node: MessagePump | None = (self._app.focused or stack[-1]) if stack else None
        while node is not None:
            done = asyncio.get_running_loop().create_future()
            if node.is_running and node.call_later(_set, done):
                await done
            node = node._parent

    @property
    def _is_ready(self) -> bool:
        stack = self._app.screen_stack
        if not stack:  # the key has ended the program
            return True
        if not stack[-1]._is_mounted or any(isinstance(each, WorkingScreen) and each.is_working for each in stack):
            return False
        return all(not node.message_queue_size for node in (self._app, *stack[-1].walk_children(with_self=True)))


def _set(done: asyncio.Future[None]) -> None:
    if not done.done():
        done.set_result(None)
