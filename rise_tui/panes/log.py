"""Every DomainTask of the session, newest last; a hundred thousand of them scroll like ten."""

from __future__ import annotations

from textual import on

from rise_engine.view import TaskView
from rise_tui.actions import bindings
from rise_tui.messages import Told
from rise_tui.panes.pane import Pane
from rise_tui.store import Store, describe
from rise_tui.text import Tone, plain
from rise_tui.widgets.rows import RowView
from rise_tui.widgets.task_log import TaskLog


class LogPane(Pane):
    """The task log with its filter."""

    PLACE = "log"
    BINDINGS = bindings("log")
    TITLE = "Log"
    TOPICS = frozenset({"tasks", "acts", "rules"})

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.log_view = TaskLog(self._find, store.missed, id="log-rows")
        self._seen = 0
        self._matching: list[int] = []
        self._applied = ""
        self._attached = store.attached

    @property
    def rows(self) -> TaskLog:
        return self.log_view

    def _find(self, id: int) -> TaskView | None:
        return self.store.view.tasks.get(id)

    def repaint(self) -> None:
        log = self.store.log
        anew = self._attached != self.store.attached
        self._attached = self.store.attached
        if anew:
            self.log_view.forget_missed()
        if not self.filter_text:
            self.log_view.show(log, restart=anew or bool(self._applied))
        else:
            anew = anew or self.filter_text != self._applied
            if anew:
                self._matching, self._seen = [], 0
            self._matching += filter(self._matches, log[self._seen :])
            self._seen = len(log)
            self.log_view.show(self._matching, restart=anew)
        self._applied = self.filter_text
        self._show_title()

    def _matches(self, id: int) -> bool:
        task = self._find(id)
        return task is not None and self.filter_text.casefold() in plain(self.log_view.line_of(task, 400)).casefold()

    def _show_title(self) -> None:
        view = self.log_view
        tone: Tone = "muted" if view.following else "wait"
        state = "following" if view.following else f"paused, {view.unseen} new" if view.unseen else "paused"
        if self.filter_text:
            self.title.draw(((f"/{self.filter_text}  {view.count} of {len(self.store.log)}  ", "wait"), (state, tone)))
        else:
            self.title.draw(((state if view.count else "no task yet", tone),))

    @on(RowView.Moved)
    def _moved(self, event: RowView.Moved) -> None:
        """The selected task's reason in full: there may be no room for it in its row."""
        event.stop()
        task = self._find(int(event.rows.current)) if event.rows.current else None
        if task is not None and task.reason:
            self.post_message(Told(f"{describe(task.function, task.behavior)}: {task.reason}"))

    def on_task_log_follow_changed(self, event: TaskLog.FollowChanged) -> None:
        event.stop()
        self._show_title()

    def do(self, action: str) -> None:
        if action == "log.follow":
            self.log_view.follow()
