"""The log's rows, made only when they become visible."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence

from textual import events
from textual.geometry import Size
from textual.message import Message
from textual.strip import Strip

from rise_tui.rendering.text import ListRow, StyledLine
from rise_tui.widgets.lines import RowView


class TaskLog(RowView):
    """A view of a list of rows (see `model.log_rows`)."""

    class FollowChanged(Message):
        """The log follows, or no longer follows, the newest task."""

    def __init__(self, make_line: Callable[[int, int], StyledLine], *, id: str | None = None) -> None:
        """`make_line`: the text of a row in a number of cells."""
        super().__init__(id=id)
        self._make_line = make_line
        self.following = True
        self.ids: Sequence[int] = ()
        """The shown rows."""
        self._shown = 0
        self._seen = 0
        self._lines: dict[int, StyledLine] = {}
        """The visible lines at the last `show`, by index."""

    @property
    def count(self) -> int:
        return self._shown

    @property
    def unseen(self) -> int:
        """The number of tasks that arrived while it was paused."""
        return max(0, self._shown - self._seen)

    def row_at(self, index: int) -> ListRow:
        return ListRow(str(self.ids[index]), self._make_line(self.ids[index], self.row_width))

    def render_line(self, y: int) -> Strip:
        index = y + self.scroll_offset.y
        if not 0 <= index < self._shown:
            return self.to_strip((), self.size.width)
        line = self._lines.get(index) or self._make_line(self.ids[index], self.row_width)
        return self.row_strip(index, line)

    def on_resize(self, event: events.Resize) -> None:
        self._lines.clear()

    def show(self, ids: Sequence[int], *, restart: bool = False) -> None:
        """Show these ascending rows. A list that was shown before has only grown at its end, unless `restart`.

        With another list, the visible rows stay visible, and the cursor stays on its task.
        """
        if restart or ids is not self.ids:
            self._show_other_list(ids)
        else:
            self._shown = len(ids)
            self.virtual_size = Size(self.row_width, self._shown)
        top = self.scroll_offset.y
        if self.following:
            self._scroll_to_end()
        self._repaint_changed(scrolled=self.scroll_offset.y != top)

    def _show_other_list(self, ids: Sequence[int]) -> None:
        """Show another list. Its owner may have emptied the previous one."""
        old, top, unseen = self.ids, self.scroll_offset.y, self.unseen
        selected = old[self.cursor] if 0 <= self.cursor < min(self._shown, len(old)) else None
        first = old[top] if 0 <= top < min(self._shown, len(old)) else None
        self.ids, self._shown = ids, len(ids)
        self.cursor = -1 if selected is None else min(bisect_left(ids, selected), self._shown - 1)
        self.virtual_size = Size(self.row_width, self._shown)
        self._seen = max(0, self._shown - unseen)
        if not self.following and first is not None:
            self.scroll_to(y=bisect_left(ids, first), animate=False)
        self._lines.clear()
        self.refresh()

    def _repaint_changed(self, *, scrolled: bool) -> None:
        """Repaint only rows that look different. `scrolled`: all of them are painted anyway."""
        top, width = self.scroll_offset.y, self.row_width
        before, self._lines = self._lines, {}
        for index in range(top, min(self._shown, top + self.size.height)):
            line = self._lines[index] = self._make_line(self.ids[index], width)
            if not scrolled and before.get(index) != line:
                self.refresh_line(index)
        for index in before:
            if index >= self._shown:
                self.refresh_line(index)

    def action_edge(self, direction: int) -> None:
        if direction > 0:
            self.follow_newest()
        else:
            super().action_edge(direction)

    def go_to(self, index: int) -> None:
        """Put the cursor on a row, and the row in the middle of the view."""
        self.move_cursor(index, by_wizard=False)
        self.scroll_to(y=max(0, index - self.size.height // 2), animate=False)

    def follow_newest(self) -> None:
        """Go to the newest task and stay there."""
        self._set_following(True)
        self._scroll_to_end()

    def _scroll_to_end(self) -> None:
        self._seen = self._shown
        if self.cursor != self._shown - 1:
            before, self.cursor = self.cursor, self._shown - 1
            self._refresh_row(before)
            self._refresh_row(self.cursor)
        self.scroll_to(y=max(0, self._shown - self.size.height), animate=False)

    def move_cursor(self, index: int, *, by_wizard: bool = True) -> None:
        super().move_cursor(index, by_wizard=by_wizard)
        self._set_following(self.cursor >= self._shown - 1)

    def watch_scroll_y(self, old_value: float, new_value: float) -> None:
        super().watch_scroll_y(old_value, new_value)
        if new_value < old_value and round(new_value) < self._shown - self.size.height:
            self._set_following(False)
        elif round(new_value) >= self._shown - self.size.height:
            self._seen = self._shown

    def _set_following(self, following: bool) -> None:
        if following != self.following:
            self.following = following
            self._seen = self._shown
            self.post_message(self.FollowChanged())
