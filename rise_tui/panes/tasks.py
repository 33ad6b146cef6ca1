"""The panes of tasks: the graph of one act, and the running and waiting tasks with their probable times."""

from __future__ import annotations

from collections.abc import Sequence

from textual import on
from textual.widget import Widget

from rise_engine.kernel.task_view import TaskView
from rise_tui.actions import bindings_in
from rise_tui.model.act_text import ActText, running_action, shown_act
from rise_tui.model.log_text import task_rows
from rise_tui.model.notice import act_label
from rise_tui.model.states import SENT, act_progress, task_state
from rise_tui.model.store import Store
from rise_tui.model.upcoming import QueuedTask, estimate_starts
from rise_tui.panes.pane import ListPane
from rise_tui.rendering.text import ListRow, StyledLine, StyledSpan, crop, fixed_span, format_duration, format_seconds
from rise_tui.screens.reading import DetailScreen
from rise_tui.widgets.lines import RowView, StaticLines

DETAILS = 5
"""Lines for the parameters of the selected action."""


class ActionDetails(StaticLines):
    DEFAULT_CSS = f"""
    ActionDetails {{ height: {DETAILS}; max-height: 40%; background: $surface; }}
    """


class ActPane(ListPane):
    """The act that started last, or that the wizard has selected since; free speech while that is the newest."""

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


NARROW = 56
"""Below this width, only a running task's remaining time is shown."""
WIDE = 74
"""Minimum width for the source of a task."""


class SchedulerPane(ListPane):
    """Running acts, then waiting ones, next first."""

    SCOPE = "scheduler"
    BINDINGS = bindings_in("scheduler")
    TITLE = "Scheduler"
    PARTS = frozenset({"acts"})
    EMPTY = "nothing is running or waiting"

    def subtitle(self) -> StyledLine:
        view = self.store.view
        until = " until somebody takes control" if view.waits_for_wizard else ""
        return ((f"{len(view.running)} running, {len(view.waiting)} waiting{until}", "muted"),)

    def make_rows(self, width: int) -> list[ListRow]:
        running, waiting = self.store.running_tasks, self.store.waiting_tasks
        expected = estimate_starts(map(self._queued_task, running), map(self._queued_task, waiting))
        rows = [self._row(task, "now", self._time_left_span(task), width) for task in running]
        for index, (task, start) in enumerate(zip(waiting, expected, strict=True)):
            position = "next" if index == 0 else f"{index + 1}."
            known = None if self.store.view.waits_for_wizard else start
            rows.append(self._row(task, position, self._time_until_span(known, index), width))
        return rows

    def _queued_task(self, task: TaskView) -> QueuedTask:
        typical = None if task.function == "say" else self.store.typical_seconds(task.behavior)
        elapsed = self.store.now() - task.started if task.started is not None else 0.0
        return QueuedTask(typical, max(0.0, elapsed), task.calling_type != "None")

    def _time_left_span(self, task: TaskView) -> StyledSpan:
        """For a running task: its elapsed, usual and remaining time, unless its next action waits for a wizard."""
        if self.store.view.waits_for_wizard and all(action.ended is not None for action in task.actions.values()):
            return "waits for a wizard", "wait"
        queued = self._queued_task(task)
        if queued.typical_seconds is None or queued.seconds_left is None:
            return f"for {format_duration(queued.elapsed_seconds)}", "plain"
        elapsed = f"{format_seconds(queued.elapsed_seconds)} of {format_duration(queued.typical_seconds)}"
        if queued.seconds_left >= 0:
            return f"{elapsed}, {format_duration(queued.seconds_left)} left", "plain"
        return f"{elapsed}, {format_duration(-queued.seconds_left)} over", "wait"

    def _time_until_span(self, at: float | None, position: int) -> StyledSpan:
        """For a waiting task: its probable start."""
        if at is None:
            return "not known", "muted"
        if at < 1:
            return "any moment" if position == 0 else "soon", "muted"
        return f"in ~{at:.0f} s" if at < 90 else f"in ~{at / 60:.0f} min", "muted"

    def _row(self, task: TaskView, position: str, when: StyledSpan, width: int) -> ListRow:
        glyph, word, role = SENT if self._is_change_sent(task.id) else task_state(task)
        now = task.started is not None
        lead = fixed_span(
            f" {position:<4}" if not position[0].isdigit() else f" {position:>4}", 6, "accent" if now else "muted"
        )
        act = self.store.scenario.acts.get(task.behavior) if task.function != "say" else None
        progress = "{}/{}".format(*act_progress(act, task)) if act is not None and now else ""
        source = min(18, width // 5) if width >= WIDE else 0
        narrow = width < NARROW
        room = 11 if narrow else 28
        text = when[0] if not narrow else when[0].rpartition(", ")[2]
        name = width - 6 - 11 - (0 if narrow else 5) - room - (source + 2 if source else 0) - 1
        label = act_label(task.function, task.behavior)
        line: StyledLine = (
            lead,
            fixed_span(label, name, "strong" if now else "plain"),
            (f" {glyph} ", role),
            fixed_span(word, 8, role),
            fixed_span(progress, 0 if narrow else 5, "muted", right=True),
            fixed_span(text, room, when[1], right=True),
        )
        if source:
            line = (*line, ("  ", "plain"), fixed_span(task.source, source, "muted"))
        return ListRow(str(task.id), line, full=f"{position} {label} {word} {task.source}")

    def _is_change_sent(self, id: int) -> bool:
        changes = (sent for sent in self.store.sent.values() if sent.function in ("cancelTask", "moveTask"))
        return any(sent.behavior.split(" ")[0] == str(id) for sent in changes)

    def carry_out(self, action: str) -> None:
        if not self.row_list.current_id:
            self.host.show_notice("nothing is running or waiting")
            return
        task, waiting = int(self.row_list.current_id), self.store.view.waiting
        if action == "scheduler.details":
            self._open_details(task)
        elif action == "scheduler.cancel":
            self.host.send("cancelTask", str(task))
        elif task not in waiting:
            self.host.show_notice("this task is already running; only waiting ones can be moved")
        else:
            index = waiting.index(task)
            position = {"scheduler.earlier": index - 1, "scheduler.later": index + 1}.get(action, 0)
            if 0 <= position < len(waiting) and position != index:
                self.host.send("moveTask", f"{task} {position}")
            else:
                self.host.show_notice("it is already the last one" if position > index else "it is already next")

    def _open_details(self, id: int) -> None:
        def rows(width: int) -> list[ListRow]:
            return task_rows(self.store.view.tasks.get(id), self.store.now(), width)

        self.app.push_screen(DetailScreen("Task", rows))
