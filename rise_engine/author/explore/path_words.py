"""Follows a path on one kernel and describes it in sentences: events, and the reactions of rules and acts."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import pairwise
from typing import Any

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from rise_engine.author.drawing.study_keys import key_title
from rise_engine.author.explore.act_traits import ActTraits, Decisions, Phase, WholeActRun, traits_of
from rise_engine.author.explore.moves import Bounds, Move
from rise_engine.author.explore.situation import Countdown, Situation, SituationKernel
from rise_engine.author.explore.situation_graph import Path
from rise_engine.base.errors import RiseError
from rise_engine.base.typed_values import format_value
from rise_engine.expression import Environment
from rise_engine.kernel.inputs import ActionReport, AnyInput, RobotChanged, StopReport, Submit, TimerElapsed
from rise_engine.kernel.record_words import words_of
from rise_engine.kernel.records import (
    AnyRecord,
    ConditionRecord,
    EventRecord,
    FailureRecord,
    KeptRecord,
    MemoryRecord,
    NoteRecord,
    RuleRecord,
    TaskRecord,
)
from rise_engine.scenario.model import Scenario, normal_topic

# --- steps ------------------------------------------------------------------------------------------------------------


SOURCE = "engine"
"""The source of requests while a path is followed."""


class Followed(Struct, frozen=True):
    """One step of a path after it was taken, or its beginning, which has no move."""

    move: Move | None
    situation: Situation
    """The situation after it."""
    records: tuple[AnyRecord, ...]
    """The kernel's records of it."""
    running: dict[int, tuple[str, Phase]]
    """The acts that run after it: their tasks, names and phases."""
    countdowns: dict[int, Countdown]
    """The timers that run after it, by their numbers."""
    task: int = 0
    """The task of the act that the move ends, or whose failure it answers; 0: none."""
    timer: int = 0
    """The timer that elapses; 0: none."""
    submitted: Submit | None = None
    """The person's request in it."""
    by_chance: bool = False
    """Whether it contains a random decision."""


class _Draws(Decisions):
    """Decisions that distinguish chance from the moment within an act."""

    drawn = False

    def integer_below(self, count: int) -> int:
        self.drawn = self.drawn or count > 1
        return super().integer_below(count)

    def fraction(self) -> float:
        self.drawn = True
        return super().fraction()


def act_traits(scenario: Scenario, path: Path, bounds: Bounds) -> dict[str, ActTraits]:
    """Compute the traits of each act in the session with which a path begins."""
    memory = [{**scenario.memory, **path.begun.memory}]
    return {name: traits_of(scenario, act, memory, bounds.pace or (0.0, 1.0)) for name, act in scenario.acts.items()}


def follow_path(scenario: Scenario, path: Path, bounds: Bounds) -> list[Followed]:
    """Follow a path: first its beginning, then a step for each of its moves.

    Raises RiseError if a step is not possible.
    """
    kernel = SituationKernel(
        scenario, (), act_traits(scenario, path, bounds), set(scenario.acts), in_order=bounds.pace is None
    )
    draws = _Draws()
    kernel.decisions = kernel.core.rng = kernel.runner.decisions = draws
    kernel.core.env = Environment(kernel.core.memory, draws.fraction, set(), draws.integer_below)
    records, _ = kernel.kernel.handle(path.begun)
    followed = [_follow_step(kernel, path.beginning, records)]
    for at, step in enumerate(path.steps):
        before = path.steps[at - 1].situation if at else path.beginning
        try:
            input, task, timer = _input_of(kernel, scenario, bounds, step.move, before)
        except (LookupError, StopIteration) as error:
            raise RiseError(f"step {at + 1} of the path is not possible: {step.move}") from error
        draws.begin([*step.move.chance])
        draws.drawn = False
        records, _ = kernel.kernel.handle(msgspec.structs.replace(input, t=float(at + 1)))
        submitted = input if isinstance(input, Submit) else None
        followed.append(_follow_step(kernel, step.situation, records, step.move, task, timer, submitted, draws.drawn))
        _compare(kernel, step.situation, at + 1)
    return followed


def _follow_step(
    kernel: SituationKernel,
    situation: Situation,
    records: Sequence[AnyRecord],
    move: Move | None = None,
    task: int = 0,
    timer: int = 0,
    submitted: Submit | None = None,
    by_chance: bool = False,
) -> Followed:
    running = {id: (run.task.behavior, _phase(run)) for id, run in kernel.runner.runs.items()}
    now, _, numbers = kernel.read(0)
    countdowns = dict(zip(numbers, now.countdowns, strict=True))
    return Followed(move, situation, tuple(records), running, countdowns, task, timer, submitted, by_chance)


def _phase(run: object) -> Phase:
    assert isinstance(run, WholeActRun)
    return run.phase


def _compare(kernel: SituationKernel, wanted: Situation, number: int) -> None:
    """Check that the step leads to the path's situation."""
    now = kernel.read(0)[0]
    for one, other in (
        ([(rule.name, rule.state) for rule in now.rules], [(rule.name, rule.state) for rule in wanted.rules]),
        ([act.name for act in now.waiting], [act.name for act in wanted.waiting]),
        ([(act.name, act.phase) for act in now.running], [(act.name, act.phase) for act in wanted.running]),
        ([act.name for act in now.asked], [act.name for act in wanted.asked]),
    ):
        if one != other:
            raise RiseError(f"step {number} of the path leads to {one}, and not to {other}")


def _input_of(
    kernel: SituationKernel, scenario: Scenario, bounds: Bounds, move: Move, before: Situation
) -> tuple[AnyInput, int, int]:
    """Convert a move to an input for the kernel in its present state, with its task and its timer."""
    match move.kind:
        case "end":
            task = [*kernel.runner.runs][move.place]
            aborted = move.how == "aborted"
            status: Any = "failed" if aborted else move.how
            return ActionReport(action=f"{task}/{move.name}", status=status, aborted=aborted), task, 0
        case "timer":
            timer = _find_timer(kernel, before.countdowns[move.place])
            return TimerElapsed(timer=timer), 0, timer
        case "stopped":
            return StopReport(confirmed=("robot",)), 0, 0
        case "lost":
            return RobotChanged(status="lost"), 0, 0
        case "back":
            return RobotChanged(status="connected"), 0, 0
        case "answer":
            asked = kernel.kernel.failures.state.asked
            task = [*asked][move.place]
            oldest = next(id for id, each in asked.items() if each.behavior == move.name)
            behavior = move.name if oldest == task else str(task)  # the oldest, if several have the name
            return Submit(function=move.how, behavior=behavior, source=SOURCE), task, 0
        case _:
            return submit_of(scenario, bounds.tries, move, before), 0, 0


def _find_timer(kernel: SituationKernel, countdown: Countdown) -> int:
    situation, _, numbers = kernel.read(0)
    return next(number for number, each in zip(numbers, situation.countdowns, strict=True) if each == countdown)


def submit_of(scenario: Scenario, tries: Mapping[str, tuple[object, ...]], move: Move, before: Situation) -> Submit:
    """Return the request of a move that is not an answer to a failure. Raises LookupError if it is not possible."""
    function, behavior = "", ""
    match move.kind:
        case "key":
            key = scenario.keys[move.name]
            function, behavior = key.function, key.task_behavior
        case "event":
            function, behavior = "raiseEventTopic", f"/{normal_topic(move.name)}"
        case "try":
            value = json.dumps({move.name: tries[move.name][move.place]}, ensure_ascii=False)
            function, behavior = "assignValue", value
        case "cue":
            function = "markCue" if move.how == "marked" else "undoCue"
        case "stop":
            function = "stopAll"
        case "release":
            function = "releaseStop"
            if move.how != "leave":
                behavior = json.dumps({rule[0]: move.how for rule in before.stopped_rules}, ensure_ascii=False)
        case _:
            raise LookupError(move.kind)
    return Submit(function=function, behavior=behavior, source=SOURCE)


# --- sentences --------------------------------------------------------------------------------------------------------


_ACT = "startCommunicationRobotAct"


def describe_path(scenario: Scenario, path: Path, bounds: Bounds | None = None) -> list[str]:
    """Write one sentence for each step, without number and full stop: event → consequences.

    Arguments:
        scenario: the explored scenario.
        path: a path through its situations.
        bounds: the bounds of the exploration, with the values to try.

    Raises rise_engine.base.errors.RiseError if the path belongs to another scenario.
    """
    followed = follow_path(scenario, path, bounds or Bounds())
    return [_describe_step(scenario, before, step) for before, step in pairwise(followed)]


def _describe_step(scenario: Scenario, before: Followed, step: Followed) -> str:
    assert step.move is not None, "only the beginning is no move"
    happens = move_text(scenario, step.move, before, step)
    comes = [*_consequences(before, step)]
    if step.by_chance:
        happens += ", and chance decides"
    if not comes and step.submitted is not None and not any(isinstance(each, MemoryRecord) for each in step.records):
        comes = ["nothing comes of it"]
    return f"{happens} → {', '.join(comes)}" if comes else happens


# --- what happens -----------------------------------------------------------------------------------------------------


def move_text(scenario: Scenario, move: Move, before: Followed, step: Followed) -> str:
    """Describe the move of a step."""
    match move.kind:
        case "key":
            key = scenario.keys[move.name]
            return f"the wizard presses {key.label} ({key_title(key)})"
        case "event":
            return f"the event /{normal_topic(move.name)} comes from outside"
        case "try":
            assert step.submitted is not None
            return f"somebody sets {_assignment(step.submitted.behavior)}"
        case "end":
            return _ENDINGS[move.how].format(act=move.name)
        case "timer":
            return _countdown_text(before.countdowns[step.timer], before)
        case "answer":
            return f"{move.name} has failed, and the wizard says: {_ANSWERS[move.how]}"
        case _:
            return _OTHERS[move.kind, move.how]


_ENDINGS = {
    "succeeded": "{act} ends",
    "failed": "{act} fails",
    "aborted": "the robot gives up {act}, or somebody else stops it",
    "canceled": "the robot has stopped doing {act}",
    "accepted": "the robot starts or stops speaking in {act}",
}
_ANSWERS = {"goOn": "go on", "repeatAct": "do it again", "stopRuleOfAct": "stop the rule"}
_OTHERS = {
    ("cue", "marked"): "the wizard marks that the participant has finished",
    ("cue", "undone"): "the wizard takes back that the participant has finished",
    ("stop", ""): "somebody stops everything",
    ("stopped", ""): "the robot has stopped",
    ("release", "leave"): "the wizard takes the stop back, without any rule",
    ("release", "enter"): "the wizard takes the stop back, and the rules enter their states again",
    ("release", "wait"): "the wizard takes the stop back, and the rules wait where they were",
    ("lost", ""): "the robot cannot be reached any more",
    ("back", ""): "the robot can be reached again",
}


def _assignment(behavior: str) -> str:
    """Write `{"task": 2.5}` as `task = 2.5`."""
    return ", ".join(f"{key} = {format_value(value)}" for key, value in json.loads(behavior).items())


def _countdown_text(countdown: Countdown, before: Followed) -> str:
    seconds = f"{countdown.length / 1000:g} s"
    if countdown.purpose == "keep":
        return f"no rule has waited for /{normal_topic(countdown.owner)} for {seconds}"
    if countdown.purpose == "repeat":
        return f"{seconds} pass after {countdown.owner} has failed"
    if countdown.purpose == "filler":
        return f"{seconds} pass without an answer of the robot"
    state = next((rule.state for rule in before.situation.rules if rule.name == countdown.owner), "")
    return f"{seconds} pass in {state}" + (f" ({countdown.owner})" if len(before.situation.rules) > 1 else "")


# --- consequences -----------------------------------------------------------------------------------------------------


def _consequences(before: Followed, step: Followed) -> Iterator[str]:
    rules: dict[str, list[RuleRecord]] = {}
    acts: dict[int, list[TaskRecord]] = {}
    others: list[str] = []
    for record in step.records:
        if isinstance(record, RuleRecord):
            rules.setdefault(record.name, []).append(record)
        elif isinstance(record, TaskRecord):
            if record.function == _ACT and record.id != step.task:
                acts.setdefault(record.id, []).append(record)
            elif record.status == "REJECTED" and not record.source.startswith("rule:"):
                others.append(f"it is refused: {record.reason}")
        else:
            others += _other_text(record, by_chance=step.by_chance)
    for name, records in rules.items():
        yield from _rule_texts(name, records)
    for id, (name, phase) in step.running.items():
        if "canceling" in phase and id in before.running and "canceling" not in before.running[id][1]:
            yield f"{name} is cut off"
        elif phase == "failing" and id == step.task:
            yield "the rest of it is broken off"
    for id, tasks in acts.items():
        yield from _act_texts(id in before.running, tasks)
    yield from others


def _rule_texts(name: str, records: list[RuleRecord]) -> Iterator[str]:
    """Describe the changes of a rule in a step."""
    begun = any(record.status == "started" for record in records)
    states = [record.state or "" for record in records if record.status == "entered"]
    if begun and states:
        yield f"{name} begins in {states[0]}" + _and_on(states[1:])
    elif states:
        yield f"{name} goes on to {states[0]}" + _and_on(states[1:])
    elif any(record.status == "stayed" for record in records):
        yield f"{name} stays in {records[-1].state} and does what it says there"
    last = records[-1]
    if last.status == "ended":
        yield f"{name} ends"
    elif last.status == "stopped":
        yield f"{name} is stopped in {last.state}"
    elif last.status == "faulted":
        yield f"{name} breaks off: {last.reason}"


def _and_on(states: Iterable[str]) -> str:
    return "".join(f", at once to {state}" for state in states)


def _act_texts(ran: bool, records: list[TaskRecord]) -> Iterator[str]:
    """Describe the changes of an act that was requested or under way."""
    last, name = records[-1], records[-1].behavior
    began = any(record.status == "ACTIVE" for record in records)
    match last.status:
        case "ACTIVE":
            yield f"{name} begins"
        case "PENDING" if last.reason != "moved":
            yield f"{name} has to wait"
        case "SUCCEEDED":
            yield f"{name} begins and ends at once" if began else f"{name} ends"
        case "ABORTED":
            yield f"{name} begins and fails at once" if began else f"{name} fails"
        case "CANCELED":
            yield _cut_text(name, last.reason, ran)
        case "REJECTED":
            yield f"{name} is refused: {last.reason}"


def _cut_text(name: str, reason: str, ran: bool) -> str:
    for words, verb in (("interrupted by ", "interrupts"), ("stopped by rule:", "stops")):
        if reason.startswith(words):
            return f"{reason.removeprefix(words)} {verb if ran else 'takes back'} {name}"
    return f"{name} is cut off" if ran else f"{name} is taken back"


def _other_text(record: AnyRecord, *, by_chance: bool) -> Iterator[str]:
    sentence = words_of(record).sentence
    match record:
        case FailureRecord(status="asked" | "waiting" | "repeated" | "dropped"):
            comes = words_of(replace(record, reason="")).text.removeprefix("failed, and ")  # it has the reason
            yield comes if record.status in ("asked", "dropped") else f"{record.act} {comes}"
        case KeptRecord(status="kept" | "taken"):
            yield sentence
        case EventRecord(taken_by=None, source=source) if source.startswith("rule:"):
            yield sentence
        case MemoryRecord(source=source) if by_chance and source.startswith("rule:") and not record.deleted:
            yield sentence
        case ConditionRecord() if record.error:
            yield f"the condition {sentence}"
        case ConditionRecord() if record.missing:
            yield " and ".join(f"{key} is not set" for key in record.missing)
        case NoteRecord():
            yield sentence
        case _:
            return
