"""What a window shows that is too small for a console: what is needed, and that stopping still works."""

from __future__ import annotations

from textual import events
from textual.app import ComposeResult
from textual.geometry import Size

from rise_tui.actions import key_in_words
from rise_tui.model.alarms import alarms
from rise_tui.model.store import Store
from rise_tui.rendering.modal import SingleDismissModal
from rise_tui.text import Line, crop, wrap
from rise_tui.widgets.line import Lines

TICK = 0.5
LEAST = (70, 20)
"""Columns and rows below which nothing could be read."""


def too_small(width: int, height: int) -> bool:
    """Whether a terminal has no room for a console."""
    return width < LEAST[0] or height < LEAST[1]


def lines_for(size: Size, store: Store) -> list[Line]:
    """Sentences in whatever room there is, the most important first."""
    found = alarms(store, key_in_words)
    head: list[Line] = [crop(found[0].head, size.width)] if found else []
    stop, leave = key_in_words("stop"), key_in_words("quit")
    said = [
        f"This window has {size.width} x {size.height} cells; the console needs {LEAST[0]} x {LEAST[1]}.",
        f"{stop} stops everything, {leave} leaves. No other key does anything here.",
        "The session goes on. Make the window larger, or its letters smaller.",
    ]
    told: list[Line] = [((line, "plain"),) for text in said for line in wrap(text, max(8, size.width))]
    return [*head, *told][: size.height]


class SmallScreen(SingleDismissModal[None]):
    """Lies over everything until the window is large enough."""

    DEFAULT_CSS = """
    SmallScreen { background: $background; }
    SmallScreen Lines { height: 100%; }
    """

    def __init__(self, store: Store) -> None:
        super().__init__()
        self._store = store
        self.said = Lines()

    def compose(self) -> ComposeResult:
        yield self.said

    def on_mount(self) -> None:
        self.set_interval(TICK, self._draw)

    def _draw(self) -> None:
        size = self.app.size
        if too_small(*size):
            self.said.show(*lines_for(size, self._store))
        elif self.app.screen is self:  # not below a question, which is answered first
            self.dismiss(None)

    def on_resize(self) -> None:
        self._draw()

    def on_screen_resume(self) -> None:
        self._draw()

    def on_key(self, event: events.Key) -> None:
        event.stop()
        event.prevent_default()
