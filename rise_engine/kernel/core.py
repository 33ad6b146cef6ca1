"""What all parts of the kernel share while they work on one input: time, numbering, outputs, memory, tasks."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from itertools import count
from typing import Any, Concatenate, ParamSpec, TypeAlias

from msgspec import Struct

from rise_engine.expression import Environment, lookup
from rise_engine.kernel.commands import CancelTimer, Command, SetTimer
from rise_engine.kernel.history import MemoryLog
from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import AnyRecord, NoteRecord, OpenGoal, TaskRecord, TaskStatus
from rise_engine.kernel.rng import Rng
from rise_engine.scenario.model import Scenario

RecordFields = ParamSpec("RecordFields")


RuleList: TypeAlias = dict[Any, None]
"""Running rules (`rise_engine.kernel.rules.RuleRun`), each once, in the order in which they joined."""


class EventTopic:
    """An event topic: one object for all who raise it or wait for it."""

    __slots__ = ("name", "wait_list", "with_slash")

    def __init__(self, name: str) -> None:
        self.name = name
        self.with_slash = "/" + name
        """As records show it."""
        self.wait_list: RuleList = {}
        """Who waits for it, besides the rule on top of the stack: a list in stack order, the highest last."""


class EventTopics(dict[str, EventTopic]):
    """The topics that the scenario names, each under both ways to write it: with and without slash."""

    def get_or_add(self, name: str) -> EventTopic:
        """The one object for a topic (without slash), made if there is none yet."""
        if name not in self:
            self[name] = self["/" + name] = EventTopic(name)
        return self[name]


Cause: TypeAlias = "tuple[str | int, Cause] | None"
"""What led to something within one macrostep: the rule whose step it was, and what had led to that step; null: an
input did. A number in the place of a rule: this task did, whatever the input was."""

QueuedEvent: TypeAlias = tuple[EventTopic, str, Cause]
"""Raised and not yet routed: the topic, its source, and what it comes of."""


class Task(Struct):
    """A DomainTask that has not ended yet."""

    id: int
    function: str
    behavior: str
    calling_type: str
    source: str
    ref: str | None = None
    status: TaskStatus = "PENDING"
    cue_at: float | None = None
    """As the fields of `TimingRecord`, from here on; of acts only."""
    key_at: float | None = None
    accepted_at: float = 0.0
    started_at: float | None = None
    robot_at: float | None = None
    voice_at: float | None = None
    filler: bool = False
    attempt: int = 1
    """Of an act that was repeated after a failure: the how-manieth time it is, counted anew when the robot is back."""
    first: int = 0
    """The task that it repeats, the first of them; 0: it repeats none."""
    cause: int | None = None
    """As the fields of `TaskRecord`, from here on."""
    via: tuple[str, ...] = ()


def parse_task_id(number: str) -> int:
    """A task's id as it is written; 0, which no task has, when it is none."""
    return int(number) if number.isascii() and number.isdigit() and len(number) < 19 else 0


class TimerTarget(Struct, frozen=True):
    """What a timer is for. `purpose`: after, keep, wait, limit, cancel, stop, repeat or filler."""

    purpose: str
    owner: str = ""
    """The rule's name, or the task's id."""
    item: str = ""
    """The transition's index, or the actionID."""


class Core:
    """Time, numbering and outputs of the current step, and the state that belongs to no part alone."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.scenario = scenario
        self.rng = Rng(seed)
        self.t = 0.0
        self.numbers = count(1)
        """What numbers records: each draws its own when it is put out, by `emit` or by the few that go without."""
        self.macrostep = 0
        """Counts what is done in one go (SCXML's word): all that one input sets off, or all timers of one moment."""
        self.continued_macrostep = -1
        """The last macrostep that took in more than one input."""
        self.cause: Cause = None
        """What the things that happen now come of."""
        self.origin: int | None = None
        """The task that the input at hand belongs to; null: none, as with a rule's timer."""
        self.records: list[AnyRecord] = []
        self.commands: list[Command] = []
        self.topics = EventTopics()
        for name in scenario.topics:
            self.topics.get_or_add(name)
        self.events: deque[QueuedEvent] = deque()
        self.next_task = 1
        self.next_timer = 1
        self.timers: dict[int, TimerTarget] = {}
        self.reported_missing: set[str] = set()
        """Keys whose absence has been recorded; it is said once."""
        self.open_cue_at: float | None = None
        """The participant's cue that has not been answered yet."""
        self.key_at: float | None = None
        """When the key was pressed that this step came of."""
        self.open_goals: tuple[OpenGoal, ...] = ()
        """What the robot may still be doing of actions that have ended."""
        self.memory: dict[str, Any] = {}
        self.tables = frozenset(scenario.tables)
        """Keys of the memory that nothing can change. They are there from the beginning, and in no snapshot."""
        self.memory.update(scenario.table_memory)
        self.memory_log = MemoryLog()
        """What the memory was at the steps of rules."""
        self.env = Environment(self.memory, self.rng.fraction, set(), self.rng.integer_below)
        """What expressions see: the memory, and where they report keys that do not exist."""

    # --- outputs ---

    def emit(
        self,
        kind: Callable[Concatenate[int, float, str, RecordFields], AnyRecord],
        *fields: RecordFields.args,
        **named: RecordFields.kwargs,
    ) -> None:
        """Put out a record of `kind` with these fields, numbered; the engine fills in `wall`.

        What rules do all the time (an event is raised, or taken; a condition; a state that is entered) goes into
        `records` without this call, which would cost more than the record itself (benchmarks/kernel_events).
        """
        self.records.append(kind(next(self.numbers), self.t, "", *fields, **named))

    def new_task(self, submit: Submit, calling_type: str) -> Task:
        """Number what was asked for; `calling_type` is the one that counts."""
        task = Task(self.next_task, submit.function, submit.behavior, calling_type, submit.source, submit.ref)
        self.next_task += 1
        task.cause, task.via = self._find_cause(submit.source)
        return task

    def _find_cause(self, source: str) -> tuple[int | None, tuple[str, ...]]:
        """Of what a rule asks for: the task that its step comes of, and the rules on the way before that rule."""
        if not source.startswith("rule:"):
            return None, ()
        rules: list[str] = []
        origin, cause = self.origin, self.cause
        while cause is not None:
            step, cause = cause
            if isinstance(step, int):
                origin, cause = step, None
            else:
                rules.append(step)
        return origin, tuple(each for each in dict.fromkeys(reversed(rules)) if each != rules[0])

    def record_task(self, task: Task, reason: str = "", position: int | None = None) -> None:
        """Record what has become of a task that lasts."""
        self.emit(
            TaskRecord,
            task.id,
            task.function,
            task.behavior,
            task.calling_type,
            task.source,
            task.status,
            reason,
            position,
            task.ref,
            task.cause,
            task.via,
        )

    def record_finished_task(
        self,
        function: str,
        behavior: str,
        source: str,
        status: TaskStatus,
        reason: str = "",
        calling_type: str = "None",
        ref: str | None = None,
    ) -> None:
        """The one record of a task that ends at once: everything but starts."""
        id = self.next_task
        self.next_task = id + 1
        cause, via = self._find_cause(source) if status == "REJECTED" else (None, ())
        self.emit(TaskRecord, id, function, behavior, calling_type, source, status, reason, None, ref, cause, via)

    def record_note(self, text: str, source: str = "engine") -> None:
        self.emit(NoteRecord, text, source)

    # --- events that the engine itself raises ---

    def raise_event_if_named(self, topic: str) -> None:
        """An event of the engine that no rule of the scenario names leaves no record (semantics.md 6.1)."""
        if topic in self.scenario.topics:
            self.events.append((self.topics[topic], "engine", self.cause))

    # --- timers ---

    def set_timer(self, seconds: float, target: TimerTarget) -> int:
        timer = self.next_timer
        self.next_timer += 1
        self.timers[timer] = target
        self.commands.append(SetTimer(timer, round(self.t + seconds, 6)))
        return timer

    def cancel_timer(self, timer: int) -> None:
        if self.timers.pop(timer, None) is not None:
            self.commands.append(CancelTimer(timer))

    # --- memory, read ---

    def read_values(self, keys: tuple[str, ...]) -> dict[str, Any]:
        """The values of these keys, and of the parts that the condition has read that was evaluated last."""
        memory, parts = self.memory, self.env.parts
        if parts is None:
            return {key: memory[key] if key in memory else lookup(memory, key)[1] for key in keys}
        self.env.parts = None
        return dict(sorted({**{key: lookup(memory, key)[1] for key in keys}, **parts}.items()))

    def newly_missing(self) -> tuple[str, ...]:
        """Keys that the last evaluation missed and that have not been reported yet."""
        missing = self.env.missing
        if not missing:
            return ()
        new = tuple(sorted(missing - self.reported_missing))
        self.reported_missing.update(new)
        missing.clear()
        return new
