"""What runs and what waits, in order; the order can be changed."""

from __future__ import annotations

from rise_engine.view import TaskView
from rise_tui.actions import bindings
from rise_tui.messages import TaskAsked, Told
from rise_tui.panes.pane import ListPane
from rise_tui.states import progress, task_state
from rise_tui.text import Line, Row, Span, cell, seconds


class SchedulerPane(ListPane):
    """Running acts, then waiting ones, next first."""

    PLACE = "scheduler"
    BINDINGS = bindings("scheduler")
    TITLE = "Scheduler"
    TOPICS = frozenset({"tasks", "acts"})
    EMPTY = "nothing runs, nothing waits"

    def subtitle(self) -> Line:
        view = self.store.view
        return ((f"{len(view.running)} running, {len(view.waiting)} waiting", "muted"),)

    def make_rows(self, width: int) -> list[Row]:
        view = self.store.view
        rows = []
        for place, id in enumerate([*view.running, *view.waiting]):
            task = view.tasks.get(id)
            if task is not None:
                rows.append(Row(str(id), self._line(task, place - len(view.running), width)))
        return rows

    def _line(self, task: TaskView, place: int, width: int) -> Line:
        state = task_state(task)
        sent = self._asked(task.id)
        time = 13
        source = min(18, width // 4) if width >= 50 else 0
        name = width - 6 - 10 - 5 - time - source - 2
        act = self.store.scenario.acts.get(task.behavior)
        done = f"{progress(act, task)[0]}/{len(act.actions)}" if act is not None and place < 0 else ""
        when: Span
        if place < 0:
            elapsed = seconds(self.store.now() - (task.started or 0.0))
            typical = self.store.typical(task.behavior)
            when = cell(f"{elapsed}/{seconds(typical)} s" if typical is not None else f"{elapsed} s", time, right=True)
        else:
            when = cell(f"{seconds(self.store.now() - task.submitted)} s", time, "muted", right=True)
        return (
            cell(
                " now" if place < 0 else " next" if place == 0 else f" {place + 1:>3}.",
                6,
                "accent" if place < 0 else "muted",
            ),
            cell(task.behavior, name, "strong" if place < 0 else "plain"),
            (" ", "plain"),
            (f"{'↑' if sent else state.glyph} ", "wait" if sent else state.tone),
            cell(sent or state.word, 8, "wait" if sent else state.tone),
            cell(done, 5, "muted", right=True),
            when,
            (" ", "plain"),
            cell(task.source, source, "muted"),
        )

    def _asked(self, id: int) -> str:
        for sent in self.store.sent.values():
            if sent.function in ("cancelTask", "moveTask") and sent.behavior.split(" ")[0] == str(id):
                return "sent"
        return ""

    def do(self, action: str) -> None:
        if not self.list.current:
            self.post_message(Told("nothing runs or waits"))
            return
        task, waiting = int(self.list.current), self.store.view.waiting
        if action == "scheduler.cancel":
            self.post_message(TaskAsked("cancelTask", str(task)))
        elif task not in waiting:
            self.post_message(Told("this task runs already; only waiting ones can be moved"))
        else:
            place = waiting.index(task) + (-1 if action == "scheduler.earlier" else 1)
            if 0 <= place < len(waiting):
                self.post_message(TaskAsked("moveTask", f"{task} {place}"))
