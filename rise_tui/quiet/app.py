"""An app that writes only what differs, and sees every key first."""

from __future__ import annotations

from typing import Any

from rich.console import RenderableType
from textual import events
from textual._compositor import ChopsUpdate, LayoutUpdate
from textual.app import App
from textual.screen import Screen
from textual.strip import Strip

from rise_tui.quiet.difference import Difference, Written, written
from rise_tui.quiet.ears import read_together
from rise_tui.quiet.frame import Frame


class QuietApp(App[Any]):
    """An app that writes only what differs from what its terminal shows."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self._frame = Frame()
        self._prepared: list[str] = []

    def forget_frame(self) -> None:
        """Whatever is painted next is written whole."""
        self._frame.forget()
        self._prepared.clear()

    def paint_anew(self) -> None:
        """Write every cell again: something else has written to the terminal."""
        self.forget_frame()
        self.screen.refresh()

    def prepare(self, x: int, y: int, strip: Strip) -> None:
        """Make the bytes for a piece of a frame; they are written with the next that is displayed."""
        self._frame.resize(*self.size)
        self._prepared += written(self._frame.put(x, y, strip), self.console)

    def display_prepared(self, screen: Screen[Any]) -> None:
        """Write the pieces of a frame."""
        if not self._batch_count and (text := self._take_prepared()):
            super()._display(screen, Written(text))  # type: ignore[arg-type]

    def _take_prepared(self) -> str:
        text = "".join(self._prepared)
        self._prepared.clear()
        return text

    def _display(self, screen: Screen[Any], renderable: RenderableType | None) -> None:
        if isinstance(renderable, LayoutUpdate | ChopsUpdate) and not self._batch_count:
            difference = Difference(renderable, self._frame, self.size)
            super()._display(screen, Written(self._take_prepared(), difference))  # type: ignore[arg-type]
        else:
            super()._display(screen, renderable)


class KeyWatch(QuietApp):
    """An app that sees every key first, also those that a binding or a dialog takes.

    `App.on_event` receives an input event once from the driver and again when it bubbles up; only the first counts.
    """

    def key_arrived(self, event: events.Key, together: bool | None) -> None:
        """Called for each key before anything acts on it.

        `together`: whether it came in one piece with other keys, as a paste does; None: nobody knows (tests).
        """

    def passes(self, event: events.Event) -> bool:
        """Whether an event of the keyboard or the mouse may go on; asked once for each, keys having been seen."""
        return True

    def takes(self, event: events.Key) -> bool:
        """Carry out a key at once that nothing else could want; False: it takes its usual way."""
        return False

    async def on_event(self, event: events.Event) -> None:
        if isinstance(event, events.InputEvent | events.Paste) and not event.is_forwarded:
            if isinstance(event, events.Key):
                self.key_arrived(event, read_together(event))
            if not self.passes(event) or (isinstance(event, events.Key) and self.takes(event)):
                return
        await super().on_event(event)
