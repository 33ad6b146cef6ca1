"""What a state looks like: always a word and a glyph; colour only doubles it (console.md 7.1)."""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.kernel.records import ENDINGS
from rise_engine.scenario.model import Act
from rise_engine.view import ActionView, TaskView
from rise_tui.model.store import Store
from rise_tui.text import Tone


class State(NamedTuple):
    glyph: str
    word: str
    tone: Tone


READY = State("·", "ready", "muted")
SENT = State("↑", "sent", "wait")
ARMED = State("!", "again?", "wait")
EXPECTED = State("◇", "expected", "key")
"""An act or rule for which the present state of a running rule waits."""
RUNNING = State("►", "running", "accent")
WAITING = State("○", "waiting", "wait")
NOT_TAKEN = State("-", "not taken", "wait")
"""A raised event for which nobody was waiting."""

TASK_STATES = {
    "PENDING": WAITING,
    "ACTIVE": RUNNING,
    "SUCCEEDED": State("✓", "done", "muted"),
    "ABORTED": State("✗", "failed", "fault"),
    "CANCELED": State("■", "stopped", "muted"),
    "REJECTED": State("✗", "rejected", "wait"),
}

REMARK_STATES = {
    "note": State("·", "", "plain"),
    "connected": State("●", "connected", "plain"),
    "degraded": State("◐", "degraded", "wait"),
    "lost": State("✗", "lost", "fault"),
    "fault": State("✗", "faulted", "fault"),
}
"""Rows of the log that are no tasks: by what they are, or by the robot's link."""

ACTION_STATES = {
    "started": State("►", "started", "accent"),
    "accepted": State("►", "running", "accent"),
    "succeeded": State("✓", "done", "muted"),
    "failed": State("✗", "failed", "fault"),
    "canceled": State("■", "stopped", "muted"),
    "timed-out": State("✗", "timed out", "fault"),
    "lost": State("✗", "lost", "fault"),
    "skipped": State("-", "skipped", "muted"),
}

RULE_STATES = {
    "": READY,
    "started": RUNNING,
    "entered": RUNNING,
    "stayed": RUNNING,
    "ended": State("✓", "ended", "muted"),
    "stopped": State("■", "stopped", "muted"),
    "faulted": State("✗", "faulted", "fault"),
}


def act_state(store: Store, name: str) -> State:
    act = store.act(name)
    if store.armed == name:
        return ARMED
    if act.running:
        return RUNNING
    if act.waiting:
        return WAITING
    if store.is_sent(("startCommunicationRobotAct", "stopCommunicationRobotAct"), name):
        return SENT
    return task_state(act.last) if act.last is not None else READY


def rule_state(store: Store, name: str) -> State:
    if store.is_sent(("startInteractionRule", "stopInteractionRule"), name):
        return SENT
    return RULE_STATES.get(store.rule(name).status, READY)


def task_state(task: TaskView) -> State:
    if not task.id:  # a row of the log that is no task
        what = task.behavior if task.function == "robot" else task.function
        return REMARK_STATES.get(what, State("·", "", "plain"))
    return TASK_STATES.get(task.status, State("?", task.status.lower(), "plain"))


def action_state(action: ActionView | None) -> State:
    if action is None:
        return READY
    return ACTION_STATES.get(action.status, State("?", action.status, "plain"))


def newest(store: Store, name: str) -> TaskView | None:
    """The task of an act that a screen should show: running, else waiting, else the last."""
    act = store.act(name)
    for ids in (act.running[-1:], act.waiting[:1]):
        for id in ids:
            if id in store.view.tasks:
                return store.view.tasks[id]
    return act.last


def progress(act: Act, task: TaskView) -> tuple[int, int]:
    """Actions that have ended, and all."""
    return sum(action.status in ENDINGS for action in task.actions.values()), len(act.actions)
