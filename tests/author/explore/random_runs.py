"""A random wizard with a robot that takes its time: what an explorer says can never happen must not happen here."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random
from typing import Literal

from msgspec.structs import replace

from rise_engine.kernel import Kernel
from rise_engine.kernel.act_runner import CANCEL_LIMIT
from rise_engine.kernel.commands import CancelAction, CancelTimer, SetTimer, StartAction, StopRobot
from rise_engine.kernel.inputs import (
    ActionReport,
    AnyInput,
    RobotChanged,
    SessionStarted,
    StopReport,
    Submit,
    TimerElapsed,
)
from rise_engine.kernel.records import ENDINGS, ActionRecord, AnyRecord
from rise_engine.kernel.stop import STOP_LIMIT
from rise_engine.scenario.model import Scenario
from tests.author.explore.naive import START, WORLD, release
from tests.author.explore.world import SOURCE, World, is_fault, presses

PACE = (0.5, 3.0)
"""How many times what is expected an action takes, at least and at most."""
GAPS = (0.0, 0.0, 0.02, 0.2, 0.7, 1.5, 4.0, 12.0, 70.0)
"""Seconds for which people do nothing."""
JUST_BEFORE = 1e-6


class Goal:
    """An action that the robot does."""

    def __init__(self, ends_at: float, fails: bool) -> None:
        self.ends_at = ends_at
        self.status: Literal["succeeded", "failed", "canceled"] = "failed" if fails else "succeeded"


def random_run(
    scenario: Scenario,
    seed: int,
    steps: int,
    *,
    world: World = WORLD,
    start: SessionStarted = START,
    pace: tuple[float, float] = PACE,
) -> Iterator[Kernel]:
    """Play a study at random, action by action, and give the kernel after each input, the first one included.

    What people do that would lead beyond a bound of `world` is not done. When something else leads beyond one, the run
    is over before it. The kernels are to be looked at, not changed; a later one may be another object.

    Arguments:
        seed: one run for each number.
        steps: inputs at most, besides the start of the session.
        pace: how many times what is expected actions take; a wait takes exactly its time, a cancel less than
            CANCEL_LIMIT, the answer to a stop less than STOP_LIMIT.
    """
    run = _Run(scenario, seed, world, pace)
    run.do(start)
    if world.exceeds(run.kernel):
        return
    yield run.kernel
    for _ in range(steps):
        if not run.step():
            return
        yield run.kernel


class _Run:
    def __init__(self, scenario: Scenario, seed: int, world: World, pace: tuple[float, float]) -> None:
        self.random = Random(seed)
        self.scenario = scenario
        self.world = world
        self.pace = pace
        self.always = presses(scenario, world)
        self.favourites = self.random.sample(self.always, min(len(self.always), self.random.choice([2, 4, 8, 100])))
        """What is asked for mostly in this run."""
        self.patience = self.random.choice([0.2, 0.5, 0.8])
        """How often nothing is asked for."""
        self.kernel = Kernel(scenario, seed)
        self.t = 0.0
        self.timers: dict[int, float] = {}
        self.goals: dict[str, Goal] = {}
        self.answers_at: float | None = None
        """When the robot answers a stop."""
        self.faults = world.faults

    def step(self) -> bool:
        """The next input; false when it would lead beyond a bound."""
        due = self.next_due()
        at = self.t + self.random.choice(GAPS)
        wins = due is not None and (at > due or self.random.random() < (0.5 if at == due else self.patience))
        if due is None or not wins:
            self.t = at
            return self.somebody_acts()
        at = due
        self.t = max(self.t, at)
        return self.do_and_look(self.due_input(at))

    # --- what happens by itself ---

    def next_due(self) -> float | None:
        times = [*self.timers.values(), *(goal.ends_at for goal in self.goals.values())]
        if self.answers_at is not None:
            times.append(self.answers_at)
        return min(times, default=None)

    def due_input(self, at: float) -> AnyInput:
        """What comes at this time: of several things any, but of timers the one that was set first."""
        timers = [timer for timer, when in self.timers.items() if when == at]
        due: list[AnyInput] = [TimerElapsed(timer=min(timers))] if timers else []
        for id, goal in self.goals.items():
            if goal.ends_at == at:
                aborted = self.world.robot and goal.status == "failed" and self.random.random() < 0.3
                due.append(ActionReport(action=id, status=goal.status, aborted=aborted))
        if self.answers_at == at:
            due.append(StopReport(confirmed=("robot",)))
        input = self.random.choice(due)
        if isinstance(input, TimerElapsed):
            del self.timers[input.timer]
        elif isinstance(input, StopReport):
            self.answers_at = None
        return input

    # --- what people and nodes do ---

    def somebody_acts(self) -> bool:
        """One thing that leads beyond no bound; nothing, when no such thing is found. Never false."""
        for _ in range(5):
            input = self.pick()
            before = self.kernel.snapshot()
            known = dict(self.timers), dict(self.goals), self.answers_at, self.faults
            if self.do_and_look(input):
                return True
            self.kernel = Kernel.restore(self.scenario, before)
            self.timers, self.goals, self.answers_at, self.faults = known
        return True

    def pick(self) -> AnyInput:
        random, kernel, world = self.random, self.kernel, self.world
        failures = kernel.failures.state
        asked = [id for id in failures.asked if failures.pauses.get(id) is None]
        if asked and random.random() < 0.4:
            answer = random.choice(["goOn", "repeatAct", "stopRuleOfAct"])
            return Submit(function=answer, behavior=str(random.choice(asked)), source=SOURCE)
        if kernel.scheduler.runner.robot_lost is not None and random.random() < 0.4:
            return RobotChanged(status="connected")
        if world.robot and self.faults and kernel.scheduler.runner.robot_lost is None and random.random() < 0.05:
            return RobotChanged(status="lost")
        if world.stop and kernel.stop.status == "latched" and random.random() < 0.6:
            return release(kernel.snapshot(), random.choice(world.releases))
        may_stop = world.stop and self.faults and (kernel.stop.status == "released" or world.stop_again)
        if may_stop and random.random() < 0.05:
            return Submit(function="stopAll", source=SOURCE)
        if world.cues and kernel.core.open_cue_at is not None and random.random() < 0.1:
            return Submit(function="undoCue", source=SOURCE)
        some = self.favourites if random.random() < 0.8 else self.always
        return random.choice(some) if some else Submit(function="raiseEventTopic", behavior="/nothing", source=SOURCE)

    # --- the kernel and the robot ---

    def do_and_look(self, input: AnyInput) -> bool:
        """Whether the bounds are kept."""
        self.do(input)
        return not self.world.exceeds(self.kernel)

    def do(self, input: AnyInput) -> None:
        self.faults -= isinstance(input, RobotChanged | Submit) and is_fault(input)
        records, commands = self.kernel.handle(replace(input, t=self.t))
        for command in commands:
            match command:
                case StartAction():
                    self.begin(command)
                case CancelAction(action=id):
                    if (goal := self.goals.get(id)) is not None:
                        goal = self.goals[id] = Goal(self.t + self.random.uniform(0, CANCEL_LIMIT - 0.1), False)
                        goal.status = "canceled"
                case SetTimer():
                    self.timers[command.timer] = command.at
                    self.end_before_limit(command)
                case CancelTimer():
                    del self.timers[command.timer]
                case StopRobot():
                    self.answers_at = self.t + self.random.uniform(0, STOP_LIMIT - 0.1)
        self.forget_ended(records)

    def begin(self, command: StartAction) -> None:
        least, most = self.pace
        factor = self.random.choice([least, 1.0, most, self.random.uniform(least, most)])
        fails = self.faults > 0 and self.random.random() < 0.2
        self.faults -= fails
        ends_in = command.expected * (self.random.uniform(0, most) if fails else factor)
        self.goals[command.action] = Goal(round(self.t + ends_in, 6), fails)

    def end_before_limit(self, command: SetTimer) -> None:
        """No action takes longer than its limit: that would be a fault."""
        target = self.kernel.core.timers.get(command.timer)
        if target is not None and target.purpose == "limit":
            goal = self.goals.get(f"{target.owner}/{target.item}")
            if goal is not None and goal.ends_at >= command.at:
                goal.ends_at = max(self.t, command.at - JUST_BEFORE)

    def forget_ended(self, records: list[AnyRecord]) -> None:
        for record in records:
            if isinstance(record, ActionRecord) and record.status in ENDINGS:
                self.goals.pop(f"{record.task}/{record.action}", None)
