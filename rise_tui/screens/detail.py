"""A full text over the console: a task of the log, a long value. Its letters are the keys that it shows."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from textual import events, on
from textual.app import ComposeResult

from rise_tui.rendering.modal import SingleDismissModal, TitledBox
from rise_tui.rendering.text import ListRow
from rise_tui.widgets.row_list import RowList, RowView

REFRESH_SECONDS = 0.5
"""Seconds until a changed row is shown."""


class DetailScreen(SingleDismissModal[str]):
    """Shows rows until the wizard leaves; the result is the pressed letter, empty for none."""

    DEFAULT_CSS = """
    DetailScreen {
        align: center middle; background: transparent;
        #box { width: 100; max-height: 80%; border-title-color: $foreground; }
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
        """`rows` makes the rows for a width. `letters`: keys with what they do, in a word or two.

        `step`: goes to the previous (-1) or next (1) text, with the left and right arrows; without it there is only
        one.
        """
        super().__init__()
        self._title, self._make_rows = title, rows
        self._letters, self._step = dict(letters), step
        self.list = RowList(id="reading-rows")

    def compose(self) -> ComposeResult:
        steps = ["←→ others"] if self._step is not None else []
        letters = [f"{key} {does}" for key, does in self._letters.items()]
        with TitledBox(self._title, " · ".join(["esc closes", *steps, *letters])):
            yield self.list

    def on_mount(self) -> None:
        self.set_focus(self.list)
        self.set_interval(REFRESH_SECONDS, self._draw)
        self.call_after_refresh(self._draw)

    @on(RowView.Resized)
    def _draw(self) -> None:
        if (width := self.list.row_width) > 0:
            rows = [row._replace(selectable=False) for row in self._make_rows(width)]
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
