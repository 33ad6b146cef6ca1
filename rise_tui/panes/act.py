"""One act: its graph by levels, what runs now, and each action's parameters with the memory filled in."""

from __future__ import annotations

from collections.abc import Sequence

from textual import on
from textual.widget import Widget

from rise_tui.actions import bindings_in
from rise_tui.model.act_text import ActText, running_action, shown_act
from rise_tui.model.store import Store
from rise_tui.panes.pane import ListPane
from rise_tui.rendering.text import ListRow, crop
from rise_tui.widgets.row_list import RowView
from rise_tui.widgets.static_lines import StaticLines

DETAILS = 5
"""Lines for the parameters of the selected action."""


class ActionDetails(StaticLines):
    DEFAULT_CSS = f"""
    ActionDetails {{ height: {DETAILS}; max-height: 40%; background: $surface; }}
    """


class ActPane(ListPane):
    """The act that started last, or that the wizard selected since; free speech while that is the newest."""

    SCOPE = "act"
    BINDINGS = bindings_in("act")
    TITLE = "Act"
    PARTS = frozenset({"acts", "memory"})
    EMPTY = "select an act in the list of acts, or start one"

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.details = ActionDetails(id="act-details")
        self._text = ActText(store)

    def body_widgets(self) -> Sequence[Widget]:
        return [self.row_list, self.details]

    def make_rows(self, width: int) -> list[ListRow]:
        shown = shown_act(self.store)
        return self._text.rows(shown, width) if shown is not None else []

    def repaint(self) -> None:
        super().repaint()
        newest = running_action(self.store)
        if newest and not self.row_list.has_focus:  # with the focus, the wizard moves the cursor
            self.row_list.select(newest)
        self._show_details()

    @on(RowView.CursorMoved)
    def _cursor_moved(self, event: RowView.CursorMoved) -> None:
        event.stop()
        self._show_details()

    def _show_details(self) -> None:
        shown = shown_act(self.store)
        width, height = self.details.size.width, self.details.size.height
        lines = self._text.details(shown, self.row_list.current_id, width) if shown is not None and height else []
        if len(lines) > height:
            lines[height - 1 :] = [((f" and {len(lines) - height + 1} more lines", "muted"),)]
        self.details.show(*(crop(line, width) for line in lines))
