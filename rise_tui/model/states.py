"""The look of a state: always a word and a glyph. Colour only repeats them (console.md 7.1)."""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.kernel.records import ENDINGS
from rise_engine.kernel.task_view import ActionView, TaskView
from rise_engine.scenario.model import Act
from rise_tui.model.log_rows import REPORTS
from rise_tui.model.store import Store
from rise_tui.rendering.text import TextRole


class StateLabel(NamedTuple):
    glyph: str
    word: str
    role: TextRole


READY = StateLabel("·", "ready", "muted")
SENT = StateLabel("↑", "sent", "wait")
ARMED = StateLabel("!", "again?", "wait")
EXPECTED = StateLabel("◇", "expected", "key")
"""An act or rule that the present state of a running rule waits for."""
RUNNING = StateLabel("►", "running", "accent")
WAITING = StateLabel("○", "waiting", "wait")
NOT_TAKEN = StateLabel("-", "not taken", "wait")
"""A raised event that nobody was waiting for."""

TASK_STATES = {
    "PENDING": WAITING,
    "ACTIVE": RUNNING,
    "SUCCEEDED": StateLabel("✓", "done", "muted"),
    "ABORTED": StateLabel("✗", "failed", "fault"),
    "CANCELED": StateLabel("■", "stopped", "muted"),
    "REJECTED": StateLabel("✗", "rejected", "wait"),
}

REMARK_STATES = {
    "note": StateLabel("·", "", "plain"),
    "connected": StateLabel("●", "connected", "plain"),
    "degraded": StateLabel("◐", "degraded", "wait"),
    "lost": StateLabel("✗", "lost", "fault"),
    "fault": StateLabel("✗", "faulted", "fault"),
}
"""Rows of the log that are not tasks, by their kind or by the robot's link."""

REPORT_STATES = {
    "passed": StateLabel("✓", "passed", "muted"),
    "failed": StateLabel("✗", "failed", "fault"),
    "skipped": StateLabel("-", "skipped", "wait"),
    "complete": StateLabel("✓", "complete", "plain"),
    "aborted": StateLabel("■", "aborted", "wait"),
    "excluded": StateLabel("■", "excluded", "wait"),
    "started": StateLabel("►", "started", "plain"),
    "running": StateLabel("►", "running", "plain"),
    "stalled": StateLabel("✗", "stalled", "fault"),
    "stopped": StateLabel("■", "stopped", "muted"),
}
"""Reports among them: a check, the outcome, the state of a recording."""

ACTION_STATES = {
    "started": StateLabel("►", "started", "accent"),
    "accepted": StateLabel("►", "running", "accent"),
    "succeeded": StateLabel("✓", "done", "muted"),
    "failed": StateLabel("✗", "failed", "fault"),
    "canceled": StateLabel("■", "stopped", "muted"),
    "timed-out": StateLabel("✗", "timed out", "fault"),
    "lost": StateLabel("✗", "lost", "fault"),
    "skipped": StateLabel("-", "skipped", "muted"),
}

RULE_STATES = {
    "": READY,
    "started": RUNNING,
    "entered": RUNNING,
    "stayed": RUNNING,
    "ended": StateLabel("✓", "ended", "muted"),
    "stopped": StateLabel("■", "stopped", "muted"),
    "faulted": StateLabel("✗", "faulted", "fault"),
}


def act_state(store: Store, name: str) -> StateLabel:
    act = store.act(name)
    if store.armed_act == name:
        return ARMED
    if act.running:
        return RUNNING
    if act.waiting:
        return WAITING
    if store.is_sent(("startCommunicationRobotAct", "stopCommunicationRobotAct"), name):
        return SENT
    return task_state(act.last) if act.last is not None else READY


def rule_state(store: Store, name: str) -> StateLabel:
    if store.is_sent(("startInteractionRule", "stopInteractionRule"), name):
        return SENT
    return RULE_STATES.get(store.rule(name).status, READY)


def task_state(task: TaskView) -> StateLabel:
    if not task.id:  # a row of the log that is not a task
        if task.function in REPORTS:
            return REPORT_STATES.get(task.status, REMARK_STATES["note"])
        kind = task.behavior if task.function == "robot" else task.function
        return REMARK_STATES.get(kind, StateLabel("·", "", "plain"))
    if task.taken is False:
        return NOT_TAKEN
    return TASK_STATES.get(task.status, StateLabel("?", task.status.lower(), "plain"))


def action_state(action: ActionView | None) -> StateLabel:
    if action is None:
        return READY
    return ACTION_STATES.get(action.status, StateLabel("?", action.status, "plain"))


def newest_task(store: Store, name: str) -> TaskView | None:
    """The task of an act for the screen: the running one, else the waiting one, else the last."""
    act = store.act(name)
    ids = (*act.running[-1:], *act.waiting[:1])
    return store.view.tasks[ids[0]] if ids else act.last


def act_progress(act: Act, task: TaskView) -> tuple[int, int]:
    """The number of ended actions, and of all."""
    return sum(action.status in ENDINGS for action in task.actions.values()), len(act.actions)
