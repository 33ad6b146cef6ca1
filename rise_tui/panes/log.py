"""The actions of people and the robot, newest last, optionally with those of rules. Fast with 100,000 rows."""

from __future__ import annotations

from bisect import bisect_left
from time import monotonic

from textual import on

from rise_engine.base.time_slicer import TimeSlicer
from rise_engine.kernel.records import FINAL
from rise_engine.kernel.task_view import TaskView
from rise_tui.actions import bindings_in
from rise_tui.model.filtering import InvalidFilter, RowSearch, mark_line
from rise_tui.model.log_rows import row_of, task_of
from rise_tui.model.log_text import (
    EXAMPLES,
    NARROW,
    log_line,
    parse_moment,
    search_text,
    task_rows,
    with_task_name,
)
from rise_tui.model.notice import task_label
from rise_tui.model.store import Store
from rise_tui.panes.log_export import copy_row, copy_rows, save_rows, suggested_file_name
from rise_tui.panes.pane import Pane
from rise_tui.rendering.text import ListRow, StyledLine, TextRole, format_clock
from rise_tui.screens.reading import DetailScreen
from rise_tui.widgets.fields import PromptBar
from rise_tui.widgets.lines import RowView
from rise_tui.widgets.task_log import TaskLog

LETTERS = {
    "c": ("copy", "log.copy"),
    "a": ("copy all", "log.copy-all"),
    "s": ("save", "log.save"),
    "t": ("go to time", "log.time"),
}
"""The keys in the details of a task, and the action of each."""
SLICE_SECONDS = 0.004
"""Seconds for which the log is searched in one turn of the loop."""
PAINT_SECONDS = 0.2
"""Seconds between two repaints during a search."""


class LogPane(Pane):
    """The log with its filter."""

    SCOPE = "log"
    BINDINGS = bindings_in("log")
    TITLE = "Log"
    PARTS = frozenset({"tasks"})

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.task_log = TaskLog(self.make_line, id="log-rows")
        self.time_bar = PromptBar("go to ", EXAMPLES)
        self.save_bar = PromptBar("save as ", "name.tsv or name.jsonl")
        self._search: RowSearch | None = None
        self._slicer = TimeSlicer(self._search_further, SLICE_SECONDS)
        self._painted = 0.0
        """When the log was last painted, on the monotonic clock."""
        self.own_rows_shown = False
        """Whether the rules' own rows are also shown."""
        self._saving = False
        self._rebuild_count = store.log.rebuild_count
        """The rebuild count of the shown lists."""
        self._checked_count = 0
        """The number of checked tasks among those that changed after their end."""

    @property
    def row_view(self) -> TaskLog:
        return self.task_log

    def _task_at(self, row: int) -> TaskView | None:
        return self.store.log.task_at(row, self.store.view)

    @property
    def _unfiltered_rows(self) -> list[int]:
        """The rows before any filter."""
        return self.store.log.all if self.own_rows_shown else self.store.log.main

    def show_own_rows(self, unfolded: bool) -> None:
        """Show or hide the rules' own rows."""
        if unfolded != self.own_rows_shown:
            self.own_rows_shown = unfolded
            self.repaint()

    # --- text ---------------------------------------------------------------------------------------------------------

    def make_line(self, row: int, width: int) -> StyledLine:
        """One row, with the filter's matches marked."""
        task = self._task_at(row)
        if task is None:
            what = f"task {task_of(row)}" if task_of(row) is not None else "this note"
            return ((f" {what} is only in the journal", "muted"),)
        line = log_line(with_task_name(task, self.store.view.tasks), width)
        try:
            return mark_line(line, self.filter)
        except InvalidFilter:
            return line  # the search over the rows reports it

    def _searched_text(self, row: int) -> str | None:
        """The text that a filter searches; None: a row that is only in the journal."""
        task = self._task_at(row)
        return search_text(with_task_name(task, self.store.view.tasks)) if task is not None else None

    def subtitle(self) -> StyledLine:
        """What is hidden or filtered, and whether the log follows the newest row."""
        log = self.task_log
        role: TextRole = "muted" if log.following else "wait"
        state = "following" if log.following else f"paused, {log.unseen} new" if log.unseen else "paused"
        state += self.store.forgotten_text and f"  {self.store.forgotten_text}"
        if self._search is not None or self.filter_problem:
            more = "" if self._search is None or self._search.is_complete else "…"
            note = self.filter_note(log.count, len(self._unfiltered_rows), more)
            return note if self.filter_problem else (*note, (f"  {state}", role))
        brief, hidden = self.title.size.width < NARROW, self.store.log.own_count
        if not hidden:
            return ((state if log.count else "nothing yet", role),)
        shown = "shown" if self.own_rows_shown else "hidden"
        what = f"+{hidden} by rules" if brief else f"{hidden} rule event{'s' * (hidden > 1)} {shown}"
        own: StyledLine = ((f"{what} ", "muted"), ("←" if self.own_rows_shown else "→", "key"))
        if brief and log.following and log.count:
            return own
        return (*own, ("  ", "plain"), (state if log.count else "nothing yet", role))

    # --- drawing ------------------------------------------------------------------------------------------------------

    def repaint(self) -> None:
        restart, rows = self._rebuild_count != self.store.log.rebuild_count, self._unfiltered_rows
        self._rebuild_count = self.store.log.rebuild_count
        self._slicer.cancel()
        if self.filter is None:
            self._search = None
        elif restart or self._search is None or self._search.filter is not self.filter or self._search.ids is not rows:
            self._search = RowSearch(self.filter, rows, self._searched_text, self._is_live)
        self._check_changed()
        more = self._slicer.run_slice()
        self._show_found_rows(restart=restart)
        if more:
            self._slicer.wake()

    def on_unmount(self) -> None:
        self._slicer.cancel()

    def _check_changed(self) -> None:
        """Check tasks again that have changed since the search saw them, some even after their end."""
        changed = self.store.changed_tasks
        if self._search is not None:
            for task_id in changed[self._checked_count :]:
                self._search.expect_change(row_of(task_id))
            try:
                self._search.recheck_live()
            except InvalidFilter as broken:
                self._give_up_search(broken)
        self._checked_count = len(changed)

    def _search_further(self) -> int:
        """Search a few more rows, so that a key never waits (console.md 9.2). Returns their number, 0 at the end."""
        looked = 0
        if self._search is not None:
            try:
                looked = self._search.step()
            except InvalidFilter as broken:
                self._give_up_search(broken)
        if self._slicer.busy and (not looked or monotonic() - self._painted > PAINT_SECONDS):
            self._show_found_rows()  # otherwise another repaint does it
        return looked

    def _give_up_search(self, broken: InvalidFilter) -> None:
        self.refuse_filter(broken)
        self._search = None

    def _show_found_rows(self, *, restart: bool = False) -> None:
        self._painted = monotonic()
        self.task_log.show(
            self._search.matching if self._search is not None else self._unfiltered_rows, restart=restart
        )
        self.show_title()

    def _is_live(self, id: int) -> bool:
        task = self._task_at(id)
        return task is not None and task.status not in FINAL

    @on(RowView.CursorMoved)
    def _cursor_moved(self, event: RowView.CursorMoved) -> None:
        """Show the selected task's reason in full, because its row may have no room for it."""
        event.stop()
        task = self.selected_task
        if task is not None and task.reason:
            self.host.show_notice(f"{task_label(task.function, task.behavior)}: {task.reason}")

    @on(TaskLog.FollowChanged)
    def _follow_changed(self, event: TaskLog.FollowChanged) -> None:
        event.stop()
        self.show_title()

    @property
    def selected_task(self) -> TaskView | None:
        return self._task_at(int(self.task_log.current_id)) if self.task_log.current_id else None

    # --- actions ------------------------------------------------------------------------------------------------------

    def carry_out(self, action: str) -> None:
        match action:
            case "log.unfold" | "log.fold":
                self.show_own_rows(action == "log.unfold")
            case "log.follow":
                self.task_log.follow_newest()
            case "log.details":
                self._open_details()
            case "log.time":
                self.open_bar(self.time_bar)
            case "log.copy":
                if (task := self.selected_task) is not None:
                    self.host.show_notice(copy_row(self.app, task))
            case "log.copy-all":
                self.host.show_notice(copy_rows(self.app, self.store, self.task_log.ids))
            case "log.save":
                self.open_bar(self.save_bar, suggested_file_name(self.store.now()))

    def _open_details(self) -> None:
        """Show everything about the selected task. The arrows go on to its neighbours."""
        if self.selected_task is None:
            self.host.show_notice("no task is selected")
            return

        def step(direction: int) -> None:
            self.task_log.move_cursor(min(max(self.task_log.cursor + direction, 0), self.task_log.count - 1))

        def rows(width: int) -> list[ListRow]:
            return task_rows(self.selected_task, self.store.now(), width)

        def run_letter(letter: str | None) -> None:
            if letter:
                self.carry_out(LETTERS[letter][1])

        letters = [(letter, does) for letter, (does, _) in LETTERS.items()]
        self.app.push_screen(DetailScreen("Task", rows, letters, step), run_letter)

    def leave_transient(self) -> bool:
        for bar in (self.time_bar, self.save_bar):
            if bar.is_open:
                self._close_bar(bar)
                return True
        return super().leave_transient()

    def _close_bar(self, bar: PromptBar) -> None:
        bar.close()
        self.screen.set_focus(self.row_view)

    @on(PromptBar.Cancelled)
    def _prompt_cancelled(self, event: PromptBar.Cancelled) -> None:
        if event.bar is not self.filter_bar:
            event.stop()
            self._close_bar(event.bar)

    @on(PromptBar.Accepted)
    def _prompt_accepted(self, event: PromptBar.Accepted) -> None:
        if event.bar is self.filter_bar:
            return
        event.stop()
        if event.bar is self.save_bar:
            self._save(event.bar.text)
            return
        try:
            moment = parse_moment(event.bar.text, self.store.now())
        except InvalidFilter as why:
            self.host.show_notice(str(why))
            return
        self._close_bar(event.bar)
        self.go_to_time(moment)

    def _save(self, name: str) -> None:
        """Write the rows as they are shown now. The name can be corrected until it works."""
        if not self._saving:
            self._saving = True
            self.run_worker(self._save_rows(name), group="save")

    async def _save_rows(self, name: str) -> None:
        try:
            saved = await save_rows(self.store, name, self.task_log.ids)
        finally:
            self._saving = False
        self.host.show_notice(saved.notice)
        if saved.written and self.save_bar.is_open:
            self._close_bar(self.save_bar)

    def go_to_time(self, moment: float | None) -> None:
        """Go to the row that was submitted nearest to this session time; None: follow the newest."""
        ids = self.task_log.ids
        if moment is None or not ids:
            self.task_log.follow_newest()
            return

        def submitted(id: int) -> float:
            task = self._task_at(id)
            return task.submitted if task is not None else float("-inf")

        after = bisect_left(ids, moment, key=submitted)
        near = [index for index in (after - 1, after) if 0 <= index < len(ids)]
        index = min(near, key=lambda index: abs(submitted(ids[index]) - moment))
        self.task_log.go_to(index)
        self.show_title()
        found = submitted(ids[index])
        notice = f"the row nearest to {format_clock(moment)} is at {format_clock(found, tenths=True)}"
        missing = f"; {self.store.forgotten_text}" if index == 0 and self.store.forgotten_text else ""
        self.host.show_notice(notice + missing)
