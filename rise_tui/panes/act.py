"""One act: its graph by levels, what runs now, and each action's parameters with the memory filled in."""

from __future__ import annotations

from collections.abc import Sequence

from textual import on
from textual.widget import Widget

from rise_tui.actions import bindings
from rise_tui.model.act_text import ActText, running, shown
from rise_tui.model.store import Store
from rise_tui.panes.pane import ListPane
from rise_tui.text import Row, crop
from rise_tui.widgets.line import Lines
from rise_tui.widgets.rows import RowView

DETAILS = 5
"""Lines for the parameters of the selected action."""


class Details(Lines):
    DEFAULT_CSS = f"""
    Details {{ height: {DETAILS}; max-height: 40%; background: $surface; }}
    """


class ActPane(ListPane):
    """The act that started last, or the one that the wizard selected since; free speech too, while it is the newest."""

    PLACE = "act"
    BINDINGS = bindings("act")
    TITLE = "Act"
    TOPICS = frozenset({"acts", "memory"})
    EMPTY = "select an act in the list of acts, or start one"

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.details = Details(id="act-details")
        self._text = ActText(store)

    def body(self) -> Sequence[Widget]:
        return [self.list, self.details]

    def do(self, action: str) -> None:
        """This pane has no actions of its own."""

    def make_rows(self, width: int) -> list[Row]:
        what = shown(self.store)
        return self._text.rows(what, width) if what is not None else []

    def repaint(self) -> None:
        super().repaint()
        if not self.list.has_focus and (newest := running(self.store)):  # with the focus, the wizard looks around
            self.list.select(newest)
        self._show_details()

    @on(RowView.Moved)
    def _moved(self, event: RowView.Moved) -> None:
        event.stop()
        self._show_details()

    def _show_details(self) -> None:
        what = shown(self.store)
        width, height = self.details.size.width, self.details.size.height
        lines = self._text.details(what, self.list.current, width) if what is not None and height else []
        if len(lines) > height:
            lines[height - 1 :] = [((f" and {len(lines) - height + 1} more lines", "muted"),)]
        self.details.show(*(crop(line, width) for line in lines))
