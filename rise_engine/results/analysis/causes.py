"""Whose doing something is: the way back from it to the key, the cue, the event or the value that caused it.

The engine records of each thing that a rule asks for which task led to it (semantics.md 4.5). Followed back, act by
act, that leads to something that no rule asked for, or to a rule that acted by itself. Everything that says who did
something asks here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from msgspec import Struct

from rise_engine.kernel.behaviors import started_rule
from rise_engine.kernel.records import AnyRecord, EventRecord, Mark, TaskRecord
from rise_engine.kernel.task_view import TaskView
from rise_engine.kernel.wizard_marks import UNMARKABLE
from rise_engine.results.analysis.model import ActorKind, WizardKey

CUE = "markCue"
START_RULE = "startInteractionRule"
_COMMAND_LINE = "wizard:command-line"


def actor_of(source: str) -> ActorKind:
    """What kind of source a record names.

    >>> actor_of("wizard:anna"), actor_of("rule:Greeting"), actor_of("engine"), actor_of("ros:/node")
    ('wizard', 'rule', 'engine', 'program')
    """
    kind = source.partition(":")[0]
    if kind == "wizard" and source != _COMMAND_LINE:
        return "wizard"
    return "rule" if kind == "rule" else "engine" if kind == "engine" else "program"


class Origin(Struct, frozen=True):
    """Where the way back ends."""

    task: int
    """What was asked for there: by a person, a program, or a rule by itself."""
    by: str
    """Its source, as the record has it."""
    via: tuple[str, ...] = ()
    """The rules between, the first one first, each once."""
    key_at: float | None = None
    """When the key was pressed; where a wizard's key began it through rules and the record does not hold that, when the
    engine took what it asks for. None: no key began it, or the cue's own did."""


class CauseCollector:
    """Takes in the records of a session in their order."""

    def __init__(self, tasks: Mapping[int, TaskView]) -> None:
        """
        :param tasks: those of the session, each as its records so far tell it.
        """
        self._tasks = tasks
        self._origins: dict[int, Origin] = {}
        self._started: dict[str, tuple[float, int]] = {}
        """By rule, when which task started it last."""
        self._raised: list[tuple[float, str, int | None]] = []
        """Events: when, which, and the task that had started the rule at that moment; None: a wizard raised it."""

    def add(self, record: AnyRecord) -> None:
        """Take in the next record, after the task that it is about."""
        if isinstance(record, TaskRecord):
            if record.function == START_RULE and record.status == "ACTIVE":
                self._started[started_rule(record.behavior)] = (record.t, record.id)
        elif isinstance(record, EventRecord):
            self._add_event(record)

    def _add_event(self, record: EventRecord) -> None:
        kind = actor_of(record.source)
        started, task = (
            self._started.get(record.source.removeprefix("rule:"), (None, 0)) if kind == "rule" else (None, 0)
        )
        if kind == "wizard" or started == record.t:
            self._raised.append((record.t, record.topic, None if kind == "wizard" else task))

    def raised(self) -> tuple[tuple[float, str], ...]:
        """When which event was raised by a wizard, or by a rule at the moment at which a wizard's key started it."""
        by_wizards = (
            (at, topic)
            for at, topic, task in self._raised
            if task is None or actor_of(self.origin_of(task).by) == "wizard"
        )
        return tuple(by_wizards)

    def origin_of(self, task: int) -> Origin:
        """Where a task comes from. Once all records are taken in."""
        way: list[int] = []
        at = task
        while at not in self._origins:
            way.append(at)
            task_there = self._tasks[at]
            if task_there.cause is None or task_there.cause not in self._tasks or task_there.cause >= at:
                self._origins[at] = self._begin(task_there)
                way.pop()
                break
            at = task_there.cause
        for each in reversed(way):
            self._origins[each] = self._extend(self._origins[self._cause_of(each)], self._tasks[each])
        return self._origins[task]

    def marks(self, acts: Sequence[int]) -> dict[int, Mark]:
        """What wizards said was wrong about acts: about the act itself, or the key of which it came first.

        :param acts: the tasks of all acts, in their order.
        """
        known, first = set(acts), self._first_acts(acts)
        found: dict[int, Mark] = {}
        for id, task in self._tasks.items():
            if task.mark and id in known:
                found[id] = task.mark
            elif task.mark and id in first:
                found.setdefault(first[id], task.mark)
        return found

    def _first_acts(self, acts: Iterable[int]) -> dict[int, int]:
        """By what began it, the first act that came of it."""
        first: dict[int, int] = {}
        for act in acts:
            first.setdefault(self.origin_of(act).task, act)
        return first

    def keys(self, acts: Sequence[int]) -> tuple[WizardKey, ...]:
        """Everything that wizards asked for, but for what they said about tasks, in its order.

        :param acts: the tasks of all acts, in their order.
        """
        caused = self._first_acts(acts)
        marks = {id: task.mark for id, task in self._tasks.items() if task.mark}
        for act in acts:
            if act in marks:
                marks.setdefault(self.origin_of(act).task, marks[act])
        return tuple(
            WizardKey(
                task=id,
                at=_first_known(task.key_at, self._tasks[caused.get(id, id)].key_at, task.submitted),
                source=task.source,
                function=task.function,
                asked=task.behavior,
                act=caused.get(id),
                mark=marks.get(id),
            )
            for id, task in sorted(self._tasks.items())
            if actor_of(task.source) == "wizard" and task.function not in UNMARKABLE and task.status != "REJECTED"
        )

    def _cause_of(self, task: int) -> int:
        cause = self._tasks[task].cause
        assert cause is not None
        return cause

    def _begin(self, task: TaskView) -> Origin:
        return Origin(task.id, task.source, task.via, None if task.function == CUE else task.key_at)

    def _extend(self, before: Origin, task: TaskView) -> Origin:
        """One step further: what came of it, or a repetition, which has a cause and is asked for by nobody's rule."""
        rules = [*before.via, *task.via]
        if actor_of(task.source) == "rule":
            rules.append(task.source.removeprefix("rule:"))
        root = self._tasks[before.task]
        pressed = None
        if root.function != CUE:
            pressed = task.key_at if task.key_at is not None else before.key_at
            if pressed is None and actor_of(root.source) == "wizard":
                pressed = root.submitted
        return Origin(before.task, before.by, tuple(dict.fromkeys(rules)), pressed)


def _first_known(*times: float | None) -> float:
    return next(each for each in times if each is not None)
