"""A path followed step by step on one kernel: the act, the timer and the consequences of each step."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import msgspec
from msgspec import Struct

from rise_engine.author.explore.act_traits import ActTraits, Decisions, Phase, WholeActRun, traits_of
from rise_engine.author.explore.moves import Bounds, Move
from rise_engine.author.explore.situation import Countdown, Situation, SituationKernel
from rise_engine.author.explore.situation_graph import Path
from rise_engine.base.errors import RiseError
from rise_engine.expression import Environment
from rise_engine.kernel.inputs import ActionReport, AnyInput, RobotChanged, StopReport, Submit, TimerElapsed
from rise_engine.kernel.records import AnyRecord
from rise_engine.scenario.model import Scenario, normal_topic

SOURCE = "engine"
"""The source of requests while a path is followed."""


class Followed(Struct, frozen=True):
    """One step of a path after it was taken; or its beginning, which has no move."""

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
    """What a person requests in it."""
    by_chance: bool = False
    """Whether chance decided something in it."""


class _Draws(Decisions):
    """Decisions that distinguish chance from what only the moment decides."""

    drawn = False

    def integer_below(self, count: int) -> int:
        self.drawn = self.drawn or count > 1
        return super().integer_below(count)

    def fraction(self) -> float:
        self.drawn = True
        return super().fraction()


def act_traits(scenario: Scenario, path: Path, bounds: Bounds) -> dict[str, ActTraits]:
    """Compute the traits of each act in the session that a path begins with."""
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
    followed = [_look(kernel, path.beginning, records)]
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
        followed.append(_look(kernel, step.situation, records, step.move, task, timer, submitted, draws.drawn))
        _compare(kernel, step.situation, at + 1)
    return followed


def _look(
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
    """Check that the step has come as in the path."""
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
    """Return a move as an input for the kernel in its present state, with its task and its timer."""
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
            behavior = move.name if oldest == task else str(task)  # if several have the name, it means the oldest
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
                behavior = json.dumps({rule[0]: move.how for rule in before.stood}, ensure_ascii=False)
        case _:
            raise LookupError(move.kind)
    return Submit(function=function, behavior=behavior, source=SOURCE)
