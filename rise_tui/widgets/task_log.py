"""The log's rows: made only when they come into view."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Callable, Sequence

from textual import events
from textual.geometry import Size
from textual.message import Message
from textual.strip import Strip

from rise_engine.kernel.view import TaskView
from rise_tui.model.control import short_name
from rise_tui.model.log_rows import NOTE, ROBOT, task_of
from rise_tui.model.states import NOT_TAKEN, StateLabel, task_state
from rise_tui.model.task_messages import FUNCTION_LABELS
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    TextRole,
    cell_width,
    crop,
    fit,
    fixed_span,
    format_clock,
    format_seconds,
    line_width,
)
from rise_tui.widgets.row_list import RowView

CALLING = {"Blocking": "block", "None": "none", "": ""}
NARROW = 56
TIME, FUNCTION, STATE = 7, 8, 11
"""Columns of a narrow row; what was done has the rest."""
BRIEF = {"stopAll": "STOP", "stopCommunicationRobotAct": "stop", "stopInteractionRule": "stop"}
"""Functions in a word, for narrow rows."""
REASON = 10
"""A reason that would have less room than this stays out of the row."""
KEPT = 500
"""Rows that are kept as painted."""
WIDE = 96
"""From this width on, times have tenths and calling types have a column."""


class TaskLog(RowView):
    """A window on a list of rows (see `model.log_rows`)."""

    class FollowChanged(Message):
        """It follows, or has stopped following, the newest task."""

    def __init__(
        self, task: Callable[[int], TaskView | None], missed: Sequence[int] = (), *, id: str | None = None
    ) -> None:
        """`missed` is the caller's list of tasks whose event nobody took; it only grows."""
        super().__init__(id=id)
        self._missed, self._missed_ids = missed, set(missed)
        self.following = True
        self.decorate: Callable[[StyledLine], StyledLine] = lambda line: line
        """Puts on a row what is to be seen in it besides: what a filter found."""
        self._find = task
        self._ids: Sequence[int] = ()
        self._shown = 0
        self._seen = 0
        self._painted: dict[int, tuple[object, StyledLine]] = {}
        """The rows as they were painted, by index: what they were made of, and the line."""

    @property
    def count(self) -> int:
        return self._shown

    @property
    def ids(self) -> Sequence[int]:
        """The rows shown."""
        return self._ids

    @property
    def unseen(self) -> int:
        """Tasks that came while it was paused."""
        return max(0, self._shown - self._seen)

    def row_at(self, index: int) -> ListRow:
        return self._row(index, self.row_width)

    def _row(self, index: int, width: int) -> ListRow:
        row = self._ids[index]
        task = self._find(row)
        if task is None:
            what = f"task {task_of(row)}" if task_of(row) is not None else "this note"
            return ListRow(str(row), ((f" {what} is in the journal only", "muted"),))
        return ListRow(str(row), self.decorate(self.line_of(task, width)))

    def render_line(self, y: int) -> Strip:
        index = y + self.scroll_offset.y
        if not 0 <= index < self._shown:
            return self.to_strip((), self.line_width)
        painted = self._painted.get(index)
        if painted is None:
            if len(self._painted) > KEPT:  # scrolled through for a while, and nothing new came
                self._painted.clear()
            width = self.row_width
            painted = self._painted[index] = self._made_of(index, width), self._row(index, width).line
        return self.to_strip(painted[1], self.line_width, self.background_of(index))

    def on_resize(self, event: events.Resize) -> None:
        self._painted.clear()

    def show(self, ids: Sequence[int], *, restart: bool = False) -> None:
        """Show these rows, ascending. A list that was shown before has only grown at its end, unless `restart`.

        Of another list, what was in view stays in view, and the cursor stays on its task.
        """
        self._missed_ids.update(self._missed[len(self._missed_ids) :])
        if restart:
            self._missed_ids = set(self._missed)
        if restart or ids is not self._ids:
            self._change(ids)
        else:
            self._shown = len(ids)
            self.set_content_size(Size(self.row_width, self._shown))
        top = self.scroll_offset.y
        if self.following:
            self._to_end()
        self._repaint_changed(scrolled=self.scroll_offset.y != top)

    def _change(self, ids: Sequence[int]) -> None:
        """Another list. The one before may have been emptied by its owner."""
        old, top, unseen = self._ids, self.scroll_offset.y, self.unseen
        selected = old[self.cursor] if 0 <= self.cursor < min(self._shown, len(old)) else None
        first = old[top] if 0 <= top < min(self._shown, len(old)) else None
        self._ids, self._shown = ids, len(ids)
        self.cursor = -1 if selected is None else min(bisect_left(ids, selected), self._shown - 1)
        self.set_content_size(Size(self.row_width, self._shown))
        self._seen = max(0, self._shown - unseen)
        if not self.following and first is not None:
            self.scroll_to(y=bisect_left(ids, first), animate=False)
        self._painted.clear()
        self.refresh()

    def _repaint_changed(self, *, scrolled: bool) -> None:
        """Only rows that look different cost anything; those are made when they are painted, a few at a time.

        `scrolled`: all of them are painted anyway.
        """
        top, width = self.scroll_offset.y, self.row_width  # which takes longer to find out than all else about a row
        before, self._painted = self._painted, {}
        gone = [index for index in before if index >= self._shown]
        for index in range(top, min(self._shown, top + self.size.height)):
            if index in before and before[index][0] == self._made_of(index, width):
                self._painted[index] = before[index]
            elif not scrolled:
                self.refresh_line(index)
        for index in gone:
            self.refresh_line(index)

    def _made_of(self, index: int, width: int) -> object:
        """All that a row depends on."""
        id = self._ids[index]
        task = self._find(id)
        if task is None:
            return id
        looks = task.status, task.reason, task.mark, task.started, task.ended, task.id in self._missed_ids
        return id, width, looks

    def action_edge(self, direction: int) -> None:
        if direction > 0:
            self.follow_newest()
        else:
            super().action_edge(direction)

    def go_to(self, index: int) -> None:
        """Put the cursor on a row, in the middle of the view."""
        self.move_cursor(index, by_wizard=False)
        self.scroll_to(y=max(0, index - self.size.height // 2), animate=False)

    def follow_newest(self) -> None:
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

    def state_label(self, task: TaskView) -> StateLabel:
        return NOT_TAKEN if task.id in self._missed_ids else task_state(task)

    def filter_text(self, id: int) -> str | None:
        """What a filter looks at: all that the widest row could show. None for a task that is in the journal only."""
        task = self._find(id)
        if task is None:
            return None
        function = FUNCTION_LABELS.get(task.function, task.function)
        return (
            f"{format_clock(task.submitted, tenths=True)} {task.source} {function} {task.calling_type} {task.behavior} "
            f"{self.state_label(task).word} {mistake_text(task)}{task.reason}"
        )

    def line_of(self, task: TaskView, width: int) -> StyledLine:
        """One row in one line."""
        if task.function == NOTE:
            return self._note(task, width)
        state = self.state_label(task)
        function = FUNCTION_LABELS.get(task.function, task.function)
        took = format_seconds(task.ended - task.started) if task.ended is not None and task.started is not None else ""
        tone: TextRole = "fault" if task.function == "stopAll" else "plain"
        tail: StyledLine = ((f" {state.glyph} ", state.tone), fixed_span(state.word, 9, state.tone))
        reason: StyledLine = ((f"  {task.reason}", state.tone),) if task.reason else ()
        if width < NARROW:
            return self._narrow(task, state, function, tone, width)
        wide = width >= WIDE
        when = 11 if wide else 9
        rest = width - when - 29 - (7 if wide else 0)
        source = min(20, max(12, rest // 3))
        behavior = min(40, rest - source - (20 if wide else 0))
        mistake: StyledLine = ((" ", "plain"), fixed_span(mistake_text(task), 8, "wait")) if task.mark else ()
        calling: StyledLine = (
            (fixed_span(CALLING.get(task.calling_type, task.calling_type), 7, "muted"),) if wide else ()
        )
        head: StyledLine = (
            fixed_span(f" {format_clock(task.submitted, tenths=wide)}", when + 1, "muted"),
            fixed_span(task.source, source - 1, "muted"),
            (" ", "plain"),
            fixed_span(function, 10, tone),
            *calling,
        )
        line: StyledLine = (
            *head,
            fixed_span(_name(task), max(6, behavior - (9 if mistake else 0))),
            *mistake,
            *tail,
            fixed_span(took, 6, right=True),
        )
        if not reason:
            return line
        if width - line_width(line) >= REASON:
            return crop((*line, *reason), width)
        return crop((*head, *_wrong(task, state, width - line_width(head))), width) if _is_bad(task, state) else line

    def _narrow(self, task: TaskView, state: StateLabel, function: str, tone: TextRole, width: int) -> StyledLine:
        """Without who it was. Of what went wrong the reason follows, as far as there is room."""
        word = BRIEF.get(task.function, function)
        what = fixed_span(mistake_text(task), FUNCTION, "wait") if task.mark else fixed_span(word, FUNCTION, tone)
        head: StyledLine = (fixed_span(f" {short_clock(task.submitted)}", TIME, "muted"), what)
        room = width - TIME - FUNCTION
        if _is_bad(task, state):
            return crop((*head, *_wrong(task, state, room)), width)
        name = fixed_span(_name(task) or short_name(task.source), room - STATE)
        return (*head, name, (f" {state.glyph} ", state.tone), fixed_span(state.word, STATE - 3, state.tone))

    def _note(self, task: TaskView, width: int) -> StyledLine:
        """Who wrote it, and the text over all the room that there is."""
        who = short_name(task.source)
        if width < NARROW:
            head: StyledLine = (
                fixed_span(f" {short_clock(task.submitted)}", TIME, "muted"),
                fixed_span("note", FUNCTION),
            )
            return crop((*head, (f"{who}: ", "muted"), (task.behavior, "strong")), width)
        wide = width >= WIDE
        when = 11 if wide else 9
        source = min(20, max(12, (width - when - 29 - (7 if wide else 0)) // 3))
        head = (
            fixed_span(f" {format_clock(task.submitted, tenths=wide)}", when + 1, "muted"),
            fixed_span(task.source, source - 1, "muted"),
            (" ", "plain"),
            fixed_span("note", 10),
        )
        return crop((*head, (task.behavior, "strong")), width)


def _name(task: TaskView) -> str:
    """What was done; of the robot its link, whose state says the rest."""
    return "link" if task.function == ROBOT else task.behavior


def _is_bad(task: TaskView, state: StateLabel) -> bool:
    return bool(task.reason) and state.tone in ("fault", "wait")


def _wrong(task: TaskView, state: StateLabel, room: int) -> StyledLine:
    """What went wrong and why, where a reason has no column of its own."""
    word, name = f"{state.glyph} {state.word}", _name(task) or short_name(task.source)
    shown = fit(name, min(cell_width(name), max(6, room - len(word) - 1))).rstrip()
    return ((f"{shown} ", "plain"), (word, state.tone), (f": {task.reason}", state.tone))


def short_clock(value: float) -> str:
    """Session time in few cells: ` 4:05`, `74:05`."""
    minutes, rest = divmod(int(max(0.0, value)), 60)
    return f"{minutes:2}:{rest:02}"


def mistake_text(task: TaskView) -> str:
    """A mistake that somebody marked, in a word: `! late `."""
    return f"! {task.mark} " if task.mark else ""
