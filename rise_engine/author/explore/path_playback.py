"""Playback of a path on the engine: finds times of people's actions and faults with which a session takes it.

The simulated robot plays it in virtual time, like `rise-engine run --tasks`. A person's action comes a moment after the
previous step; for everything else, playback waits. If a fault is necessary, it plays the path again with it. A path
that cannot be reproduced is only called perhaps possible.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product, takewhile
from textwrap import indent
from typing import Any

import msgspec
from msgspec import Struct, field
from msgspec.structs import replace

from rise_engine.author.explore.influence import keys_that_matter
from rise_engine.author.explore.moves import Bounds, Move
from rise_engine.author.explore.path_words import Followed, follow_path, move_text
from rise_engine.author.explore.situation import Situation
from rise_engine.author.explore.situation_graph import Path
from rise_engine.author.trial.study_test import written_line
from rise_engine.kernel import Kernel
from rise_engine.kernel.records import ActionRecord, AnyRecord, TimingRecord
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.run.engine.drivers import make_robot
from rise_engine.run.engine.engine import Engine
from rise_engine.run.protocol.task_file import TimedTask
from rise_engine.scenario.model import Scenario

GAPS = (0.5, 0.02)
"""Seconds from the previous step to a person's action; the comfortable one is tried first."""
SEEDS = 25
"""Number of seeds that are tried for paths with chance."""
_BEFORE_END_SECONDS = 0.3
"""Seconds before an act's end for an action that would otherwise be forgotten."""
_LATER = 60.0
"""Virtual seconds that a step may take beyond its countdowns."""
_LIVELOCK = 5_000
"""Number of inputs in one moment after which playback gives up."""


class PlayedPath(Struct, frozen=True):
    """The playback of a path."""

    tasks: tuple[TimedTask, ...]
    """People's actions with their times; `line` is the number of the path's step."""
    faults: tuple[str, ...]
    """Faults in the form of `--fault`."""
    seed: int
    """The seed of the playback."""
    condition: str
    """The session's condition, as the scenario names it; empty: none."""
    seconds: float
    """Session time at the path's end."""
    is_certain: bool
    """Whether a playback had all situations of the path."""
    problem: str
    """Why it could not be played, in words without a full stop; empty: it was."""


def find_times(scenario: Scenario, path: Path, bounds: Bounds | None = None) -> PlayedPath:
    """Play a path on the engine. Between two steps, other situations may occur: a gaze ends and returns.

    :param scenario: the explored scenario.
    :param path: a path through its situations.
    :param bounds: the bounds of the exploration, with the values to try and the durations of acts.
    :raises RiseError: the path belongs to another scenario (`rise_engine.author.explore.path_words`).
    """
    scenario = replace(scenario, mode="debug")
    followed, keys = follow_path(scenario, path, bounds or Bounds()), _compared_keys(scenario, path)
    chances = [step for step, each in enumerate(followed) if each.by_chance]
    last, best = len(followed) - 1, None
    for seed, gap in product(range(SEEDS if chances else 1), GAPS):
        play = _play(scenario, path, followed, keys, seed, gap)
        best = play if best is None or play.reached > best.reached else best
        if best.reached == last or (gap == GAPS[-1] and (not chances or best.reached + 1 < chances[0])):
            break  # another seed would not help
    assert best is not None
    done = ((step, at, followed[step].submitted) for step, at in best.times.items())
    tasks = tuple(TimedTask(at, replace(task, source="file"), "path", step) for step, at, task in done if task)
    problem = "" if best.reached == last else _mismatch_text(scenario, followed, best.reached)
    faults, condition = best.needs.texts, path.begun.condition
    return PlayedPath(tasks, faults, best.seed, condition, best.reached_at, not problem, problem)


def _compared_keys(scenario: Scenario, path: Path) -> tuple[str, ...]:
    """Return the memory keys in the path's situations; empty: they cannot be determined."""
    memories = [{**scenario.memory, **condition.memory} for condition in scenario.conditions.values()]
    keys = tuple(keys_that_matter(scenario, memories or [scenario.memory]))
    return keys if len(keys) == len(path.beginning.memory) and not scenario.reads_session else ()


def _mismatch_text(scenario: Scenario, followed: Sequence[Followed], reached: int) -> str:
    step = followed[reached + 1]
    assert step.move is not None, "only the beginning is no move"
    text = move_text(scenario, step.move, followed[reached], step)
    return f"no timing was found that makes step {reached + 1}, “{text}”, happen as listed here"


# --- one playback -----------------------------------------------------------------------------------------------------


class _Needs(Struct, frozen=True):
    """The known necessary faults and delays."""

    slips: Mapping[int, str] = field(default_factory=dict)
    """Faults of actions, by the step in which their act fails."""
    delays: Mapping[int, float] = field(default_factory=dict)
    """Seconds by which a person acts later than usual, by step."""
    losses: tuple[tuple[float, ...], ...] = ()
    """When the robot is lost, and when it is back."""

    @property
    def texts(self) -> tuple[str, ...]:
        lost = ("vanish@" + "-".join(f"{at:.3f}" for at in each) for each in self.losses)
        return (*self.slips.values(), *lost)


def _play(
    scenario: Scenario, path: Path, followed: Sequence[Followed], keys: Sequence[str], seed: int, gap: float
) -> _Play:
    """Play a path, repeatedly, with each fault that turns out to be necessary."""
    needs = _Needs()
    while True:
        play = _Play(scenario, path, followed, keys, needs, seed, gap)
        play.go()
        if play.wanted is None:
            return play
        needs = play.wanted


class _Play:
    """One session that tries to take a path."""

    def __init__(self, scenario: Scenario, path: Path, followed: Sequence[Followed], keys: Sequence[str],
                 needs: _Needs, seed: int, gap: float) -> None:  # fmt: skip
        self._scenario, self._followed, self._keys, self._gap = scenario, followed, keys, gap
        self.needs, self.seed = needs, seed
        self._situations = [_path_parts(each.situation, keys) for each in followed]
        self._clock = VirtualClock()
        self._records: list[AnyRecord] = []
        robot = make_robot(scenario.robot, "debug", self._clock, seed, needs.texts)
        self._engine = Engine(scenario, robot, self._clock, seed, started=path.begun, sinks=[self._records.append])
        self._losses, self._inputs, self._moment = 0, 0, -1.0
        self.times: dict[int, float] = {}
        self.reached = 0
        """The number of steps that have come as in the path."""
        self.reached_at = 0.0
        """Session time of the last of these steps."""
        self.wanted: _Needs | None = None
        """The faults and delays that would reach the next step."""

    def go(self) -> None:
        """Let time pass until the path's end, or until something differs from it."""
        self._engine.start()
        while self.reached + 1 < len(self._followed) and self._matches_path(self.reached + 1):
            self.reached, self.reached_at = self.reached + 1, self._clock.now()
        self._engine.abandon()

    def _matches_path(self, step: int) -> bool:
        """Return whether a step comes as in the path, after the one before."""
        each, before, move = self._followed[step], self._followed[step - 1], self._move(step)
        if each.submitted is not None:
            return self._submit(step) and self._wait(step)
        if move.kind in ("lost", "back") and not self._check_link(move.kind == "lost"):
            return False
        fails = move.kind == "end" and move.how in ("failed", "aborted") and not before.situation.robot_lost
        if fails and step not in self.needs.slips:
            slip = self._find_fault(before.running[each.task][0], move.how == "aborted")
            if slip and slip not in self.needs.slips.values():
                self.wanted = replace(self.needs, slips={**self.needs.slips, step: slip})
            return False
        comes = self._wait(step)
        if not comes and move.kind == "end" and before.submitted is not None and step - 1 not in self.needs.delays:
            self._delay(step - 1, before.running[each.task][0])
        return comes

    def _delay(self, step: int, act: str) -> None:
        """Delay an action until shortly before an act's end, if it would otherwise be forgotten."""
        ends = (each.ended_at for each in self._records if isinstance(each, TimingRecord) and each.act == act)
        end = next((at for at in ends if at is not None and at > self.times[step]), 0.0)
        if (delay := end - _BEFORE_END_SECONDS - self.times[step]) > 0:
            self.wanted = replace(self.needs, delays={**self.needs.delays, step: delay})

    def _submit(self, step: int) -> bool:
        """Perform a person's action of a step; False: something else has come meanwhile."""
        task, done = self._followed[step].submitted, []
        assert task is not None
        at = self.times[step] = round(self._clock.now() + self._gap + self.needs.delays.get(step, 0.0), 3)

        def submit() -> None:
            done.append(_played_parts(self._engine.kernel, self._keys) == self._situations[step - 1])
            self._engine.post(replace(task, source="file"))

        self._clock.call_at(at, submit)
        while not done and self._advance():
            pass
        return done == [True]

    def _check_link(self, is_lost: bool) -> bool:
        """Return whether the robot is lost, or back, at the path's time; False: play again with that fault."""
        losses = self.needs.losses
        self._losses += is_lost
        known = losses[self._losses - 1] if self._losses <= len(losses) else ()
        if len(known) >= (1 if is_lost else 2):
            return True
        at = round(self._clock.now() + self._gap, 3)
        self.wanted = replace(self.needs, losses=(*losses[: self._losses - 1], (*known, at)))
        return False

    def _find_fault(self, act: str, is_aborted: bool) -> str:
        """Find a fault that makes a running act fail: its first action whose failure matters; empty: none."""
        counts: dict[str, int] = {}
        runs = self._engine.kernel.scheduler.runner.runs
        actions = {action.id: action for action in self._scenario.acts[act].actions}
        for record in (each for each in self._records if isinstance(each, ActionRecord) and each.status == "started"):
            kind = record.sent_as or record.type
            counts[kind] = counts.get(kind, 0) + 1
            if record.act != act or record.task not in runs or self._scenario.robot.actions[record.type].engine:
                continue
            if not actions[record.action].continue_on_failure:
                return f"{kind}={'abort' if is_aborted else 'fail'}@{counts[kind]}"
        return ""

    def _wait(self, step: int) -> bool:
        """Return whether the situation after a step comes eventually.

        When the robot is lost, its actions fail simultaneously, so the steps of those failures have come, too.
        """
        following = range(step + 1, len(self._followed)) if self._move(step).kind == "lost" else ()
        ends = takewhile(lambda each: self._move(each).kind == "end", following)
        wanted = [self._situations[each] for each in (step, *ends)]
        longest = max((each.length for each in self._followed[step - 1].countdowns.values()), default=0) / 1000
        until = self._clock.now() + longest + _LATER
        while _played_parts(self._engine.kernel, self._keys) not in wanted:
            if not self._advance() or self._clock.now() > until:
                return False
        return True

    def _move(self, step: int) -> Move:
        move = self._followed[step].move
        assert move is not None
        return move

    def _advance(self) -> bool:
        """Let the next event happen; False: there is none, or it loops without end."""
        if not self._clock.advance():
            return False
        if self._clock.now() > self._moment:
            self._moment, self._inputs = self._clock.now(), self._engine.inputs
        return self._engine.inputs - self._inputs <= _LIVELOCK


# --- comparison -------------------------------------------------------------------------------------------------------


def _path_parts(situation: Situation, keys: Sequence[str]) -> tuple[object, ...]:
    """Return the compared parts of a path's situation."""
    return (
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


def _played_parts(kernel: Kernel, keys: Sequence[str]) -> tuple[object, ...]:
    """Return the compared parts of a session in playback."""
    core, runner = kernel.core, kernel.scheduler.runner
    asked = kernel.failures.state.asked
    countdowns = []
    for target in core.timers.values():
        if target.purpose == "after":
            countdowns.append(("after", target.owner, int(target.item)))
        elif target.purpose == "keep":
            countdowns.append(("keep", kernel.rules.kept[int(target.owner)].topic, 0))
        elif target.purpose == "repeat":
            countdowns.append(("repeat", asked[int(target.owner)].behavior, [*asked].index(int(target.owner))))
        elif target.purpose == "filler":
            countdowns.append(("filler", target.owner, 0))
    return (
        tuple(sorted((run.name, run.state.id) for run in kernel.rules.stack.values())),
        tuple(task.behavior for task in kernel.scheduler.waiting),
        tuple(sorted((run.task.behavior, _phase(run.cancel_reason, run.failure)) for run in runner.runs.values())),
        tuple(task.behavior for task in asked.values()),
        tuple(sorted(countdowns)),
        tuple(kept.topic for kept in kernel.rules.kept.values()),
        kernel.stop.status,
        runner.robot_lost is not None,
        core.open_cue_at is not None,
        tuple(_comparable(msgspec.json.encode(core.memory[key]) if key in core.memory else None) for key in keys),
    )


def _phase(cancel_reason: str | None, failure: str | None) -> str:
    failing = "failing" if failure is not None else ""
    return (
        (f"{failing} and canceling" if failing else "canceling") if cancel_reason is not None else failing or "running"
    )


def _comparable(value: bytes | None) -> bytes | None:
    """Make a memory value comparable; all fractions count as equal, because they may be random."""
    return b"0.5" if value is not None and b"." in value and isinstance(msgspec.json.decode(value), float) else value


# --- the task file ----------------------------------------------------------------------------------------------------


def task_file_of(title: str, sentences: Sequence[str], played: PlayedPath, study: str) -> str:
    """Write a task file for `rise-engine run --tasks`.

    :param title: its subject, in a sentence.
    :param sentences: the path in sentences (`path_words.describe_path`).
    :param played: the playback.
    :param study: the scenario's folder, in the form of a command's argument.
    """
    lines = [
        indent(title, "# "),
        "#\n# Play it, with the name of this file:",
        f"#   rise-engine run {study} --tasks FILE --speed max",
        f"#   rise-engine serve {study} --tasks FILE   and in another terminal: rise-tui",
    ]
    if not played.is_certain:
        lines += ["#", indent(f"This path could not be confirmed: {played.problem}.", "# ")]
    lines.append("")
    if played.condition:
        lines.append(written_line({"condition": played.condition}))
    lines.append(written_line({"seed": played.seed}))
    lines += [written_line({"fault": fault}) for fault in played.faults]
    tasks = {task.line: task for task in played.tasks}
    for number, sentence in enumerate(sentences, 1):
        lines += ["", indent(f"{number}. {sentence}", "# ")]
        if (task := tasks.get(number)) is not None:
            lines.append(written_line(_line_of(task)))
    return "\n".join(lines) + "\n"


def _line_of(timed: TimedTask) -> dict[str, Any]:
    behavior = {"domain_task_behavior": timed.task.behavior} if timed.task.behavior else {}
    return {"function_type": timed.task.function, **behavior, "at": timed.at}
