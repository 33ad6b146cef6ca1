"""Tasks and their actions as seen from outside: the only fold of their records (`add_record`).

Sessions, exports, markers and transcripts get their acts from it.
"""

from __future__ import annotations

from typing import Any, Literal

from msgspec import Struct, field

from rise_engine.kernel.records import (
    ENDINGS,
    FINAL,
    ActionRecord,
    ActionStatus,
    AnyRecord,
    Mark,
    MistakeRecord,
    TaskRecord,
    TimingRecord,
)

ACT_FUNCTIONS = frozenset({"startCommunicationRobotAct", "say"})
"""The functions of tasks that run an act, including free speech."""


class ActionView(Struct, gc=False):
    """One action of a running act."""

    action: str
    type: str
    parameters: dict[str, Any]
    status: ActionStatus
    since: float
    began: bool = False
    """Whether it was sent to the robot or began to wait. Otherwise it ended before that."""
    ended: float | None = None
    reason: str = ""
    sent_as: str | None = None
    confirmed: float | None = None
    """When the robot first confirmed that it performs, or has performed, the action."""


class TaskView(Struct, gc=False):
    """A DomainTask and its present state."""

    id: int
    function: str
    behavior: str
    calling_type: str
    source: str
    status: str
    reason: str
    submitted: float
    started: float | None = None
    ended: float | None = None
    ref: str | None = None
    cause: int | None = None
    """For a task of a rule: the task that caused it; null: a timer or the robot's link did."""
    via: tuple[str, ...] = ()
    """The rules that led from that task to the rule in `source`, without the latter."""
    actions: dict[str, ActionView] = field(default_factory=dict)
    """For a CRA: by actionID, in the order in which they started."""
    mark: Mark | Literal[""] = ""
    """A wizard's mark: wrong, late, early or double."""
    key_at: float | None = None
    """When its key was pressed. For an act of a rule, set at its end: when the key that caused it was pressed."""
    cue_at: float | None = None
    """This and the next three fields are set when an act has ended: the time of the cue that it answers, of the robot's
    confirmation of its first action and of its first audible action, and whether it was a filler."""
    robot_at: float | None = None
    voice_at: float | None = None
    filler: bool = False
    taken: bool | None = None
    """Whether a rule took the event that it raised; null: it raised none, or this is still open."""

    @property
    def is_act(self) -> bool:
        """Whether it runs an act, or free speech."""
        return self.function in ACT_FUNCTIONS


_NO_ACTIONS: dict[str, ActionView] = {}
"""Shared by all tasks without acts, because a long session has hundreds of thousands of them."""


def add_record(tasks: dict[int, TaskView], record: AnyRecord) -> None:
    """Add a record to its task, in the order of the session. Other records have no effect.

    >>> tasks: dict[int, TaskView] = {}
    >>> add_record(tasks, TaskRecord(1, 0.5, "", 7, "say", "Hello", "Blocking", "wizard:anna", "ACTIVE"))
    >>> add_record(tasks, ActionRecord(2, 0.75, "", 7, "say", "1", "Speech", {}, "accepted"))
    >>> tasks[7].started, tasks[7].actions["1"].confirmed
    (0.5, 0.75)
    """
    match record:
        case TimingRecord():
            if (task := tasks.get(record.task)) is not None:
                task.submitted, task.filler = record.accepted_at, record.filler
                task.cue_at, task.key_at = record.cue_at, record.key_at
                task.robot_at, task.voice_at = record.robot_at, record.voice_at
        case TaskRecord():
            add_task_record(tasks, record)
        case ActionRecord():
            add_action_record(tasks, record)
        case MistakeRecord():
            if (task := tasks.get(record.task)) is not None:
                task.mark = "" if record.mark == "none" else record.mark
        case _:
            pass


def add_task_record(tasks: dict[int, TaskView], record: TaskRecord) -> TaskView:
    """Like `add_record`. Returns the task, which its first record creates."""
    task = tasks.get(record.id)
    if task is None:
        task = TaskView(
            record.id,
            record.function,
            record.behavior,
            record.calling_type,
            record.source,
            record.status,
            record.reason,
            record.t,
            None,
            None,
            record.ref,
            record.cause,
            record.via,
            {} if record.function in ACT_FUNCTIONS else _NO_ACTIONS,
            key_at=record.key_at,
        )
        tasks[record.id] = task
    else:
        task.status, task.reason = record.status, record.reason
    if record.status == "ACTIVE":
        task.started = record.t
    elif record.status in FINAL:
        task.ended = record.t
    return task


def add_action_record(tasks: dict[int, TaskView], record: ActionRecord) -> None:
    """Like `add_record`."""
    task = tasks.get(record.task)
    if task is None or task.actions is _NO_ACTIONS:
        return
    status = record.status
    action = task.actions.get(record.action)
    if action is None:
        action = ActionView(record.action, record.type, record.parameters, status, record.t, status == "started")
        task.actions[record.action] = action
    action.status, action.reason, action.sent_as = status, record.reason, record.sent_as
    if action.confirmed is None and (status == "accepted" or status == "succeeded"):
        action.confirmed = record.t
    if status in ENDINGS:
        action.ended = record.t
