"""An app that writes only what differs, and sees every key first."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rich.console import RenderableType
from textual import events
from textual._compositor import ChopsUpdate, LayoutUpdate
from textual.app import App
from textual.message import Message
from textual.message_pump import MessagePump
from textual.messages import Prompt, Update
from textual.screen import Screen
from textual.strip import Strip

from rise_tui.quiet.difference import Difference, Written, written
from rise_tui.quiet.ears import read_together
from rise_tui.quiet.frame import Frame

_SEEN = "_seen_first"
_NO_MATTER = (Update, Prompt)
"""Only to paint, or to look whether there is something to do."""


def is_busy(pump: MessagePump) -> bool:
    """Whether anything waits for a widget, or for the app, that a key must not overtake."""
    waiting: Iterable[Message | None] = pump._message_queue.values
    return any(not isinstance(message, _NO_MATTER) for message in waiting)


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

    _dispatching = 0
    """Messages in the midst of which the app is."""

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

    def key_read(self, event: events.Key) -> bool:
        """A key straight from the terminal; whether nothing is left to do about it.

        Its way through the app's queue takes a turn of the loop, in which others have theirs. It need not go there when
        nothing is before it.
        """
        if not self._running or self._dispatching or is_busy(self):
            return False
        event.__dict__[_SEEN] = True
        try:
            return self._is_done_with(event)
        except Exception as error:  # as Textual does about those in its own turns
            self._handle_exception(error)
            return True

    def _is_done_with(self, event: events.InputEvent | events.Paste) -> bool:
        if isinstance(event, events.Key):
            self.key_arrived(event, read_together(event))
        return not self.passes(event) or (isinstance(event, events.Key) and self.takes(event))

    async def on_event(self, event: events.Event) -> None:
        if (
            isinstance(event, events.InputEvent | events.Paste)
            and not event.is_forwarded
            and _SEEN not in event.__dict__
            and self._is_done_with(event)
        ):
            return
        await super().on_event(event)

    async def _dispatch_message(self, message: Message) -> None:
        self._dispatching += 1
        try:
            await super()._dispatch_message(message)
        finally:
            self._dispatching -= 1
