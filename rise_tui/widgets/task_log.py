"""The task log's rows: made only when they come into view."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence

from textual.geometry import Size
from textual.message import Message

from rise_engine.kernel.records import FINAL
from rise_engine.view import TaskView
from rise_tui.states import NOT_TAKEN, task_state
from rise_tui.store import FUNCTION_WORDS
from rise_tui.text import Line, Row, Tone, cell, clock, crop, seconds, width_of
from rise_tui.widgets.rows import RowView

CALLING = {"Blocking": "block", "None": "none", "": ""}
NARROW = 56
REASON = 10
"""A reason that would have less room than this stays out of the row."""
WIDE = 96
"""From this width on, times have tenths and calling types have a column."""


class TaskLog(RowView):
    """A window on a list of task ids."""

    class FollowChanged(Message):
        """It follows, or has stopped following, the newest task."""

    def __init__(
        self, task: Callable[[int], TaskView | None], missed: Sequence[int] = (), *, id: str | None = None
    ) -> None:
        """`missed` is the caller's list of tasks whose event nobody took; it only grows."""
        super().__init__(id=id)
        self._missed, self._missed_ids = missed, set(missed)
        self.following = True
        self._find = task
        self._ids: Sequence[int] = ()
        self._shown = 0
        self._seen = 0
        self._lively: dict[int, int] = {}
        """Rows of tasks that have not ended, by id: the only ones that can still change."""

    @property
    def count(self) -> int:
        return self._shown

    @property
    def unseen(self) -> int:
        """Tasks that came while it was paused."""
        return max(0, self._shown - self._seen)

    def row_at(self, index: int) -> Row:
        task = self._find(self._ids[index])
        if task is None:
            return Row(str(self._ids[index]), ((f" task {self._ids[index]} is in the journal only", "muted"),))
        return Row(str(task.id), self.line_of(task, self.row_width))

    def show(self, ids: Sequence[int], *, restart: bool = False) -> None:
        """Show these tasks. `ids` is the caller's list, which only grows; when it is another one: `restart`."""
        self._ids = ids
        old = 0 if restart else self._shown
        self._shown = len(ids)
        for index in list(self._lively.values()):
            self.refresh_line(index)
        for one in self._missed[len(self._missed_ids) :]:
            self._missed_ids.add(one)
            index = bisect_left(ids, one)
            if index < old and ids[index] == one:
                self.refresh_line(index)
        if restart:
            self._lively.clear()
            self.cursor = min(self.cursor, self._shown - 1)
            self.refresh()
        self._lively = {one: index for one, index in self._lively.items() if self._lives(one)}
        self._lively |= {ids[index]: index for index in range(old, self._shown) if self._lives(ids[index])}
        self.resize_content(Size(self.row_width, self._shown))
        if self.following:
            self._to_end()
        for index in range(max(old, self.scroll_offset.y), min(self._shown, self.scroll_offset.y + self.size.height)):
            self.refresh_line(index)

    def forget_missed(self) -> None:
        """The caller has emptied its list of missed tasks."""
        self._missed_ids = set(self._missed)

    def action_edge(self, direction: int) -> None:
        if direction > 0:
            self.follow()
        else:
            super().action_edge(direction)

    def follow(self) -> None:
        """Go to the newest task and stay there."""
        self._set_following(True)
        self._to_end()

    def _to_end(self) -> None:
        self._seen = self._shown
        if self.cursor != self._shown - 1:
            before, self.cursor = self.cursor, self._shown - 1
            self._refresh_row(before)
            self._refresh_row(self.cursor)
        self.scroll_to(y=max(0, self._shown - self.size.height), animate=False)

    def _lives(self, id: int) -> bool:
        task = self._find(id)
        return task is not None and task.status not in FINAL

    def move_to(self, index: int, *, by_wizard: bool = True) -> None:
        super().move_to(index, by_wizard=by_wizard)
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

    def line_of(self, task: TaskView, width: int) -> Line:
        """One task in one line."""
        state = NOT_TAKEN if task.id in self._missed_ids else task_state(task)
        function = FUNCTION_WORDS.get(task.function, task.function)
        took = seconds(task.ended - task.started) if task.ended is not None and task.started is not None else ""
        tone: Tone = "fault" if task.function == "stopAll" else "plain"
        tail: Line = ((f" {state.glyph} ", state.tone), cell(state.word, 9, state.tone))
        reason: Line = ((f"  {task.reason}", state.tone),) if task.reason else ()
        if width < NARROW:
            head: Line = (cell(f" {clock(task.submitted)}", 10, "muted"), cell(function, 10, tone))
            return crop((*head, cell(task.behavior, max(6, width - 32)), *tail, *reason), width)
        wide = width >= WIDE
        when = 11 if wide else 9
        rest = width - when - 29 - (7 if wide else 0)
        source = min(20, max(12, rest // 3))
        behavior = min(40, rest - source - (20 if wide else 0))
        calling: Line = (cell(CALLING.get(task.calling_type, task.calling_type), 7, "muted"),) if wide else ()
        line: Line = (
            cell(f" {clock(task.submitted, tenths=wide)}", when + 1, "muted"),
            cell(task.source, source - 1, "muted"),
            (" ", "plain"),
            cell(function, 10, tone),
            *calling,
            cell(task.behavior, behavior),
            *tail,
            cell(took, 6, right=True),
        )
        room = width - width_of(line)
        return crop((*line, *reason), width) if room >= REASON else line
