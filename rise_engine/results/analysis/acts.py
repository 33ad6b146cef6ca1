"""Acts and cues of a session with the parts of every latency, and their causes.

The engine records for each request of a rule which task caused it (semantics.md 4.5). Followed act by act, this leads
to a task that no rule requested, or to a rule that acted by itself. All code that names the origin of something uses
this module. Values that old journals lack are computed from their other records.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from sys import intern
from typing import Any, TypeAlias, TypeVar, cast

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.kernel.behaviors import started_rule
from rise_engine.kernel.records import (
    FINAL,
    AnyRecord,
    CueRecord,
    EventRecord,
    FailureRecord,
    Mark,
    TaskRecord,
    TaskStatus,
)
from rise_engine.kernel.speech import SAY, SPEECH
from rise_engine.kernel.task_view import ActionView, TaskView, add_record
from rise_engine.kernel.wizard_marks import UNMARKABLE
from rise_engine.results.analysis.course import interruption_between, seconds_without_engine
from rise_engine.results.analysis.model import (
    ActPart,
    Cue,
    Interruption,
    Outage,
    PlayedAct,
    WizardKey,
    actor_of,
)
from rise_engine.scenario.model import ActionSpec, Scenario
from rise_engine.scenario.parameters import MESSAGE, SPEECH_CHANNEL
from rise_engine.scenario.reading.action_declarations import core_actions
from rise_engine.scenario.speech.ssml import plain_words
from rise_engine.scenario.speech.template import spoken_text

CUE = "markCue"
START_RULE = "startInteractionRule"


Request: TypeAlias = TaskRecord | TaskView
"""A task with the fields that determine its cause."""
R = TypeVar("R", bound=Request)


def cause_of(task: R, tasks: Mapping[int, R]) -> R | None:
    """Return the task that caused a task; None: it has no cause, or the cause is not among `tasks`."""
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
    """When the key was pressed; `taken_at`: a wizard caused it by rules, without a key. None: no key, or only the
    cue's."""
    taken_at: float | None = None
    """When the engine accepted the request of that key. None: as for `key_at`."""


class CauseCollector:
    """Collects causes. Give it a session's records in their order."""

    def __init__(self, tasks: Mapping[int, TaskView]) -> None:
        """
        :param tasks: the session's tasks, each as known from the records so far.
        """
        self._tasks = tasks
        self._origins: dict[int, Origin] = {}
        self._started: dict[str, tuple[float, int]] = {}
        """For each rule, the time and the task of its last start."""
        self._raised: list[tuple[float, str, int | None]] = []
        """Events: time, topic, and the task that had started the rule at that time. None: a wizard raised it."""

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
        """Return times and topics of events from wizards, and from rules at the time when a wizard started them."""
        by_wizards = (
            (at, topic)
            for at, topic, task in self._raised
            if task is None or actor_of(self.origin_of(task).by) == "wizard"
        )
        return tuple(by_wizards)

    def origin_of(self, task: int) -> Origin:
        """Return the origin of a task. Call this after all records are added."""
        path: list[int] = []
        at = task
        while at not in self._origins:
            path.append(at)
            before = cause_of(self._tasks[at], self._tasks)
            if before is None:
                self._origins[at] = self._begin(self._tasks[at])
                path.pop()
                break
            at = before.id
        for each in reversed(path):
            self._origins[each] = self._extend(self._origins[self._cause_of(each)], self._tasks[each])
        return self._origins[task]

    def marks(self, acts: Sequence[int]) -> dict[int, Mark]:
        """Return the mistakes that wizards marked, on each act itself or on the key that first led to it.

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
        """Return all requests of wizards in their order, except those about tasks (such as marks), and except tasks
        that another request caused: a repetition, the filler of `nextFiller`, a rule resumed by a release.

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
        if via and task.cause is None:  # that time belongs to the first rule of the chain
            by, via = f"rule:{via[0]}", (*via[1:], task.source.removeprefix("rule:"))
        pressed = None if task.function == CUE else task.key_at
        return Origin(task.id, by, via, pressed, None if pressed is None else task.submitted)

    def _extend(self, before: Origin, task: TaskView) -> Origin:
        """Extend the chain by a consequence, or by a repetition, which has a cause but is not requested by a rule."""
        rules = [*before.via, *task.via]
        if actor_of(task.source) == "rule":
            rules.append(task.source.removeprefix("rule:"))
        root, pressed, taken = self._tasks[before.task], before.key_at, before.taken_at
        if pressed is None and root.function != CUE and actor_of(root.source) == "wizard":
            pressed = taken = root.submitted
        return Origin(before.task, before.by, tuple(dict.fromkeys(rules)), pressed, taken)


# --- acts -------------------------------------------------------------------------------------------------------------


_INFORMATIVE = ("value", "duration")
"""Parameters that describe an action, the best first."""


def _share_words(task: TaskView) -> None:
    """Keep equal texts in memory once: a node can have hundreds of thousands of tasks with the same words."""
    task.function, task.behavior = intern(task.function), intern(task.behavior)
    task.calling_type, task.source = intern(task.calling_type), intern(task.source)


class ActCollector:
    """Collects acts and cues. Give it a session's records in their order."""

    def __init__(self, scenario: Scenario | None) -> None:
        """
        :param scenario: the session's scenario; None: it cannot be loaded, so the core actions define the channels.
        """
        self._scenario = scenario
        self._specs = specs_of(scenario)
        self._tasks: dict[int, TaskView] = {}
        self._cues: list[Cue] = []
        self._answers: dict[int, int] = {}
        """For each task that began to answer a cue, the index of the cue."""
        self._bridges: dict[int, int] = {}
        self._repetitions: dict[int, int] = {}
        """For each failed act that was repeated, the task of its repetition."""
        self._causes = CauseCollector(self._tasks)

    def add(self, record: AnyRecord) -> None:
        add_record(self._tasks, record)
        self._causes.add(record)
        if isinstance(record, CueRecord):
            self._add_cue(record)
        elif isinstance(record, FailureRecord):
            if record.status == "repeated" and record.by is not None and record.by > record.task:
                self._repetitions[record.task] = record.by
        elif isinstance(record, TaskRecord):
            _share_words(self._tasks[record.id])

    def acts(self, outages: Sequence[Outage] = (), interruptions: Sequence[Interruption] = ()) -> tuple[PlayedAct, ...]:
        """Return every act, in the order in which the engine accepted them."""
        acts = [task for task in self._tasks.values() if task.is_act]
        marks = self._causes.marks([act.id for act in acts])
        cues = {**self._bridges, **self._heard_answers()}
        played = [self._played(act, cues.get(act.id), marks.get(act.id)) for act in acts]
        if interruptions:
            played = [
                replace(
                    each,
                    response_outage_s=seconds_without_engine(outages, each.cue_at, each.answered_at),
                    response_interrupted=interruption_between(interruptions, each.cue_at, each.answered_at),
                )
                for each in played
            ]
        return tuple(sorted(played, key=lambda each: (each.accepted_at, each.task)))

    def keys(self) -> tuple[WizardKey, ...]:
        """Return the requests of wizards."""
        return self._causes.keys([task.id for task in self._tasks.values() if task.is_act])

    def raised(self) -> tuple[tuple[float, str], ...]:
        """Return the events that wizards raised, with their times."""
        return self._causes.raised()

    def cues(self, acts: Iterable[PlayedAct]) -> tuple[Cue, ...]:
        """Return every cue, with the answers and fillers among `acts`."""
        by_task = {act.task: act for act in acts}
        cues = list(self._cues)
        for task, index in self._bridges.items():
            act = by_task.get(task)
            if act is not None and act.robot_at is not None and cues[index].filled_at is None:
                cues[index] = replace(cues[index], filled_at=act.robot_at)
        for task, index in self._heard_answers().items():
            act = by_task.get(task)
            if act is not None:
                cues[index] = replace(cues[index], answered_at=act.answered_at, answer_s=act.answer_s)
            cues[index] = replace(cues[index], task=task)
        return tuple(cues)

    def _add_cue(self, record: CueRecord) -> None:
        if record.status == "marked":
            self._cues.append(Cue(at=record.at, source=record.source, text=record.text))
            return
        if not self._cues:
            return  # the cue's own record is unreadable
        index = len(self._cues) - 1
        if record.status == "undone":
            self._cues[index] = replace(self._cues[index], undone_at=record.t)
        elif record.task is not None:
            (self._answers if record.status == "answered" else self._bridges).setdefault(record.task, index)

    def _heard_answers(self) -> dict[int, int]:
        """Return the cue's index for each task that answered one, from its `_heard_attempt`."""
        return {self._heard_attempt(task): index for task, index in self._answers.items()}

    def _heard_attempt(self, first: int) -> int:
        """Return the first attempt at an act that the robot confirmed as an answer; otherwise the first attempt.

        A repetition that answers a later cue is no attempt for an earlier one.
        """
        attempts = [first]
        while (again := self._repetitions.get(attempts[-1])) in self._tasks and again not in self._answers:
            attempts.append(again)
        if attempts == [first]:
            return first
        heard = (task for task in attempts if self._played(self._tasks[task]).answered_at is not None)
        return next(heard, first)

    def _played(self, task: TaskView, cue: int | None = None, mark: Mark | None = None) -> PlayedAct:
        origin = self._causes.origin_of(task.id)
        name = SAY if task.function == "say" else task.behavior
        parts = parts_of(task, self._specs)
        robot_at, voice_at = confirmed_at(parts)
        return PlayedAct(
            task=task.id,
            act=name,
            source=task.source,
            by=origin.by,
            origin=origin.task,
            via=origin.via,
            actor=actor_of(origin.by),
            status=cast(TaskStatus, task.status),
            reason=task.reason,
            filler=task.id in self._bridges or task.filler,
            cue=None if cue is None else cue + 1,
            cue_at=None if cue is None else self._cues[cue].at,
            key_at=origin.key_at,
            taken_at=origin.taken_at,
            accepted_at=task.submitted,
            started_at=task.started,
            robot_at=robot_at if task.robot_at is None else task.robot_at,
            voice_at=voice_at if task.voice_at is None else task.voice_at,
            ended_at=task.ended if task.status != "REJECTED" else None,
            mark=mark,
            parts=parts,
            speaks=self._speaks(name, task, parts),
        )

    def _speaks(self, name: str, task: TaskView, parts: tuple[ActPart, ...]) -> bool:
        if any(SPEECH_CHANNEL in part.channels for part in parts):
            return True
        if parts and task.status in FINAL:
            return False
        if name == SAY:
            return SPEECH_CHANNEL in self._specs[SPEECH].channels if SPEECH in self._specs else True
        found = self._scenario.acts.get(name) if self._scenario is not None else None
        return found is not None and SPEECH_CHANNEL in found.channels


def specs_of(scenario: Scenario | None) -> Mapping[str, ActionSpec]:
    """Return the actions of a session's robot, or the core actions if its scenario cannot be loaded."""
    return scenario.robot.actions if scenario is not None else core_actions()


def parts_of(task: TaskView, specs: Mapping[str, ActionSpec]) -> tuple[ActPart, ...]:
    """Return an act's actions on the robot, without the engine's own, such as pauses."""
    return tuple(_part(action, specs.get(action.sent_as or action.type)) for action in task.actions.values())


def _part(action: ActionView, spec: ActionSpec | None) -> ActPart:
    by_engine = spec is not None and spec.engine
    return ActPart(
        action=action.action,
        type=action.type,
        channels=spec.channels if spec is not None and not by_engine else (),
        parameters=action.parameters,
        text=action_text(action.parameters),
        accepted_at=None if by_engine else action.confirmed,
        ended_at=action.ended,
        status=action.status,
        started_at=action.since if action.began else None,
    )


def confirmed_at(parts: Iterable[ActPart]) -> tuple[float | None, float | None]:
    """Return when the robot confirmed the first of an act's actions, and the first that uses the voice."""
    found = [(part.accepted_at, part.channels) for part in parts if part.accepted_at is not None]
    voiced = (at for at, channels in found if SPEECH_CHANNEL in channels)
    return min((at for at, _ in found), default=None), min(voiced, default=None)


def action_text(parameters: Mapping[str, Any]) -> str:
    """Describe an action in a few words: its spoken text, or its most informative parameter.

    >>> action_text({"message": "<speak>Hello<break time='1s'/>you</speak>"}), action_text({"value": "nod"})
    ('Hello you', 'nod')
    >>> action_text({"pointx": 1.0, "pointy": 0, "pointz": 0.5}), action_text({})
    ('(1, 0, 0.5)', '')
    """
    message = parameters.get(MESSAGE)
    if message is not None:
        return plain_words(message) if isinstance(message, str) else spoken_text(message)
    if all(axis in parameters for axis in ("pointx", "pointy", "pointz")):
        return "(" + ", ".join(spoken_text(parameters[axis]) for axis in ("pointx", "pointy", "pointz")) + ")"
    chosen = next((name for name in _INFORMATIVE if name in parameters), None)
    if chosen == "duration":
        return f"{spoken_text(parameters[chosen])} ms"
    if chosen is not None:
        return spoken_text(parameters[chosen])
    return next((spoken_text(value) for value in parameters.values()), "")
