"""The rows of the log: tasks, remarks among them, and the rules' own tasks. Pure.

A row is a number that grows with time. A task's row is its id times ROWS_PER_TASK. Remarks before the next task (notes,
changes of the robot's link, faults of rules) have the numbers after it.
"""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Mapping

from rise_engine.kernel.behaviors import started_rule
from rise_engine.kernel.records import TaskRecord
from rise_engine.kernel.reports import REPORT_KINDS
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.view import RemarkView, SessionView
from rise_engine.results.analysis.acts import first_cause
from rise_engine.results.analysis.model import actor_of

ROWS_PER_TASK = 1 << 40
"""Row numbers for each task: its own, and more than enough for the remarks before the next task."""
ACTS = frozenset({"startCommunicationRobotAct", "say", "nextFiller"})
BY_RULE = "rule:"
NOTE, ROBOT, FAULT = "note", "robot", "fault"
"""Functions of rows that are not tasks. The kinds of reports are such functions, too; their status is the record's."""
REPORTS = frozenset(REPORT_KINDS.values())


def row_of(task: int) -> int:
    """The row of a task."""
    return task * ROWS_PER_TASK


def task_of(row: int) -> int | None:
    """The task of a row; None for a row without one."""
    return None if row % ROWS_PER_TASK else row // ROWS_PER_TASK


def is_by_wizard(source: str, t: float, starter: TaskView | None, tasks: Mapping[int, TaskView]) -> bool:
    """Whether a wizard caused an event: directly, or through a rule when the wizard started it.

    Arguments:
        source: the source of the event.
        t: session time at which it reached the rules.
        starter: the task that had started that rule last.
        tasks: those that may have caused it.
    """
    if actor_of(source) == "rule" and starter is not None and starter.started == t:
        source = first_cause(starter, tasks).source
    return actor_of(source) == "wizard"


def is_rule_internal(task: TaskView | TaskRecord) -> bool:
    """Whether a rule did this for itself: an event, a value, another rule. Failures do not count."""
    quiet = task.status not in ("REJECTED", "ABORTED")
    return task.source.startswith(BY_RULE) and task.function not in ACTS and quiet


class LogRows:
    """All rows of one session, and those caused by people and the robot."""

    def __init__(self) -> None:
        self.all: list[int] = []
        self.main: list[int] = []
        """The rows without the rules' own. The list grows at its end in place; any other change makes a new list."""
        self.rebuild_count = 0
        """Changed with new lists: the console attached again, or the view has forgotten some rows."""
        self._remarks: dict[int, TaskView] = {}

    @property
    def own_count(self) -> int:
        """The number of the rules' own rows."""
        return len(self.all) - len(self.main)

    def rebuild(self, view: SessionView) -> None:
        """Start again from a session's view."""
        self.rebuild_count += 1
        self._remarks.clear()
        self.all = [row_of(id) for id in view.tasks]
        self.main = []
        starters: dict[str, TaskView] = {}
        for id, task in view.tasks.items():
            if task.function == "startInteractionRule" and task.started is not None:
                starters[BY_RULE + started_rule(task.behavior)] = task
            starter = starters.get(task.source)
            missed = task.taken is False and is_by_wizard(task.source, task.ended or 0.0, starter, view.tasks)
            if missed or not is_rule_internal(task):
                self.main.append(row_of(id))
        for remark in view.remarks:
            self.add_remark(remark, in_order=False)
        self.all.sort()
        self.main.sort()

    def add_task(self, record: TaskRecord) -> None:
        """Add an arrived task."""
        self.all.append(row_of(record.id))
        if not is_rule_internal(record):
            self.main.append(row_of(record.id))

    def show_own_row(self, task: int) -> None:
        """Show a rule's own row after all: it failed, or no rule waited for its event."""
        row = row_of(task)
        index = bisect_left(self.main, row)
        if index == len(self.main):
            self.main.append(row)
        elif self.main[index] != row:
            self.main = list(self.main)
            insort(self.main, row)

    def add_remark(self, remark: RemarkView, *, in_order: bool = True) -> None:
        """Add a note, or another remark among the tasks."""
        last = next(reversed(self._remarks), 0)  # they come in order
        row = max(row_of(remark.after), last) + 1
        self._remarks[row] = _as_task(remark)
        for rows in (self.all, self.main):
            if not in_order or not rows or rows[-1] < row:
                rows.append(row)
            else:
                insort(rows, row)

    def task_at(self, row: int, view: SessionView) -> TaskView | None:
        """The content of a row, in the form of a task; None: it is only in the journal."""
        task = task_of(row)
        return view.tasks.get(task) if task is not None else self._remarks.get(row)


def _as_task(remark: RemarkView) -> TaskView:
    """A remark in the form in which the log shows tasks."""
    status = "ABORTED" if remark.kind == FAULT or remark.status in ("lost", "degraded") else "SUCCEEDED"
    status = remark.status if remark.kind in REPORTS else status
    text, reason = remark.text, ""
    if remark.kind == ROBOT:
        text, reason = remark.status, remark.text
    elif remark.kind == FAULT:
        text, reason = remark.source.removeprefix(BY_RULE), remark.text
    return TaskView(0, remark.kind, text, "", remark.source, status, reason, remark.t, ended=remark.t)
