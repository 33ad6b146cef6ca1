"""The screen of a window that is too small for a console: the size that it needs, and that stopping still works."""

from __future__ import annotations

from textual import events
from textual.app import App, ComposeResult
from textual.geometry import Size

from rise_tui.key_labels import key_name
from rise_tui.model.alarms import current_alarms
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, crop, wrap
from rise_tui.screens.dialog import SingleDismissModal
from rise_tui.widgets.lines import StaticLines

REFRESH_SECONDS = 0.5
LEAST_SIZE = (70, 20)
"""Columns and rows below which nothing is readable."""


def is_too_small(width: int, height: int) -> bool:
    """Whether a terminal is too small for a console."""
    return width < LEAST_SIZE[0] or height < LEAST_SIZE[1]


def too_small_lines(size: Size, store: Store | None) -> list[StyledLine]:
    """Sentences in the available room, the most important first."""
    alarms = current_alarms(store, key_name) if store is not None else []
    head: list[StyledLine] = [crop(alarms[0].head, size.width)] if alarms else []
    stop, leave = key_name("stop"), key_name("quit")
    sentences = [
        f"This window has {size.width} x {size.height} cells; the console needs {LEAST_SIZE[0]} x {LEAST_SIZE[1]}.",
        f"{stop} stops everything, {leave} leaves. No other key works here.",
        f"{'The session goes on. ' if store is not None else ''}Make the window larger or the font smaller.",
    ]
    lines: list[StyledLine] = [((line, "plain"),) for text in sentences for line in wrap(text, max(8, size.width))]
    return [*head, *lines][: size.height]


class TooSmallScreen(SingleDismissModal[None]):
    """Covers everything until the window is large enough."""

    DEFAULT_CSS = """
    TooSmallScreen { background: $background; }
    TooSmallScreen StaticLines { height: 100%; }
    """

    def __init__(self, store: Store | None) -> None:
        """`store`: of the running session; None without one."""
        super().__init__()
        self._store = store
        self.lines = StaticLines()

    def compose(self) -> ComposeResult:
        yield self.lines

    def on_mount(self) -> None:
        self.set_interval(REFRESH_SECONDS, self._draw)

    def _draw(self) -> None:
        size = self.app.size
        if is_too_small(*size):
            self.lines.show(*too_small_lines(size, self._store))
        else:
            self.dismiss(None)  # has no effect below a question, which is answered first

    def on_resize(self) -> None:
        self._draw()

    def on_screen_resume(self) -> None:
        self._draw()

    def on_key(self, event: events.Key) -> None:
        event.stop()
        event.prevent_default()


def show_when_too_small(app: App[object], store: Store | None) -> None:
    """Say what is needed when the window is too small for a console. `store`: None while no session runs."""
    if is_too_small(*app.size) and not any(isinstance(screen, TooSmallScreen) for screen in app.screen_stack):
        app.push_screen(TooSmallScreen(store))
