"""An explorer of a study that is slow and obviously right.

Every situation is a snapshot of a kernel. From each, a kernel is restored for each input that may come next, handles
it, and is taken a snapshot of. The robot is played action by action. What cannot matter to what follows is made alike:

- time, numbers of records, the random source's state, marks of the wizard, what was taken back or gone through before;
- numbers of tasks and timers are given anew;
- words: reasons, parameters that the robot has been given, which of several wordings was the last.

Memory keys that are not asked for stay in a snapshot as they were on the first way to it, and make no difference
between two.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple, TypeAlias

import msgspec
from msgspec.structs import replace

from rise_engine.kernel import Kernel
from rise_engine.kernel.act_runner import ActRun
from rise_engine.kernel.commands import SetTimer
from rise_engine.kernel.core import Task, TimerTarget
from rise_engine.kernel.failures import first_task
from rise_engine.kernel.history import MemoryLog
from rise_engine.kernel.inputs import ActionReport, AnyInput, RobotChanged, SessionStarted, StopReport, Submit
from rise_engine.kernel.inputs import TimerElapsed as Elapsed
from rise_engine.kernel.records import ActionRecord, AnyRecord
from rise_engine.kernel.snapshot import Snapshot
from rise_engine.kernel.wizard_marks import WizardMarksState
from rise_engine.scenario.model import Scenario
from tests.author.explore.projection import Projection, project
from tests.author.explore.restoring import Restore, restoring_in_place
from tests.author.explore.world import SOURCE, World, is_fault, presses

Timers: TypeAlias = Literal["any", "order"]
ORDERED = ("after", "keep", "filler", "repeat")
"""Timers that rules and people count; the others belong to actions, and to a stop that waits for its answer."""
NOW = 1.0
"""When each input comes; in a snapshot it is 0."""
FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0 - 2.0**-53)
"""Of the numbers from 0 to 1 that chance can give, those that are tried."""


MAX_OUTCOMES = 128
"""Of one input, by chance; a study in which one has more is given up."""
WORLD, START = World(), SessionStarted()


class Situation(NamedTuple):
    snapshot: Snapshot
    faults: int
    """How many things may still go wrong."""
    seconds: dict[int, float]
    """How long the ordered timers are, when that counts."""


class Step(NamedTuple):
    """One of the things that an input can lead to."""

    kernel: Kernel
    records: list[AnyRecord]
    seconds: dict[int, float]
    """How long the timers are that it has set."""


@dataclass
class NaiveResult:
    """What was found."""

    states: set[Projection] = field(default_factory=set)
    complete: bool = True
    """Whether all situations within the bounds were looked at."""
    situations: int = 0
    """How many there are, action by action."""
    steps: int = 0
    """How many inputs were handled."""
    beyond: int = 0
    """How many of them led beyond a bound and were not followed."""
    own_failures: set[str] = field(default_factory=set)
    """Actions that failed without a fault, `ACT/ACTION: why`: a missing value, or a robot that cannot do it."""


def explore_naively(
    scenario: Scenario,
    *,
    keys: Collection[str] = (),
    timers: Timers = "any",
    world: World = WORLD,
    start: SessionStarted = START,
    max_states: int = 1_000_000,
    restoring: Callable[[Scenario], Restore] = restoring_in_place,
    seen: Callable[[Kernel], None] = lambda kernel: None,
) -> NaiveResult:
    """All situations of a scenario.

    Arguments:
        keys: whole memory keys that make a difference; they are in the projections.
        timers: `any`: each pending one may elapse next. `order`: not one before which another was set that is no
            longer; those of waits in acts and the ends of actions come at any time in both.
        max_states: after so many situations it is given up.
        restoring: how kernels are restored.
        seen: called with a kernel in each situation, which it must not change.
    """
    result = NaiveResult()
    always = presses(scenario, world)
    restore = restoring(scenario)
    found: set[bytes] = set()
    waiting: deque[Situation] = deque()

    def add(step: Step, faults: int, known: dict[int, float]) -> None:
        """Keep a situation, if it is new."""
        result.steps += 1
        if world.exceeds(step.kernel):
            result.beyond += 1
            return
        seconds = {**known, **step.seconds} if timers == "order" else {}
        situation = canonical(step.kernel.snapshot(), faults, seconds)
        name = name_of(situation, keys)
        if name in found:
            return
        if len(found) >= max_states:
            result.complete = False
            return
        found.add(name)
        waiting.append(situation)
        result.states.add(project(step.kernel, keys))
        seen(step.kernel)

    kernel = Kernel(scenario, seed=0)
    records, _ = kernel.handle(start)
    add(Step(kernel, records, {}), world.faults, {})
    while waiting and result.complete:
        situation = waiting.popleft()
        for input in possible_inputs(scenario, situation, world, always):
            fault = is_fault(input)
            if fault and not situation.faults:
                continue
            for number, step in enumerate(steps_of(restore, situation.snapshot, input)):
                if number == MAX_OUTCOMES:
                    result.complete, result.situations = False, len(found)
                    return result
                add(step, situation.faults - fault, situation.seconds)
                if not fault and situation.snapshot.robot_lost is None:
                    result.own_failures |= _failures(step.records)
    result.situations = len(found)
    return result


# --- what may come ---


def possible_inputs(scenario: Scenario, situation: Situation, world: World, always: list[Submit]) -> Iterator[AnyInput]:
    """All that may come next, while something may go wrong."""
    snapshot = situation.snapshot
    yield from always
    for act in snapshot.acts:
        for id, action in act.actions.items():
            goal = f"{act.task.id}/{id}"
            if action.state == "canceling":
                yield ActionReport(action=goal, status="canceled")
            elif action.state == "running" and scenario.robot.actions[action.type].engine:
                assert action.timer is not None, "a wait without a timer would never end"
                yield Elapsed(timer=action.timer)
            elif action.state == "running":
                yield ActionReport(action=goal, status="succeeded")
                yield ActionReport(action=goal, status="failed")
                if world.robot and scenario.failure_policy(act.task.behavior).kind == "repeat":
                    yield ActionReport(action=goal, status="failed", aborted=True)
    yield from (Elapsed(timer=timer) for timer in next_timers(situation))
    pauses = snapshot.failures.pauses
    for task in (task for id, task in snapshot.failures.asked.items() if pauses.get(id) is None):
        for answer in ("goOn", "repeatAct", "stopRuleOfAct"):
            yield Submit(function=answer, behavior=str(task.id), source=SOURCE)
    if snapshot.stop == "requested":
        yield StopReport(confirmed=("robot",))
    if world.stop:
        if snapshot.stop == "released" or world.stop_again:
            yield Submit(function="stopAll", source=SOURCE)
        if snapshot.stop == "latched":
            yield from (release(snapshot, word) for word in world.releases)
    if world.robot:
        yield RobotChanged(status="lost" if snapshot.robot_lost is None else "connected")
    if world.cues and snapshot.open_cue_at is not None:
        yield Submit(function="undoCue", source=SOURCE)


def next_timers(situation: Situation) -> list[int]:
    """The ordered timers that may elapse next."""
    pending = [timer for timer, target in situation.snapshot.timers.items() if target.purpose in ORDERED]
    seconds = situation.seconds
    if not seconds:
        return pending
    return [
        timer for timer in pending if not any(other < timer and seconds[other] <= seconds[timer] for other in pending)
    ]


def release(snapshot: Snapshot, word: str) -> Submit:
    """Release the stop, and do the same with all rules that it has ended: leave, enter or wait."""
    chosen = {} if word == "leave" else {rule.name: word for rule in snapshot.stopped_rules}
    behavior = msgspec.json.encode(chosen).decode() if chosen else ""
    return Submit(function="releaseStop", behavior=behavior, source=SOURCE)


# --- what comes of it ---


class Chance:
    """A source of chance that follows a script and takes the first of what is possible when that has ended."""

    def __init__(self, script: tuple[int, ...]) -> None:
        self.state = 0
        """What a snapshot keeps of it."""
        self.script = script
        self.taken: list[int] = []
        self.possible: list[int] = []
        """How many values each could have had."""

    def integer_below(self, count: int) -> int:
        place = len(self.taken)
        self.taken.append(self.script[place] if place < len(self.script) else 0)
        self.possible.append(count)
        return self.taken[-1]

    def fraction(self) -> float:
        return FRACTIONS[self.integer_below(len(FRACTIONS))]

    def other_scripts(self) -> Iterator[tuple[int, ...]]:
        """What would have been possible where this one has ended."""
        for place in range(len(self.script), len(self.taken)):
            for value in range(1, self.possible[place]):
                yield (*self.taken[:place], value)


def steps_of(restore: Restore, snapshot: Snapshot, input: AnyInput) -> Iterator[Step]:
    """All that an input can lead to, whatever chance gives."""
    scripts: list[tuple[int, ...]] = [()]
    while scripts:
        chance = Chance(scripts.pop())
        kernel = restore(snapshot)
        core: Any = kernel.core
        core.rng = chance
        core.env.rand, core.env.below = chance.fraction, chance.integer_below
        records, commands = kernel.handle(replace(input, t=NOW))
        seconds = {each.timer: round(each.at - NOW, 6) for each in commands if isinstance(each, SetTimer)}
        yield Step(kernel, records, seconds)
        scripts += chance.other_scripts()


def _failures(records: list[AnyRecord]) -> set[str]:
    actions = (record for record in records if isinstance(record, ActionRecord) and record.status == "failed")
    return {f"{record.act}/{record.action}: {record.reason}" for record in actions}


# --- which situations are one ---


def name_of(situation: Situation, keys: Collection[str]) -> bytes:
    """Two situations with one name are the same. Of the memory, only these keys count."""
    snapshot = situation.snapshot
    memory = {key: snapshot.memory[key] for key in sorted(keys) if key in snapshot.memory}
    return msgspec.json.encode((replace(snapshot, memory=memory), situation.faults, situation.seconds))


def canonical(snapshot: Snapshot, faults: int, seconds: dict[int, float]) -> Situation:
    """A snapshot without what cannot matter. It is changed itself."""
    snapshot = _without_history(_renumber_tasks(snapshot))
    numbers = _number_timers(snapshot.timers)
    snapshot = _renumber_timers(snapshot, numbers)
    ordered = {
        numbers[timer]: length
        for timer, length in seconds.items()
        if timer in numbers and snapshot.timers[numbers[timer]].purpose in ORDERED
    }
    return Situation(snapshot, faults, dict(sorted(ordered.items())))


def _without_history(snapshot: Snapshot) -> Snapshot:
    """Drop times, words, and what only a look back needs."""
    for run in snapshot.acts:
        _forget_words(run)
    for task in _tasks_of(snapshot):
        task.ref, task.cue_at, task.key_at, task.filler = None, None, None, False
        task.accepted_at, task.started_at, task.robot_at, task.voice_at = 0.0, None, None, None
    for kept in snapshot.rules.kept:
        kept.until = 0.0
    ranks = {recency: rank for rank, recency in enumerate(sorted(rule.recency for rule in snapshot.rules.running), 1)}
    running = [replace(rule, recency=ranks[rule.recency], history=[], steps=0) for rule in snapshot.rules.running]
    marks = snapshot.wizard_marks
    return replace(
        snapshot,
        t=0.0,
        seq=0,
        rng=0,
        reported_missing=[],
        memory_log=MemoryLog(),
        rules=replace(snapshot.rules, running=running, step_counts={}, recency=len(ranks)),
        last_pick={},
        robot_lost=snapshot.robot_lost and "lost",
        stopped_rules=[replace(rule, steps=[]) for rule in snapshot.stopped_rules],
        wizard_marks=WizardMarksState(last_filler=marks.last_filler, filler_timer=marks.filler_timer),
        open_cue_at=None if snapshot.open_cue_at is None else 0.0,
    )


def _forget_words(run: ActRun) -> None:
    run.cancel_reason = run.cancel_reason and "stopped"
    run.failure = run.failure and "failed"
    for action in run.actions.values():
        action.parameters = {}


def _tasks_of(snapshot: Snapshot) -> list[Task]:
    return [
        *(rule.task for rule in snapshot.rules.running),
        *(kept.task for kept in snapshot.rules.kept),
        *snapshot.waiting,
        *(run.task for run in snapshot.acts),
        *snapshot.failures.asked.values(),
    ]


def _renumber_tasks(snapshot: Snapshot) -> Snapshot:
    """Give the tasks that are still known numbers from 1.

    Of two numbers, the kernel only asks which is the lower one to know whether a rule that runs has started an act, or
    an earlier run of the same name has. So what no running rule has started comes first, then the rules, then the rest.
    An act that is repeated counts as its own first attempt.
    """
    rules = snapshot.rules.running
    began = {f"rule:{rule.name}": rule.task.id for rule in rules}
    acts = [task for task in _tasks_of(snapshot) if task.function != "startInteractionRule"]
    own = [task for task in acts if began.get(task.source, first_task(task)) < first_task(task)]
    owned = {task.id for task in own}
    ordered = [*(task for task in acts if task.id not in owned), *(rule.task for rule in rules), *own]
    numbers = {task.id: number for number, task in enumerate(ordered, 1)}
    for task in ordered:
        task.id = numbers[task.id]
        task.first = task.id if task.first else 0
    running = [replace(rule, own_acts=_renumber_own(rule.own_acts, numbers)) for rule in rules]
    failures = snapshot.failures
    failures.asked = {task.id: task for task in failures.asked.values()}
    failures.pauses = dict(sorted((numbers[id], timer) for id, timer in failures.pauses.items()))
    return replace(
        snapshot,
        next_task=len(numbers) + 1,
        rules=replace(snapshot.rules, running=running),
        timers={timer: _renumber_owner(target, numbers) for timer, target in snapshot.timers.items()},
    )


def _renumber_own(own_acts: dict[str, int], numbers: dict[int, int]) -> dict[str, int]:
    """0 for an act that nothing is known of any more."""
    return {act: numbers.get(id, 0) for act, id in sorted(own_acts.items())}


def _renumber_owner(target: TimerTarget, numbers: dict[int, int]) -> TimerTarget:
    """What a timer is for, when that is a task."""
    owner = target.owner
    return replace(target, owner=str(numbers[int(owner)])) if owner and target.purpose != "after" else target


def _number_timers(timers: dict[int, TimerTarget]) -> dict[int, int]:
    """Numbers from 1: the ordered ones in their order, then the others, whose order does not matter."""
    ordered = sorted(timer for timer, target in timers.items() if target.purpose in ORDERED)
    others = sorted(timers.keys() - set(ordered), key=lambda timer: msgspec.structs.astuple(timers[timer]))
    return {timer: number for number, timer in enumerate((*ordered, *others), 1)}


def _renumber_timers(snapshot: Snapshot, numbers: dict[int, int]) -> Snapshot:
    def number(timer: int | None) -> int | None:
        return None if timer is None else numbers[timer]

    for run in snapshot.acts:
        for action in run.actions.values():
            action.timer = number(action.timer)
    for kept in snapshot.rules.kept:
        kept.timer = numbers[kept.timer]
    failures = snapshot.failures
    failures.pauses = {task: number(timer) for task, timer in failures.pauses.items()}
    snapshot.wizard_marks.filler_timer = number(snapshot.wizard_marks.filler_timer)
    rules = snapshot.rules
    running = [
        replace(rule, timers=dict(sorted((numbers[timer], index) for timer, index in rule.timers.items())))
        for rule in rules.running
    ]
    return replace(
        snapshot,
        next_timer=len(numbers) + 1,
        timers=dict(sorted((numbers[timer], target) for timer, target in snapshot.timers.items())),
        rules=replace(rules, running=running),
        stop_timer=number(snapshot.stop_timer),
    )
