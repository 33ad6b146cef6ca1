"""Something to read in full, over the console: a task of the log, a long value. Its letters do what they say there."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Vertical

from rise_tui.rendering.modal import SingleDismissModal
from rise_tui.rendering.text import ListRow
from rise_tui.widgets.row_list import RowList, RowView

AGAIN = 0.5
"""Seconds between two looks at what may have changed."""


class DetailScreen(SingleDismissModal[str]):
    """Shows rows until it is left; the result is the letter that was pressed, empty for none.

    `steps`: whether left and right go to the one before and after; they are told to `step`.
    """

    DEFAULT_CSS = """
    DetailScreen {
        align: center middle; background: transparent;
        #box { width: 100; max-width: 96%; height: auto; max-height: 80%; padding: 0 1; background: $panel;
               border: round $primary; border-title-color: $foreground; border-title-style: bold; }
        RowList { height: auto; max-height: 100%; background: $panel; }
    }
    """

    def __init__(
        self,
        title: str,
        rows: Callable[[int], Sequence[ListRow]],
        letters: Sequence[tuple[str, str]] = (),
        step: Callable[[int], None] | None = None,
    ) -> None:
        """`rows` makes them for a width; `letters` are keys with what they do, in a word or two."""
        super().__init__()
        self._title, self._make = title, rows
        self._letters, self._step = dict(letters), step
        self.list = RowList(id="reading-rows")

    def compose(self) -> ComposeResult:
        box = Vertical(id="box")
        box.border_title = f" {self._title} "
        steps = ["←→ others"] if self._step is not None else []
        letters = [f"{key} {does}" for key, does in self._letters.items()]
        box.border_subtitle = f" {' · '.join(['esc closes', *steps, *letters])} "
        with box:
            yield self.list

    def on_mount(self) -> None:
        self.set_focus(self.list)
        self.set_interval(AGAIN, self._draw)
        self.call_after_refresh(self._draw)

    @on(RowView.Resized)
    def _draw(self) -> None:
        if (width := self.list.row_width) > 0:
            rows = [row._replace(selectable=False) for row in self._make(width)]
            self.list.styles.height = len(rows)
            self.list.show(rows)

    def on_key(self, event: events.Key) -> None:
        if event.key in ("escape", "enter"):
            self.dismiss("")
        elif event.key in self._letters:
            self.dismiss(event.key)
        elif event.key in ("left", "right") and self._step is not None:
            self._step(-1 if event.key == "left" else 1)
            self._draw()
        else:
            return
        event.stop()
        event.prevent_default()
