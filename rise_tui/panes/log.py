"""What people and the robot did, newest last, on request with all that rules did; 100,000 rows scroll like ten."""

from __future__ import annotations

from bisect import bisect_left
from time import monotonic

from textual import on

from rise_engine.kernel.records import FINAL
from rise_engine.time_slicer import TimeSlicer
from rise_engine.view import TaskView
from rise_tui.actions import bindings
from rise_tui.messages import Told
from rise_tui.model.deeds import describe
from rise_tui.model.filtering import BrokenFilter
from rise_tui.model.log_rows import row_of
from rise_tui.model.row_search import RowSearch
from rise_tui.model.store import Store
from rise_tui.model.task_text import task_rows
from rise_tui.model.times import EXAMPLES, NoTime, moment
from rise_tui.panes.log_export import copy_row, copy_rows, save_rows, suggested_file_name
from rise_tui.panes.pane import Pane
from rise_tui.screens.reading import Reading
from rise_tui.text import Line, Row, Tone, clock, marked, plain
from rise_tui.widgets.ask import AskBar
from rise_tui.widgets.rows import RowView
from rise_tui.widgets.task_log import NARROW, TaskLog

LETTERS = {
    "c": ("copy", "log.copy"),
    "a": ("copy all", "log.copy-all"),
    "s": ("save", "log.save"),
    "t": ("go to time", "log.time"),
}
"""What the letters do over the details of a task, and the action of each."""
SLICE_SECONDS = 0.004
"""For so long the log is searched in one turn of the loop."""
SHOWN_EVERY = 0.2
"""Seconds between two paintings while a search goes on."""


class LogPane(Pane):
    """The log with its filter."""

    PLACE = "log"
    BINDINGS = bindings("log")
    TITLE = "Log"
    TOPICS = frozenset({"tasks"})

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.log_view = TaskLog(self._find, store.missed, id="log-rows")
        self.log_view.mark = self._mark
        self.time_bar = AskBar("go to ", EXAMPLES)
        self.save_bar = AskBar("save as ", "name.tsv or name.jsonl")
        self._search: RowSearch | None = None
        self._searched: list[int] | None = None
        """The rows that the search goes through."""
        self._slicer = TimeSlicer(self._search_on, SLICE_SECONDS)
        self._painted = 0.0
        """When the log was last painted; monotonic."""
        self.unfolded = False
        """Whether the rules' own rows are shown as well."""
        self._saving = False
        self._begun = store.attached, store.trimmed
        self._later = 0, 0
        """How much is taken in of what may change a task after its end: missed events, mistake marks."""

    @property
    def rows(self) -> TaskLog:
        return self.log_view

    def _find(self, row: int) -> TaskView | None:
        return self.store.log.find(row, self.store.view)

    @property
    def _rows(self) -> list[int]:
        """Those that there are, before any filter."""
        return self.store.log.all if self.unfolded else self.store.log.main

    def unfold(self, unfolded: bool) -> None:
        """Show what rules did for themselves, or hide it."""
        if unfolded != self.unfolded:
            self.unfolded = unfolded
            self.repaint()

    # --- what is shown -----------------------------------------------------------------------------------------------

    def repaint(self) -> None:
        begun = self.store.attached, self.store.trimmed
        anew, self._begun = self._begun != begun, begun
        self._slicer.cancel()
        if self.filter is None:
            self._search = None
        elif self._search is None or anew or self._search.filter is not self.filter or self._searched is not self._rows:
            self._searched = self._rows
            self._search = RowSearch(self.filter, self._searched, self.log_view.text_of, self._is_live)
        self._look_again()
        more = self._slicer.run_slice()
        self._show(restart=anew)
        if more:
            self._slicer.wake()

    def on_unmount(self) -> None:
        self._slicer.cancel()

    def _look_again(self) -> None:
        """Tasks that have changed since they were looked at may match by now, some even after their end."""
        missed, marks = self.store.missed, self.store.marked
        if self._search is not None:
            for one in (*missed[self._later[0] :], *marks[self._later[1] :]):
                self._search.expect_change(row_of(one))
            try:
                self._search.look_again()
            except BrokenFilter as broken:
                self._give_up_search(broken)
        self._later = len(missed), len(marks)

    def _search_on(self) -> int:
        """A few rows more, so that a key never waits (console.md 9.2); gives how many, 0 at the end."""
        looked = 0
        if self._search is not None:
            try:
                looked = self._search.step()
            except BrokenFilter as broken:
                self._give_up_search(broken)
        if self._slicer.busy and (not looked or monotonic() - self._painted > SHOWN_EVERY):
            self._show()  # else whoever repaints does it
        return looked

    def _give_up_search(self, broken: BrokenFilter) -> None:
        self.refuse_filter(broken, None)
        self._search = None

    def _show(self, *, restart: bool = False) -> None:
        self._painted = monotonic()
        self.log_view.show(self._search.matching if self._search is not None else self._rows, restart=restart)
        self._show_title()

    def _is_live(self, id: int) -> bool:
        task = self._find(id)
        return task is not None and task.status not in FINAL

    def _mark(self, line: Line) -> Line:
        if self.filter is None:
            return line
        try:
            return marked(line, self.filter.places(plain(line)))
        except BrokenFilter:
            return line  # the search over what this row is made of says so

    def _show_title(self) -> None:
        view = self.log_view
        tone: Tone = "muted" if view.following else "wait"
        older = self.store.older and f"  {self.store.older}"
        state = "following" if view.following else f"paused, {view.unseen} new" if view.unseen else "paused"
        if self._search is not None or self.problem:
            more = "" if self._search is None or self._search.done else "…"
            note = self.filter_note(view.count, len(self._rows), more)
            self.title.draw(note if self.problem else (*note, (f"  {state}{older}", tone)))
            return
        brief = self.title.size.width < NARROW
        own: Line = ()
        if hidden := self.store.log.own:
            what = f"+{hidden} by rules" if brief else f"rules' own: {hidden} {'shown' if self.unfolded else 'hidden'}"
            own = ((f"{what} ", "muted"), ("←" if self.unfolded else "→", "key"))
        if view.following and view.count:
            self.title.draw(own if own and brief else (*own, ("  " if own else "", "plain"), (f"{state}{older}", tone)))
        else:
            rest: Line = ((f"{state}{older}" if view.count else "nothing yet", tone),)
            self.title.draw((*own, ("  ", "plain"), *rest) if own else rest)

    @on(RowView.Moved)
    def _moved(self, event: RowView.Moved) -> None:
        """The selected task's reason in full: there may be no room for it in its row."""
        event.stop()
        task = self.selected
        if task is not None and task.reason:
            self.post_message(Told(f"{describe(task.function, task.behavior)}: {task.reason}"))

    @on(TaskLog.FollowChanged)
    def _follow_changed(self, event: TaskLog.FollowChanged) -> None:
        event.stop()
        self._show_title()

    @property
    def selected(self) -> TaskView | None:
        return self._find(int(self.log_view.current)) if self.log_view.current else None

    # --- actions ------------------------------------------------------------------------------------------------------

    def do(self, action: str) -> None:
        match action:
            case "log.unfold" | "log.fold":
                self.unfold(action == "log.unfold")
            case "log.follow":
                self.log_view.follow()
            case "log.details":
                self._open_details()
            case "log.time":
                self.ask(self.time_bar)
            case "log.copy":
                if (task := self.selected) is not None:
                    self.post_message(Told(copy_row(self.app, task)))
            case "log.copy-all":
                self.post_message(Told(copy_rows(self.app, self.store, self.log_view.ids)))
            case "log.save":
                self.ask(self.save_bar, suggested_file_name(self.store.now()))

    def _open_details(self) -> None:
        """Everything about the selected task; the arrows go on to its neighbours."""
        if self.selected is None:
            self.post_message(Told("no task is selected"))
            return

        def step(direction: int) -> None:
            self.log_view.move_to(min(max(self.log_view.cursor + direction, 0), self.log_view.count - 1))

        def rows(width: int) -> list[Row]:
            task = self.selected
            return task_rows(task, self.log_view.state_of(task), self.store.now(), width) if task is not None else []

        def done(letter: str | None) -> None:
            if letter:
                self.do(LETTERS[letter][1])

        letters = [(letter, does) for letter, (does, _) in LETTERS.items()]
        self.app.push_screen(Reading("Task", rows, letters, step), done)

    def escape(self) -> bool:
        for bar in (self.time_bar, self.save_bar):
            if bar.is_open:
                self._close(bar)
                return True
        return super().escape()

    def _close(self, bar: AskBar) -> None:
        bar.close()
        self.screen.set_focus(self.rows)

    @on(AskBar.Left)
    def _bar_left(self, event: AskBar.Left) -> None:
        if event.bar is not self.filter_bar:
            event.stop()
            self._close(event.bar)

    @on(AskBar.Taken)
    def _bar_taken(self, event: AskBar.Taken) -> None:
        if event.bar is self.filter_bar:
            return
        event.stop()
        if event.bar is self.save_bar:
            self._save(event.bar.text)
            return
        try:
            when = moment(event.bar.text, self.store.now())
        except NoTime as why:
            self.post_message(Told(str(why)))
            return
        self._close(event.bar)
        self.go_to_time(when)

    def _save(self, name: str) -> None:
        """Write the rows as they are shown now; the name can be bettered until it could be used."""
        if not self._saving:
            self._saving = True
            self.run_worker(self._save_rows(name), group="save")

    async def _save_rows(self, name: str) -> None:
        try:
            saved = await save_rows(self.store, name, self.log_view.ids)
        finally:
            self._saving = False
        self.post_message(Told(saved.said))
        if saved.written and self.save_bar.is_open:
            self._close(self.save_bar)

    def go_to_time(self, when: float | None) -> None:
        """The row that was submitted nearest to this session time; None: follow the newest."""
        ids = self.log_view.ids
        if when is None or not ids:
            self.log_view.follow()
            return

        def submitted(id: int) -> float:
            task = self._find(id)
            return task.submitted if task is not None else float("-inf")

        after = bisect_left(ids, when, key=submitted)
        near = [index for index in (after - 1, after) if 0 <= index < len(ids)]
        index = min(near, key=lambda index: abs(submitted(ids[index]) - when))
        self.log_view.go_to(index)
        self._show_title()
        found = submitted(ids[index])
        told = f"the row nearest to {clock(when)} is at {clock(found, tenths=True)}"
        self.post_message(Told(f"{told}; {self.store.older}" if index == 0 and self.store.older else told))
