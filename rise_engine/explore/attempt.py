"""One attempt to play a path: on the engine, in virtual time, by the simulated robot; step by step compared."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import msgspec
from msgspec.structs import replace

from rise_engine.engine.clock import VirtualClock
from rise_engine.engine.drivers import make_robot
from rise_engine.engine.engine import Engine
from rise_engine.explore.following import Followed
from rise_engine.explore.path_times import KnownCourses, PlannedTimes
from rise_engine.explore.situation import Situation
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.kernel.records import ActionRecord, AnyRecord
from rise_engine.scenario import expected_seconds
from rise_engine.scenario.model import Scenario

_AFTERWARDS = 120.0
"""Virtual seconds for which it is watched how acts end that have begun before it went otherwise."""
_MOST_ADVANCES = 400
_LATER = 30.0
"""Virtual seconds after its time until which the last step is waited for."""
_LIVELOCK = 5_000
"""Inputs in one moment beyond which it is given up."""


class Seen(NamedTuple):
    """What is compared of a situation. In which order rules and acts stand is not."""

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


class Attempt:
    """A session that is to go like a path."""

    def __init__(
        self,
        scenario: Scenario,
        begun: SessionStarted,
        followed: Sequence[Followed],
        keys: Sequence[str],
        plan: PlannedTimes,
        seed: int,
    ) -> None:
        """Nothing has been played yet.

        Arguments:
            scenario: in debug mode.
            begun: what the session begins with.
            followed: the path.
            keys: the memory keys whose values stand in its situations; none: they are not compared.
            plan: when is to happen what.
            seed: of chance.
        """
        self._scenario = scenario
        self._followed = followed
        self._keys = keys
        self._plan = plan
        self._wanted = [seen_in(each.situation, keys) for each in followed]
        self._clock = VirtualClock()
        self._records: list[AnyRecord] = []
        robot = make_robot(scenario.robot, "debug", self._clock, seed, plan.faults)
        self._engine = Engine(scenario, robot, self._clock, seed, started=begun, sinks=[self._records.append])
        self._submitted: list[int] = []
        self._own_tasks: dict[int, int] = {}
        """The acts of the path that have begun: for each of the engine's tasks, the path's."""
        self.reached = 0
        """How many steps have come as the path has them."""
        self.reached_at = 0.0
        """Session time at which the last of them came."""

    def play(self) -> bool:
        """Play it as `rise-engine run --tasks` does; whether it went like the path."""
        self._engine.start()
        for step, each in enumerate(self._followed):
            if each.submitted is not None:
                self._clock.call_at(round(self._plan.times[step], 3), self._submission(each.submitted, step))
        last = len(self._followed) - 1
        self._follow(last)
        self.reached_at = self._clock.now()
        if self.reached < last:
            until, advances = self._clock.now() + _AFTERWARDS, 0
            while advances < _MOST_ADVANCES and self._clock.now() < until and self._clock.advance():
                advances += 1
        self._engine.abandon()
        return self.reached == last

    def _submission(self, task: Submit, step: int) -> Callable[[], None]:
        def submit() -> None:
            self._submitted.append(step)
            self._engine.post(replace(task, source="file"))

        return submit

    def _follow(self, last: int) -> None:
        """Let time pass until the path's end, or until something comes otherwise."""
        clock, engine = self._clock, self._engine
        wanted, times = self._wanted, self._plan.times
        now, is_pending = wanted[0], False
        moment, inputs = 0.0, 0
        while self.reached < last:
            count = len(self._submitted)
            if not clock.advance() or clock.now() > times[-1] + _LATER:
                return
            if clock.now() > moment:
                moment, inputs = clock.now(), engine.inputs
            elif engine.inputs - inputs > _LIVELOCK:
                return
            before, now = now, seen_of(engine.kernel, self._keys)
            following = self.reached + 1
            if len(self._submitted) > count:
                if self._submitted[-1] != following or before != wanted[self.reached]:
                    return
                is_pending = now != wanted[following]  # the robot may still have to confirm something
                self.reached += not is_pending
            elif now == wanted[following] != wanted[self.reached] and (
                is_pending or self._followed[following].submitted is None
            ):
                self.reached, is_pending = following, False
            self._note_tasks(now)
            while self._is_unseen(self.reached + 1, last):
                self.reached += 1
                self._note_tasks(now)

    def _is_unseen(self, step: int, last: int) -> bool:
        """Whether a step has come that leaves everything as it was: its time must do."""
        return (
            step <= last
            and self._wanted[step] == self._wanted[step - 1]
            and self._followed[step].submitted is None
            and self._clock.now() >= self._plan.times[step] - 0.001
        )

    def _note_tasks(self, now: Seen) -> None:
        """Which task is which of the path's. An act that has begun again in between is not the same."""
        if now != self._wanted[self.reached]:
            return
        own = self._own_tasks
        runs = self._engine.kernel.scheduler.runner.runs.items()
        for task, (name, _) in self._followed[self.reached].running.items():
            if task not in own.values():
                free = (real for real, run in runs if run.task.behavior == name and real not in own)
                if (found := next(free, None)) is not None:
                    own[found] = task

    def teach(self, known: KnownCourses) -> None:
        """Tell how long the actions of its acts take, and the how-manieth of their kinds they were."""
        counts: dict[str, int] = {}
        started: dict[tuple[int, str], float] = {}
        for record in self._records:
            if not isinstance(record, ActionRecord):
                continue
            kind = record.sent_as or record.type
            if record.status == "started":
                counts[kind] = counts.get(kind, 0) + 1
            if record.task not in self._own_tasks:
                continue
            key = (self._own_tasks[record.task], record.action)
            if record.status == "started":
                started[key] = record.t
                known.goals[key] = (kind, counts[kind])
                known.seconds[key] = _expected(self._scenario, record)
            elif record.status == "succeeded" and key in started and key not in self._plan.spoilt:
                known.seconds[key] = (record.t - started[key]) / self._plan.factors.get(key, 1.0)


def _expected(scenario: Scenario, record: ActionRecord) -> float:
    """Seconds that an action will probably take that has begun."""
    spec = scenario.robot.actions[record.sent_as or record.type]
    return expected_seconds(spec, {name: value for name, value in record.parameters.items() if name in spec.parameters})


# --- what is compared -------------------------------------------------------------------------------------------------


def seen_in(situation: Situation, keys: Sequence[str]) -> Seen:
    """What is compared of a situation of a path."""
    return Seen(
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


def seen_of(kernel: Kernel, keys: Sequence[str]) -> Seen:
    """What is compared of a session that is played."""
    core, runner = kernel.core, kernel.scheduler.runner
    countdowns = []
    for target in core.timers.values():
        if target.purpose == "after":
            countdowns.append(("after", target.owner, int(target.item)))
        elif target.purpose == "keep":
            countdowns.append(("keep", kernel.rules.kept[int(target.owner)].topic, 0))
        elif target.purpose == "repeat":
            failed = kernel.failures.state.asked
            countdowns.append(("repeat", failed[int(target.owner)].behavior, [*failed].index(int(target.owner))))
        elif target.purpose == "filler":
            countdowns.append(("filler", target.owner, 0))
    encode = msgspec.json.encode
    return Seen(
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
