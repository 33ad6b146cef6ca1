"""Who caused a task: traces it back to the key, cue, event or value that led to it.

The engine records for each request of a rule which task led to it (semantics.md 4.5). Followed back act by act, this
leads to something that no rule requested, or to a rule that acted by itself. All code that names who did something uses
this module.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol, TypeVar

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
    """Return the kind of a record's source.

    >>> actor_of("wizard:anna"), actor_of("rule:Greeting"), actor_of("engine"), actor_of("ros:/node")
    ('wizard', 'rule', 'engine', 'program')
    """
    kind = source.partition(":")[0]
    if kind == "wizard" and source != _COMMAND_LINE:
        return "wizard"
    return "rule" if kind == "rule" else "engine" if kind == "engine" else "program"


class Request(Protocol):
    """A task as far as its cause is concerned: a `TaskRecord` or a `TaskView`."""

    @property
    def id(self) -> int: ...
    @property
    def source(self) -> str: ...
    @property
    def cause(self) -> int | None: ...


R = TypeVar("R", bound=Request)


def cause_of(task: R, tasks: Mapping[int, R]) -> R | None:
    """Return the task that led to a task; None: nothing did, or it is not among `tasks`."""
    return None if task.cause is None or task.cause >= task.id else tasks.get(task.cause)


def first_cause(task: R, tasks: Mapping[int, R]) -> R:
    """Return the task at the beginning of a task's chain of causes, as far as `tasks` has it."""
    while (before := cause_of(task, tasks)) is not None:
        task = before
    return task


class Origin(Struct, frozen=True):
    """The task at the beginning of a chain of causes."""

    task: int
    """The first request: from a person, a program, or a rule by itself."""
    by: str
    """Its source as in the record."""
    via: tuple[str, ...] = ()
    """The rules in between, in their order, each once."""
    key_at: float | None = None
    """When the key was pressed. If a wizard caused it through rules, without a key: `taken_at`. None: no key caused it,
    or only the key of the cue."""
    taken_at: float | None = None
    """When the engine took the request of that key. None: as `key_at`."""


class CauseCollector:
    """A collector of causes. Give it a session's records in their order."""

    def __init__(self, tasks: Mapping[int, TaskView]) -> None:
        """
        :param tasks: the session's tasks, each as known from the records so far.
        """
        self._tasks = tasks
        self._origins: dict[int, Origin] = {}
        self._started: dict[str, tuple[float, int]] = {}
        """For each rule, the time and the task of its last start."""
        self._raised: list[tuple[float, str, int | None]] = []
        """Events: time, topic, and the task that had started the rule at that moment. None: a wizard raised it."""

    def add(self, record: AnyRecord) -> None:
        """Add the next record. If it is about a task, update that first."""
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
        """Return times and topics of events from wizards, and from rules at the moment when a wizard started them."""
        by_wizards = (
            (at, topic)
            for at, topic, task in self._raised
            if task is None or actor_of(self.origin_of(task).by) == "wizard"
        )
        return tuple(by_wizards)

    def origin_of(self, task: int) -> Origin:
        """Return the origin of a task. Call this after all records are added."""
        way: list[int] = []
        at = task
        while at not in self._origins:
            way.append(at)
            before = cause_of(self._tasks[at], self._tasks)
            if before is None:
                self._origins[at] = self._begin(self._tasks[at])
                way.pop()
                break
            at = before.id
        for each in reversed(way):
            self._origins[each] = self._extend(self._origins[self._cause_of(each)], self._tasks[each])
        return self._origins[task]

    def marks(self, acts: Sequence[int]) -> dict[int, Mark]:
        """Return the mistakes that wizards marked, for each act itself, or for the key that first led to it.

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
        """Return the first act that each origin led to."""
        first: dict[int, int] = {}
        for act in acts:
            first.setdefault(self.origin_of(act).task, act)
        return first

    def keys(self, acts: Sequence[int]) -> tuple[WizardKey, ...]:
        """Return all requests of wizards in their order, except marks and the like on tasks, and except tasks that
        another one brought along: a repetition, the filler of `nextFiller`, a rule resumed by a release.

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
                at=task.submitted if task.key_at is None else task.key_at,
                source=task.source,
                function=task.function,
                asked=task.behavior,
                act=caused.get(id),
                mark=marks.get(id),
            )
            for id, task in sorted(self._tasks.items())
            if actor_of(task.source) == "wizard"
            and task.cause is None
            and task.function not in UNMARKABLE
            and task.status != "REJECTED"
        )

    def _cause_of(self, task: int) -> int:
        cause = self._tasks[task].cause
        assert cause is not None
        return cause

    def _begin(self, task: TaskView) -> Origin:
        by, via = task.source, task.via
        if via and task.cause is None:  # the time was that of the first rule on the way
            by, via = f"rule:{via[0]}", (*via[1:], task.source.removeprefix("rule:"))
        pressed = None if task.function == CUE else task.key_at
        return Origin(task.id, by, via, pressed, None if pressed is None else task.submitted)

    def _extend(self, before: Origin, task: TaskView) -> Origin:
        """Go one step on: to a consequence, or to a repetition, which has a cause but is not requested by a rule."""
        rules = [*before.via, *task.via]
        if actor_of(task.source) == "rule":
            rules.append(task.source.removeprefix("rule:"))
        root, pressed, taken = self._tasks[before.task], before.key_at, before.taken_at
        if pressed is None and root.function != CUE and actor_of(root.source) == "wizard":
            pressed = taken = root.submitted
        return Origin(before.task, before.by, tuple(dict.fromkeys(rules)), pressed, taken)
