"""A path played on the engine itself: when somebody must do what, and what must go wrong, so that it goes like this.

Times are thought out (`rise_engine.explore.path_times`), played in virtual time with the simulated robot, and what is
seen then is reckoned with in the next attempt, until it goes as the path has it, or no attempt is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import msgspec
from msgspec import Struct
from msgspec.structs import replace

from rise_engine.engine.clock import VirtualClock
from rise_engine.engine.drivers import make_robot
from rise_engine.engine.engine import Engine
from rise_engine.explore.bounds import Bounds
from rise_engine.explore.cone import keys_that_matter
from rise_engine.explore.following import Followed, find_repeating, follow_path
from rise_engine.explore.path_times import PathTimes, PlannedTimes, is_free
from rise_engine.explore.paths import Path
from rise_engine.explore.situation import Situation
from rise_engine.explore.telling import move_text
from rise_engine.explore.timetable import Contradiction
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.kernel.records import ENDINGS, ActionRecord, AnyRecord
from rise_engine.protocol.task_file import TimedTask
from rise_engine.scenario import expected_seconds
from rise_engine.scenario.model import Scenario

ATTEMPTS = 25
"""How often times are thought out anew, at most, for one seed."""
SEEDS = 300
"""How many seeds are tried where chance decides."""
_PACE = (0.5, 3.0)
_AFTERWARDS = 120.0
"""Virtual seconds for which it is watched how acts end that have begun before it went otherwise."""
_MOST_ADVANCES = 400
_LIVELOCK = 5_000
FILE = "path"
"""What stands for a file's name in tasks that were never in one."""


class PlayedPath(Struct, frozen=True):
    """How a path is played."""

    tasks: tuple[TimedTask, ...]
    """What somebody does, and when."""
    faults: tuple[str, ...]
    """What goes wrong, as `--fault` has it."""
    seed: int
    """With which it plays."""
    condition: str
    """Of the session, as the scenario names it; empty: none."""
    is_certain: bool
    """Whether it was played like this, with every situation as the path has it."""
    problem: str
    """Why it could not be; empty: it was."""


class _Seen(NamedTuple):
    """What is compared of a situation."""

    rules: tuple[tuple[str, str], ...]
    waiting: tuple[str, ...]
    running: tuple[tuple[str, str], ...]
    asked: tuple[str, ...]
    countdowns: tuple[tuple[str, str, int], ...]
    kept: tuple[str, ...]
    stop: str
    robot_lost: bool
    cue_open: bool
    memory: tuple[bytes | None, ...]


class _Playing(Struct):
    """How one attempt went."""

    reached: int
    """How many steps came as the path has them."""
    came: tuple[str, ...] = ()
    """What else happened instead of the next, in words of the record."""
    changed: bool = False
    """Whether something was learned that was not known before."""


def find_times(scenario: Scenario, path: Path, bounds: Bounds | None = None) -> PlayedPath:
    """Play a path on the engine, and say how.

    Arguments:
        scenario: what was explored.
        path: a way through its situations.
        bounds: with which it was explored: what is tried, and how fast acts go.

    Raises rise_engine.explore.following.PathMismatch when the path is of another scenario.
    """
    bounds = bounds or Bounds()
    scenario = replace(scenario, mode="debug")
    return _Search(scenario, path, follow_path(scenario, path, bounds), bounds).find()


class _Search:
    def __init__(self, scenario: Scenario, path: Path, followed: Sequence[Followed], bounds: Bounds) -> None:
        self._scenario = scenario
        self._path = path
        self._followed = followed
        self._keys = _compared_keys(scenario, path)
        self._wanted = [_seen_in(each.situation, self._keys) for each in followed]
        memory = {**scenario.memory, **path.begun.memory}
        again = find_repeating(scenario, followed, self._keys, path, bounds)
        self._times = PathTimes(scenario, followed, memory, bounds.pace or _PACE, again)
        self._by_chance = [step for step, each in enumerate(followed) if each.by_chance]
        self._best: tuple[int, PlannedTimes | None, int, tuple[str, ...]] = (-1, None, 0, ())

    def find(self) -> PlayedPath:
        wasted = 0
        problem = ""
        for seed in range(SEEDS if self._by_chance else 1):
            reached, problem, plan = self._try_seed(seed)
            if not problem:
                assert plan is not None
                return self._result(plan, seed, "")
            if not self._by_chance or reached < self._by_chance[0] - 1:
                break  # no seed will help
            if reached + 1 not in self._by_chance:
                wasted += 1
                if wasted > ATTEMPTS:
                    break
        _, plan, seed, _ = self._best
        if plan is None:
            return PlayedPath((), (), 0, self._path.begun.condition, False, problem)
        return self._result(plan, seed, self._why_not(problem))

    def _try_seed(self, seed: int) -> tuple[int, str, PlannedTimes | None]:
        """How many steps could be played with this seed, and why no more; empty: all were."""
        reached = -1
        problem = ""
        tried: set[tuple[tuple[float, ...], tuple[str, ...]]] = set()
        for _ in range(ATTEMPTS):
            plan = self._times.plan()
            if isinstance(plan, Contradiction):
                return reached, self._contradiction_text(plan), None
            if (plan.times, plan.faults) in tried:
                break
            tried.add((plan.times, plan.faults))
            playing = _play(self._scenario, self._path.begun, self._followed, self._wanted, self._keys, plan, seed, self._times)
            reached = playing.reached
            if reached > self._best[0]:
                self._best = (reached, plan, seed, playing.came)
            if reached == len(self._followed) - 1:
                return reached, "", plan
            problem = self._mismatch_text(reached)
            if reached + 1 in self._by_chance:
                break
        return reached, problem, None

    def _mismatch_text(self, reached: int) -> str:
        before, step = self._followed[reached], self._followed[reached + 1]
        assert step.move is not None
        return f"step {reached + 1}, “{move_text(self._scenario, step.move, before, step)}”, did not come as it should"

    def _contradiction_text(self, found: Contradiction) -> str:
        names = {task: name for each in self._followed for task, (name, _) in each.running.items()}
        counted = {number: each for step in self._followed for number, each in step.countdowns.items()}
        things: list[str] = []
        for tag in found.tags:
            if tag[0] in ("act", "fail", "part", "voice", "cancel"):
                things.append(names[tag[1]])
            elif tag[0] == "timer":
                things.append(f"the {counted[tag[1]].length / 1000:g} s of {counted[tag[1]].owner}")
        what = " and ".join(dict.fromkeys(things)) or "its steps"
        return f"no times were found at which it goes like this: {what} would have to take longer or shorter"

    def _why_not(self, problem: str) -> str:
        return problem or "it could not be played"

    def _result(self, plan: PlannedTimes, seed: int, problem: str) -> PlayedPath:
        tasks = [
            TimedTask(round(plan.times[step], 3), replace(each.submitted, source="file"), FILE, step)
            for step, each in enumerate(self._followed)
            if each.submitted is not None
        ]
        return PlayedPath(tuple(tasks), plan.faults, seed, self._path.begun.condition, not problem, problem)


# --- one attempt ------------------------------------------------------------------------------------------------------


def _play(
    scenario: Scenario,
    begun: SessionStarted,
    followed: Sequence[Followed],
    wanted: Sequence[_Seen],
    keys: Sequence[str],
    plan: PlannedTimes,
    seed: int,
    times: PathTimes,
) -> _Playing:
    """Play it once, as `rise-engine run --tasks --speed max` does, and learn from it."""
    clock, records = VirtualClock(), list[AnyRecord]()
    robot = make_robot(scenario.robot, "debug", clock, seed, plan.faults)
    engine = Engine(scenario, robot, clock, seed, started=begun, sinks=[records.append])
    engine.start()
    submitted: list[int] = []
    own_tasks: dict[int, int] = {}
    for step, each in enumerate(followed):
        if each.submitted is not None:
            clock.call_at(round(plan.times[step], 3), _submission(engine, each.submitted, submitted, step))
    reached = 0
    last = len(followed) - 1
    now, pending = wanted[0], False
    advances, moment, inputs = 0, 0.0, 0
    deadline = plan.times[-1] + 30.0
    while reached < last:
        count = len(submitted)
        if not clock.advance() or clock.now() > deadline:
            break
        if clock.now() > moment:
            moment, inputs = clock.now(), engine.inputs
        elif engine.inputs - inputs > _LIVELOCK:
            break
        before, now = now, _seen_of(engine.kernel, keys)
        if len(submitted) > count:
            if submitted[-1] != reached + 1 or before != wanted[reached]:
                break
            pending = now != wanted[reached + 1]  # the robot may still have to confirm something: it must settle
            reached += not pending
        elif now == wanted[reached + 1] != wanted[reached] and (pending or followed[reached + 1].submitted is None):
            reached, pending = reached + 1, False
        _note_tasks(engine.kernel, followed[reached], now == wanted[reached], own_tasks)
        while (  # what leaves everything as it was is not to be seen: its time must do
            reached < last
            and wanted[reached + 1] == wanted[reached]
            and followed[reached + 1].submitted is None
            and clock.now() >= plan.times[reached + 1] - 0.001
        ):
            reached += 1
            _note_tasks(engine.kernel, followed[reached], True, own_tasks)
    if reached < last:
        until = clock.now() + _AFTERWARDS
        while advances < _MOST_ADVANCES and clock.now() < until and clock.advance():
            advances += 1
    playing = _Playing(reached)
    playing.changed = _learn(scenario, records, own_tasks, times, plan)
    engine.abandon()
    return playing


def _submission(engine: Engine, task: Submit, submitted: list[int], step: int) -> Any:
    def submit() -> None:
        submitted.append(step)
        engine.post(replace(task, source="file"))

    return submit


def _note_tasks(kernel: Kernel, step: Followed, is_there: bool, own_tasks: dict[int, int]) -> None:
    """Which task is which of the path's. An act that has begun again in between is not the same."""
    if not is_there:
        return
    runs = kernel.scheduler.runner.runs.items()
    for task, (name, _) in step.running.items():
        if task not in own_tasks.values():
            free = (real for real, run in runs if run.task.behavior == name and real not in own_tasks)
            if (real := next(free, None)) is not None:
                own_tasks[real] = task


def _expected(scenario: Scenario, record: ActionRecord) -> float:
    """Seconds that an action will probably take that has begun."""
    spec = scenario.robot.actions[record.sent_as or record.type]
    return expected_seconds(spec, {name: value for name, value in record.parameters.items() if name in spec.parameters})


def _learn(
    scenario: Scenario,
    records: Sequence[AnyRecord],
    own_tasks: dict[int, int],
    times: PathTimes,
    plan: PlannedTimes,
) -> bool:
    """Take in how long actions took, and the how-manieth of their kind they were. `own_tasks`: those that are acts of
    the path, and which."""
    known = times.known
    before = (dict(known.seconds), dict(known.goals))
    counts: dict[str, int] = {}
    started: dict[tuple[int, str], float] = {}
    for record in records:
        if not isinstance(record, ActionRecord):
            continue
        if record.status == "started":
            kind = record.sent_as or record.type
            counts[kind] = counts.get(kind, 0) + 1
        if record.task not in own_tasks:
            continue
        key = (own_tasks[record.task], record.action)
        if record.status == "started":
            started[key] = record.t
            known.goals[key] = (kind, counts[kind])
            known.seconds[key] = _expected(scenario, record)
        elif record.status == "succeeded" and key in started and key not in plan.spoilt:
            known.seconds[key] = (record.t - started[key]) / plan.factors.get(key, 1.0)
    return (known.seconds, known.goals) != before


# --- what is compared -------------------------------------------------------------------------------------------------


def _compared_keys(scenario: Scenario, path: Path) -> tuple[str, ...]:
    """The memory keys whose values stand in the path's situations; none, when that cannot be told."""
    memories = [{**scenario.memory, **condition.memory} for condition in scenario.conditions.values()]
    keys = tuple(keys_that_matter(scenario, memories or [scenario.memory]))
    return keys if len(keys) == len(path.beginning.memory) and not scenario.reads_session else ()


def _seen_in(situation: Situation, keys: Sequence[str]) -> _Seen:
    return _Seen(
        tuple(sorted((rule.name, rule.state) for rule in situation.rules)),
        tuple(act.name for act in situation.waiting),
        tuple(sorted((act.name, "running" if act.phase == "doomed" else act.phase) for act in situation.running)),
        tuple(act.name for act in situation.asked),
        tuple(sorted((each.purpose, each.owner, each.transition) for each in situation.countdowns)),
        situation.kept,
        situation.stop,
        situation.robot_lost,
        situation.cue_open,
        tuple(_comparable(value) for value in situation.memory) if keys else (),
    )


def _seen_of(kernel: Kernel, keys: Sequence[str]) -> _Seen:
    core, runner = kernel.core, kernel.scheduler.runner
    countdowns = []
    for target in core.timers.values():
        if target.purpose == "after":
            countdowns.append(("after", target.owner, int(target.item)))
        elif target.purpose == "keep":
            countdowns.append(("keep", kernel.rules.kept[int(target.owner)].topic, 0))
        elif target.purpose == "filler":
            countdowns.append(("filler", target.owner, 0))
    encode = msgspec.json.encode
    return _Seen(
        tuple(sorted((run.name, run.state.id) for run in kernel.rules.stack.values())),
        tuple(task.behavior for task in kernel.scheduler.waiting),
        tuple(sorted((run.task.behavior, _phase(run.cancel_reason, run.failure)) for run in runner.runs.values())),
        tuple(task.behavior for task in kernel.failures.state.asked.values()),
        tuple(sorted(countdowns)),
        tuple(kept.topic for kept in kernel.rules.kept.values()),
        kernel.stop.status,
        runner.robot_lost is not None,
        core.open_cue_at is not None,
        tuple(_comparable(encode(core.memory[key]) if key in core.memory else None) for key in keys),
    )


def _phase(cancel_reason: str | None, failure: str | None) -> str:
    if cancel_reason is not None:
        return "canceling" if failure is None else "failing and canceling"
    return "running" if failure is None else "failing"


def _comparable(value: bytes | None) -> bytes | None:
    """A memory value as it is compared: of fractions only that they are some, for chance may have made them."""
    return b"0.5" if value is not None and b"." in value and isinstance(msgspec.json.decode(value), float) else value
