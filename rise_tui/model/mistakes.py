"""What a wizard can say about something that should not have been done, or not then. Pure; knows no screen."""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.kernel.wizard import UNMARKED
from rise_engine.scenario.model import KeyBinding
from rise_engine.view import TaskView
from rise_tui.model.deeds import act_words, describe, done

ACTS = frozenset({"startCommunicationRobotAct", "say"})


class Choice(NamedTuple):
    key: str
    mark: str
    """As the engine calls it."""
    word: str


CHOICES = (
    Choice("w", "wrong", "wrong"),
    Choice("l", "late", "late"),
    Choice("e", "early", "early"),
    Choice("d", "double", "double"),
    Choice("u", "none", "undo"),
)


def newest(tasks: dict[int, TaskView], me: str) -> TaskView | None:
    """What this wizard did last, whatever it was. Of one who has done nothing yet, the act that a rule started last.

    Not what others or programs did, what was refused, and not the marks themselves.
    """
    by_rule: TaskView | None = None
    for id in reversed(tasks):
        task = tasks[id]
        if task.status == "REJECTED" or task.function in UNMARKED:
            continue
        if task.source == me:
            return task
        if by_rule is None and task.source.startswith("rule:") and task.function in ACTS:
            by_rule = task
    return by_rule


def name_of(task: TaskView, key: KeyBinding | None) -> str:
    """An act by its name, what was said by its words, all else by its key and what the author calls it."""
    if task.function in ACTS:
        return act_words(task.function, task.behavior)
    words = done(task.function, task.behavior) or describe(task.function, task.behavior)
    return f"{key.label}: {key.title or words}" if key is not None else words
