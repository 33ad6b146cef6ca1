"""The kernel's whole state as a value: taken between inputs, sent or stored, and brought back to life."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import msgspec
from msgspec import Struct

from rise_engine.kernel.acts import ActRun
from rise_engine.kernel.core import Task, TimerTarget
from rise_engine.kernel.stop import StopStatus
from rise_engine.kernel.wizard import WizardState

if TYPE_CHECKING:
    from rise_engine.kernel.kernel import Kernel


class SnapshotError(ValueError):
    """A snapshot does not fit the scenario that it is to go on with; the message is a sentence for a person."""


class RuleSnapshot(Struct, frozen=True):
    name: str
    state: str
    task: Task
    priority: float
    stamp: int
    timers: dict[int, int]
    """Timer to index of the transition that it is for, in the state. An index says which one only within the very
    scenario that the snapshot was taken of, as everything else in it does; so `Snapshot.scenario` is compared first."""
    held: list[int]
    steps: int
    """Transitions that it has taken in the go that timers of the same moment would still belong to."""


class Snapshot(Struct, frozen=True):
    """Plain data through and through: it can be encoded as JSON and decoded again."""

    scenario: str
    """The hash of the scenario's files: with others, nothing in here means what it says."""
    seed: int
    t: float
    seq: int
    chance: int
    next_task: int
    next_timer: int
    timers: dict[int, TimerTarget]
    noticed: list[str]
    memory: dict[str, Any]
    rules: list[RuleSnapshot]
    """Bottom of the stack first."""
    spent: dict[str, int]
    """Steps of rules that have ended, as `RuleSnapshot.steps`."""
    stamp: int
    waiting: list[Task]
    acts: list[ActRun]
    last_pick: dict[str, int]
    robot_lost: str | None
    stop: StopStatus
    stop_timer: int | None
    wizard: WizardState
    cue: float | None
    participant: str
    condition: str


def take(kernel: Kernel) -> Snapshot:
    core, runner, rules = kernel.core, kernel.scheduler.runner, kernel.rules
    snapshot = Snapshot(
        scenario=core.scenario.hash,
        seed=kernel.seed,
        t=core.t,
        seq=core.seq,
        chance=core.chance.state,
        next_task=core.next_task,
        next_timer=core.next_timer,
        timers=core.timers,
        noticed=sorted(core.noticed),
        memory=core.memory,
        rules=[
            RuleSnapshot(
                run.name,
                run.state.id,
                run.task,
                run.priority,
                run.stamp,
                {timer: transition.index for timer, transition in run.timers.items()},
                sorted(run.held),
                run.steps if run.step == core.step else 0,
            )
            for run in rules.stack.values()
        ],
        spent={name: steps for name, (step, steps) in rules.spent.items() if step == core.step},
        stamp=rules.stamp,
        waiting=kernel.scheduler.waiting,
        acts=list(runner.runs.values()),
        last_pick=runner.last_pick,
        robot_lost=runner.robot_lost,
        stop=kernel.stop.status,
        stop_timer=kernel.stop.timer,
        wizard=kernel.wizard.state,
        cue=core.cue,
        participant=kernel.participant,
        condition=kernel.condition,
    )
    return _copy(snapshot)


def restore(kernel: Kernel, snapshot: Snapshot) -> None:
    """Bring a kernel that has done nothing yet to where the snapshot was taken. Raises SnapshotError."""
    if snapshot.scenario != kernel.core.scenario.hash:
        raise SnapshotError("the scenario's files are not those that the snapshot was taken with")
    try:
        _restore(kernel, _copy(snapshot))
    except LookupError as error:  # a scenario without files has no hash to tell it apart
        raise SnapshotError(f"the snapshot was taken of another scenario: it has no {error}") from error


def _restore(kernel: Kernel, snapshot: Snapshot) -> None:
    core = kernel.core
    core.t, core.seq = snapshot.t, snapshot.seq
    core.chance.state = snapshot.chance
    core.next_task, core.next_timer = snapshot.next_task, snapshot.next_timer
    core.timers = snapshot.timers
    core.noticed = set(snapshot.noticed)
    core.memory.update(snapshot.memory)
    for rule in snapshot.rules:
        run = kernel.rules.resume(rule.name, rule.state, rule.task)
        run.priority, run.stamp = rule.priority, rule.stamp
        run.timers = {timer: run.state.transitions[index] for timer, index in rule.timers.items()}
        if any(transition.after is None for transition in run.timers.values()):
            raise LookupError(f"`after` in the state {rule.state} of {rule.name}")
        run.held = set(rule.held)
        run.step, run.steps = core.step, rule.steps
    kernel.rules.spent = {name: (core.step, steps) for name, steps in snapshot.spent.items()}
    kernel.rules.stamp = snapshot.stamp
    kernel.scheduler.waiting = snapshot.waiting
    kernel.scheduler.runner.restore(snapshot.acts, snapshot.last_pick, snapshot.robot_lost)
    kernel.stop.status, kernel.stop.timer = snapshot.stop, snapshot.stop_timer
    kernel.wizard.state, core.cue = snapshot.wizard, snapshot.cue
    kernel.participant, kernel.condition = snapshot.participant, snapshot.condition


def _copy(snapshot: Snapshot) -> Snapshot:
    """By way of JSON, so that what is taken never shares anything with the kernel and can surely be sent."""
    return msgspec.json.decode(msgspec.json.encode(snapshot), type=Snapshot)
