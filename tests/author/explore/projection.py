"""What rules can see of a session, as a value: two explorers of a study are compared by the sets of these."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable
from typing import Any, NamedTuple, Protocol

from rise_engine.kernel import Kernel
from rise_engine.kernel.core import Task
from rise_engine.kernel.rule_stack import RuleRun
from rise_engine.kernel.speech import act_name
from rise_engine.scenario.model import SESSION


class Run(Protocol):
    """A running act, whoever runs it: action by action, or as one thing."""

    task: Task
    cancel_reason: str | None
    failure: str | None


class RunningRule(NamedTuple):
    """A rule on the stack."""

    name: str
    state: str
    priority: float
    latched: tuple[int, ...]
    """Transitions whose condition was taken, or for which a time counts, in their order."""
    timers: tuple[int, ...]
    """Transitions for which a time counts, in the order in which it began."""
    own_acts: tuple[str, ...]
    """Acts that it has started and whose end it may still wait for."""


class RunningAct(NamedTuple):
    name: str
    calling_type: str
    phase: str
    """running, canceling, or failing: it has failed, and what it still does is being stopped."""


class Projection(NamedTuple):
    """A situation. Where order cannot matter, things are sorted."""

    rules: tuple[RunningRule, ...]
    """The bottom of the stack first."""
    waiting: tuple[tuple[str, str], ...]
    """Acts with their calling types, next first."""
    running: tuple[RunningAct, ...]
    asked: tuple[tuple[str, int, str], ...]
    """Failed acts that somebody is asked about, each with its attempt, as far as that decides what becomes of it, and
    whether it is repeated by itself: after a pause, when the robot is back, or not."""
    kept: tuple[str, ...]
    """Topics of kept events, the oldest first."""
    stop: str
    stopped_rules: tuple[tuple[str, str], ...]
    """Rules that the stop has ended, with their states, the bottom of the stack first."""
    robot_lost: bool
    cue_open: bool
    memory: tuple[tuple[str, str | None], ...]
    """The keys that were asked for, by name, with their values as JSON; null: there is no such key."""


def project(kernel: Kernel, keys: Collection[str], *, in_order: bool = True) -> Projection:
    """What rules can see of a session between two inputs.

    Arguments:
        kernel: its `scheduler.runner` may be of another class, with `runs: dict[int, Run]` and `robot_lost`.
        keys: whole memory keys that count. Of `session`, only whether there is a cue, and a stop.
        in_order: whether it is told apart in which order a rule's timers were set; else they are sorted.
    """
    runs: Iterable[Run] = kernel.scheduler.runner.runs.values()
    memory = kernel.core.memory
    return Projection(
        rules=tuple(
            RunningRule(
                run.name,
                run.state.id,
                run.priority,
                tuple(sorted(run.latched)),
                _timers(run, in_order),
                tuple(sorted(run.own_acts)),
            )
            for run in kernel.rules.stack.values()
        ),
        waiting=tuple((act_name(task), task.calling_type) for task in kernel.scheduler.waiting),
        running=tuple(sorted(RunningAct(act_name(run.task), run.task.calling_type, phase_of(run)) for run in runs)),
        asked=tuple(
            sorted(
                (task.behavior, _attempt(kernel, task), _repeats(kernel, task))
                for task in kernel.failures.state.asked.values()
            )
        ),
        kept=tuple(kept.topic for kept in kernel.rules.kept.values()),
        stop=kernel.stop.status,
        stopped_rules=tuple((rule.name, rule.state) for rule in kernel.stop.stopped_rules),
        robot_lost=kernel.scheduler.runner.robot_lost is not None,
        cue_open=kernel.core.open_cue_at is not None,
        memory=tuple((key, _value(memory, key)) for key in sorted(keys)),
    )


def _attempt(kernel: Kernel, task: Task) -> int:
    return min(task.attempt, kernel.scenario.failure_policy(task.behavior).times + 1)


def _repeats(kernel: Kernel, task: Task) -> str:
    pauses = kernel.failures.state.pauses
    return "" if task.id not in pauses else "without robot" if pauses[task.id] is None else "pausing"


def _timers(run: RuleRun, in_order: bool) -> tuple[int, ...]:
    indexes = [run.timers[timer].index for timer in sorted(run.timers)]
    return tuple(indexes if in_order else sorted(indexes))


def phase_of(run: Run) -> str:
    """How far an act is, as far as anybody can tell who does not see its actions."""
    if run.cancel_reason is not None:
        return "canceling"
    return "failing" if run.failure is not None else "running"


def difference(one: set[Any], other: set[Any], shown: int = 3) -> str:
    """Where two sets of projections differ, in words for a failed test; empty: nowhere."""
    lines = [
        f"only in the {which} ({len(some)}):\n" + "\n".join(f"    {each}" for each in sorted(some, key=repr)[:shown])
        for which, some in (("first", one - other), ("second", other - one))
        if some
    ]
    return "\n".join(lines)


def _value(memory: dict[str, Any], key: str) -> str | None:
    value = memory.get(key)
    if key == SESSION and isinstance(value, dict):
        value = {part: value[part] for part in ("cue", "stopped")}
    return json.dumps(value, sort_keys=True, ensure_ascii=False) if key in memory else None
