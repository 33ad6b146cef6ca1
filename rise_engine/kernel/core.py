"""The state that all parts of the kernel share: time, numbering, outputs, memory, tasks."""

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
from rise_engine.kernel.records import ENGINE, AnyRecord, NoteRecord, OpenGoal, TaskRecord, TaskStatus
from rise_engine.kernel.rng import Rng
from rise_engine.scenario.model import Scenario

RecordFields = ParamSpec("RecordFields")


RuleList: TypeAlias = dict[Any, None]
"""Running rules (`rise_engine.kernel.rules.RuleRun`), each once, in the order of joining."""


class EventTopic:
    """An event topic: one object for all raisers and takers."""

    __slots__ = ("name", "wait_list", "with_slash")

    def __init__(self, name: str) -> None:
        self.name = name
        self.with_slash = "/" + name
        """As shown in records."""
        self.wait_list: RuleList = {}
        """The rules that wait for it, without the rule on top of the stack, in stack order with the highest last."""


class EventTopics(dict[str, EventTopic]):
    """The topics of the scenario, each under both spellings: with and without slash."""

    def get_or_add(self, name: str) -> EventTopic:
        """Return the one object for a topic (without slash), and make it if necessary."""
        if name not in self:
            self[name] = self["/" + name] = EventTopic(name)
        return self[name]


Cause: TypeAlias = "tuple[str | int, Cause] | None"
"""The chain of causes within one macrostep: a rule that took a step, and the cause of that step; null: an input. A
number instead of a rule is a task, the cause whatever the input was."""

QueuedEvent: TypeAlias = tuple[EventTopic, str, Cause]
"""An event that was not routed yet: its topic, source and cause."""


class Task(Struct):
    """A DomainTask that has not ended."""

    id: int
    function: str
    behavior: str
    calling_type: str
    source: str
    ref: str | None = None
    status: TaskStatus = "PENDING"
    cue_at: float | None = None
    """This field and those below are as in `TimingRecord`; for acts only."""
    key_at: float | None = None
    accepted_at: float = 0.0
    started_at: float | None = None
    robot_at: float | None = None
    voice_at: float | None = None
    filler: bool = False
    attempt: int = 1
    """The number of the attempt, for an act repeated after a failure. It is reset when the robot is back."""
    first: int = 0
    """The first task that it repeats; 0: none."""
    cause: int | None = None
    """This field and the next are as in `TaskRecord`."""
    via: tuple[str, ...] = ()


def parse_task_id(number: str) -> int:
    """Read a task's id; 0, which is never an id, for anything else."""
    return int(number) if number.isascii() and number.isdigit() and len(number) < 19 else 0


class TimerTarget(Struct, frozen=True):
    """The purpose of a timer. `purpose`: after, keep, wait, limit, cancel, stop, repeat or filler."""

    purpose: str
    owner: str = ""
    """The rule's name, or the task's id."""
    item: str = ""
    """The transition's index, or the actionID."""


class Core:
    """Time, numbering and outputs of the current step, and the state that several parts share."""

    def __init__(self, scenario: Scenario, seed: int) -> None:
        self.scenario = scenario
        self.rng = Rng(seed)
        self.t = 0.0
        self.numbers = count(1)
        """The numbers of records. A record draws its number when it is emitted."""
        self.macrostep = 0
        """Counts macrosteps (SCXML's word): everything that one input causes, or all timers of one moment."""
        self.continued_macrostep = -1
        """The last macrostep that included more than one input."""
        self.cause: Cause = None
        """The cause of the present step."""
        self.origin: int | None = None
        """The task of the current input; null: none, as for a rule's timer."""
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
        """Missing keys that were recorded. Each is recorded once."""
        self.open_cue_at: float | None = None
        """The time of the participant's cue that has no answer yet."""
        self.key_at: float | None = None
        """When the key was pressed that caused this step."""
        self.open_goals: tuple[OpenGoal, ...] = ()
        """The robot's open goals."""
        self.waits_for_wizard = False
        """Whether nothing may begin on the robot because no wizard has had control since the session was recovered."""
        self.memory: dict[str, Any] = {}
        self.tables = frozenset(scenario.tables)
        """Keys of the memory that are tables: they exist from the start, never change, and are in no snapshot."""
        self.memory.update(scenario.table_memory)
        self.memory_log = MemoryLog()
        """The changes of the memory since earlier steps of rules."""
        self.env = Environment(self.memory, self.rng.fraction, set(), self.rng.integer_below)
        """The environment of expressions: the memory, and the place where they report missing keys."""

    # --- outputs ---

    def emit(
        self,
        kind: Callable[Concatenate[int, float, str, RecordFields], AnyRecord],
        *fields: RecordFields.args,
        **named: RecordFields.kwargs,
    ) -> None:
        """Emit a record of `kind` with these fields and the next number; the engine fills in `wall`.

        The most frequent records of rules (events, conditions, entered states) are appended to `records` directly,
        because this call costs more than the record (benchmarks/kernel_events).
        """
        self.records.append(kind(next(self.numbers), self.t, "", *fields, **named))

    def new_task(self, submit: Submit, calling_type: str) -> Task:
        """Number a submitted task; `calling_type` is the effective one."""
        task = Task(self.next_task, submit.function, submit.behavior, calling_type, submit.source, submit.ref)
        self.next_task += 1
        task.cause, task.via = self._find_cause(submit.source)
        return task

    def _find_cause(self, source: str) -> tuple[int | None, tuple[str, ...]]:
        """Return the task that caused a rule's step, and the rules between that task and this rule."""
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
        """Record the present status of a task."""
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
            self.key_of(task.id),
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
        """Write the single record of a task that ends immediately: any task except a start."""
        id = self.next_task
        self.next_task = id + 1
        cause, via = self._find_cause(source) if status == "REJECTED" else (None, ())
        key_at = self.key_of(id)
        self.emit(
            TaskRecord, id, function, behavior, calling_type, source, status, reason, None, ref, cause, via, key_at
        )

    def key_of(self, task: int) -> float | None:
        """Return when the key was pressed that requests a task with the current input; None: no key does."""
        return self.key_at if task == self.origin else None

    def record_note(
        self, text: str, source: str = ENGINE, stood: float | None = None, *, suspended: bool = False
    ) -> None:
        self.emit(NoteRecord, text, source, stood, suspended)

    # --- events of the engine itself ---

    def raise_event_if_named(self, topic: str) -> None:
        """Raise an event of the engine. Without a rule that names it, it leaves no record (semantics.md 6.1)."""
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
        """The values of these keys, and of the parts that the last evaluated condition read."""
        memory, parts = self.memory, self.env.parts
        if parts is None:
            return {key: memory[key] if key in memory else lookup(memory, key)[1] for key in keys}
        self.env.parts = None
        return dict(sorted({**{key: lookup(memory, key)[1] for key in keys}, **parts}.items()))

    def newly_missing(self) -> tuple[str, ...]:
        """The missing keys of the last evaluation that were not reported before."""
        missing = self.env.missing
        if not missing:
            return ()
        new = tuple(sorted(missing - self.reported_missing))
        self.reported_missing.update(new)
        missing.clear()
        return new
