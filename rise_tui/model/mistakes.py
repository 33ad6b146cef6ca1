"""What a wizard can say about an act that should not have been, or not then. Pure; knows no screen."""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.view import TaskView
from rise_tui.model.deeds import act_words

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


def newest_act(tasks: dict[int, TaskView], me: str) -> TaskView | None:
    """The act or speech that was asked for last, by this wizard or by a rule; not what others or programs asked for.

    Most acts of a study are started by its rules, at a key of the wizard: those are the wizard's too.
    """
    for id in reversed(tasks):
        task = tasks[id]
        own = task.source == me or task.source.startswith("rule:")
        if own and task.function in ACTS and task.status != "REJECTED":
            return task
    return None


def name_of(task: TaskView) -> str:
    return act_words(task.function, task.behavior)
