"""What a wizard can say about something that should not have been done, or not then. Pure; knows no screen."""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.wizard_marks import UNMARKABLE
from rise_engine.scenario.model import KeyBinding
from rise_tui.model.task_messages import act_label, completion_message, task_label

ACTS = frozenset({"startCommunicationRobotAct", "say"})
CUES = frozenset({"markCue", "undoCue"})


class MistakeMark(NamedTuple):
    key: str
    mark: str
    """As the engine calls it."""
    word: str


MISTAKE_MARKS = (
    MistakeMark("w", "wrong", "wrong"),
    MistakeMark("l", "late", "late"),
    MistakeMark("e", "early", "early"),
    MistakeMark("d", "double", "double"),
    MistakeMark("u", "none", "undo"),
)


def newest_markable(tasks: dict[int, TaskView], me: str | None) -> TaskView | None:
    """What this wizard did last, whatever it was. Of one who has done nothing yet, the act that a rule started last.

    Not what others or programs did, what was refused, and not the marks themselves. `me` None: whoever was the wizard,
    for one who judges a session that is over; no cue then, for what is judged is what came of it.
    """
    by_rule: TaskView | None = None
    for id in reversed(tasks):
        task = tasks[id]
        if task.status == "REJECTED" or task.function in UNMARKABLE or (me is None and task.function in CUES):
            continue
        if task.source == me or (me is None and task.source.startswith("wizard:")):
            return task
        if by_rule is None and task.source.startswith("rule:") and task.function in ACTS:
            by_rule = task
    return by_rule


def markable_name(task: TaskView, key: KeyBinding | None) -> str:
    """An act by its name, speech by its words, all else by its key and what the author calls that, or what it does."""
    if task.function in ACTS:
        return act_label(task.function, task.behavior)
    words = completion_message(task.function, task.behavior) or task_label(task.function, task.behavior)
    return f"{key.label}: {key.title or words}" if key is not None else words
