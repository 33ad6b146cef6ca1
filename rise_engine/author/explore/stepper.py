"""One step of exploring: the kernel computes the possible successors of a situation."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import Any, NamedTuple, TypeAlias, cast

from rise_engine.author.explore.act_traits import MAX_SCRIPTS, traits_of
from rise_engine.author.explore.influence import keys_that_matter
from rise_engine.author.explore.moves import BY_PERSON, MISHAPS, Bounds, Move, Moves, Possibility
from rise_engine.author.explore.situation import PERSON, ActTask, Situation, SituationKernel
from rise_engine.author.explore.zones import NO_CLOCKS, Zone, carry, elapse, narrow
from rise_engine.expression import Expression
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.kernel.records import (
    AnyRecord,
    ConditionRecord,
    EventRecord,
    MemoryRecord,
    NoteRecord,
    RuleRecord,
    TaskRecord,
)
from rise_engine.scenario.model import Scenario

Fact: TypeAlias = tuple[Any, ...]
"""An observation: its kind (`Stepper`), and its subjects."""
END_BIT = 0
"""In `FollowedMove.moved`: the study's end was reached."""


class FollowedMove(NamedTuple):
    """The result of one move."""

    move: Move
    situation: Situation
    zone: Zone
    moved: int
    """The rules that have taken a step, as bits; a rule's bit is its number in the scenario plus 1."""
    facts: tuple[Fact, ...]
    """The facts that were first observed in it."""
    beyond: str
    """Why it is not followed: `line`, `beside`, `asked`, `kept`, `values` or `chance`; empty: it is."""


class Stepper:
    """Computes the possible successors of a situation.

    It reports these facts: `("transition", rule, state, index)`, `("state", rule, state)`, `("act", name)`, `("ended",
    rule, state)`, `("faulted", rule, reason)`, `("cut off", act, reason)`, `("missing", key, text, rule)`, `("error",
    text, problem, rule)`, `("note", text)`, `("two at once", act, act)`, `("in line", act, source)`, `("out of step",
    rule, state, act)`, `("failure matters", act, source)` and `("failure alike", act, source)`.
    """

    def __init__(
        self,
        scenario: Scenario,
        bounds: Bounds,
        beginnings: list[SessionStarted],
        end: str,
        properties: Sequence[Expression] = (),
    ) -> None:
        """:param beginnings: the sessions to explore, one for each condition.
        :param end: the rule that ends the study.
        :param properties: conditions that will be evaluated in the situations.
        """
        self.scenario = scenario
        self.bounds = bounds
        self.end = end
        self.beginnings = beginnings
        memories = [{**scenario.memory, **beginning.memory} for beginning in beginnings]
        traits = {
            name: traits_of(scenario, act, memories, bounds.pace or (0.0, 1.0)) for name, act in scenario.acts.items()
        }
        keys = keys_that_matter(scenario, memories, properties)
        follows_failures = {name for name in scenario.acts if scenario.failure_policy(name).kind != "go_on"}
        self.kernel = SituationKernel(scenario, keys, traits, follows_failures, in_order=bounds.pace is None)
        self.moves = Moves(scenario, traits, bounds)
        self._bits = {name: 1 << number for number, name in enumerate(scenario.rules, 1)}
        self._ends_of_acts = {
            f"/{name}_{how}": name for name in scenario.acts for how in ("end", "succeeded", "failed", "stopped")
        }
        self._share_channel = {
            frozenset((one, other))
            for one, other in combinations(scenario.acts, 2)
            if scenario.acts[one].channels & scenario.acts[other].channels
        } | {frozenset((name,)) for name, act in scenario.acts.items() if act.channels}
        self._known_facts: set[Fact] = set()
        self.steps = 0
        """The number of inputs that the kernel has handled."""

    def begin(self) -> list[Situation]:
        """Return the situations in which sessions begin."""
        found = []
        for beginning in self.beginnings:
            fresh = SituationKernel(
                self.scenario, self.kernel.keys, self.kernel.traits, set(), in_order=self.bounds.pace is None
            )
            fresh.kernel.handle(beginning)
            found.append(fresh.read(self.bounds.faults)[0])
        self.kernel.kernel.handle(self.beginnings[0])
        self.kernel.put(found[0])
        return found

    def follow(self, situation: Situation, zone: Zone) -> Iterator[FollowedMove]:
        """Yield the possible moves with newly observed facts. Moves without effect are omitted."""
        kernel = self.kernel
        handle = kernel.kernel.handle
        decisions = kernel.decisions
        timed = self.bounds.pace is not None
        stale = True
        succeeded: dict[int, Situation] = {}
        for possibility in self.moves.possible(situation):
            if (
                possibility.lengthens_line
                and len(situation.waiting) >= self.bounds.line
                and situation.stop == "released"
            ):
                yield FollowedMove(possibility.move, situation, zone, 0, (), "line")  # the same act would also wait
                continue
            when = zone
            if timed and possibility.move.kind == "timer" and _is_always_later(situation, zone, possibility.move.place):
                continue
            if timed and possibility.clock:
                narrowed = narrow(zone, possibility.clock, possibility.least, possibility.most)
                if narrowed is None:
                    continue
                when = narrowed
            script: list[int] | None = []
            tried = 0
            while script is not None:
                if stale:
                    kernel.put(situation)
                    tasks = tuple(kernel.runner.runs)
                    stale = False
                decisions.begin(script)
                records, _ = handle(possibility.input)
                self.steps += 1
                tried += 1
                move = possibility.move
                if decisions.made:
                    move = move._replace(chance=tuple(choice for choice, _ in decisions.made))
                script = decisions.next_script()
                if move.kind in BY_PERSON and not move.chance and not self._changes_anything(records):
                    continue
                stale = True
                step = self._read_step(situation, tasks, possibility, move, records, when)
                if script is not None and tried >= MAX_SCRIPTS:
                    script = None
                    step = step._replace(beyond=step.beyond or "chance")
                if move.kind == "end" and not move.chance:
                    step = self._compare_failure(situation, step, succeeded)
                if step.moved or step.beyond or step.situation != situation:
                    yield step

    def _changes_anything(self, records: list[AnyRecord]) -> bool:
        """Return whether an input has changed anything that matters, according to its records."""
        keys = self.kernel.keys
        for record in records:
            kind = type(record)
            if kind is EventRecord:
                if cast(EventRecord, record).taken_by is not None:
                    return True
            elif kind is TaskRecord:
                task = cast(TaskRecord, record)
                if task.status == "SUCCEEDED" and task.function not in _HARMLESS:
                    return True
                if task.status in ("PENDING", "ACTIVE"):
                    return True
            elif kind is MemoryRecord:
                write = cast(MemoryRecord, record)
                same = write.value == write.old and type(write.value) is type(write.old) and not write.created
                if write.key in keys and not (same and isinstance(write.value, str | bool)):
                    return True
            elif kind is not ConditionRecord and kind is not NoteRecord:
                return True
        return False

    def _read_step(
        self,
        before: Situation,
        tasks: tuple[int, ...],
        possibility: Possibility,
        move: Move,
        records: list[AnyRecord],
        when: Zone,
    ) -> FollowedMove:
        """Read the step that the kernel has just taken."""
        kernel, bounds = self.kernel, self.bounds
        faults_left = before.faults_left
        if (
            move.kind in MISHAPS
            or move.how == "aborted"
            or (move.how == "failed" and not before.robot_lost and before.running[move.place].phase != "doomed")
        ):
            faults_left -= 1
        situation, acts, timers = kernel.read(faults_left)
        moved, facts = self._facts(records)
        beyond = ""
        if len(situation.waiting) > bounds.line:
            beyond = "line"
            if asks_again(situation):
                facts.append(("in line", situation.waiting[-1].name, situation.waiting[-1].source))
        elif len(situation.running) > bounds.beside and (
            sum(act.calling_type == "None" for act in situation.running) > bounds.beside
        ):
            beyond = "beside"
        elif len(situation.asked) > bounds.asked:
            beyond = "asked"
        elif len(situation.kept) > bounds.kept:
            beyond = "kept"
        zone = NO_CLOCKS
        if bounds.pace is not None and not beyond:
            zone = self._zone_after(before, tasks, situation, acts, timers, possibility, when)
        known_facts = self._known_facts
        new = tuple([fact for fact in facts if fact not in known_facts])
        known_facts.update(new)
        return FollowedMove(move, situation, zone, moved, new, beyond)

    def _zone_after(
        self,
        before: Situation,
        tasks: tuple[int, ...],
        situation: Situation,
        acts: tuple[int, ...],
        timers: tuple[int, ...],
        possibility: Possibility,
        when: Zone,
    ) -> Zone:
        clocks: list[int | None] = []
        for task, act in zip(acts, situation.running, strict=True):
            clock = None
            if task in tasks:
                at = tasks.index(task)
                if _has_stopped(before.running[at]) == _has_stopped(act):
                    clock = at + 1
            clocks.append(clock)
        first, had = len(before.running), len(before.countdowns)
        clocks += [first + number if number <= had else None for number in timers]
        if not clocks:
            return NO_CLOCKS
        if possibility.clock == 0 and clocks == [*range(1, first + had + 1)]:
            return when  # nothing has begun or ended: it can come at any of these times
        return elapse(carry(when, clocks), self.moves.limits(situation))

    def _facts(self, records: list[AnyRecord]) -> tuple[int, list[Fact]]:
        """Return the rules that moved, and the facts."""
        moved = 0
        facts: list[Fact] = []
        for record in records:
            kind = type(record)
            if kind is RuleRecord:
                moved |= self._add_rule_facts(cast(RuleRecord, record), facts)
            elif kind is TaskRecord:
                task = cast(TaskRecord, record)
                if task.status == "ACTIVE":
                    if task.function == _START_ACT:
                        facts.append(("act", task.behavior))
                elif task.status == "CANCELED" and task.function == _START_ACT and task.reason.startswith(_CUT):
                    facts.append(("cut off", task.behavior, task.reason))
            elif kind is ConditionRecord:
                condition = cast(ConditionRecord, record)
                for key in condition.missing:
                    facts.append(("missing", key, condition.expression, condition.rule))
                if condition.error:
                    facts.append(("error", condition.expression, condition.error, condition.rule))
            elif kind is NoteRecord:
                facts.append(("note", cast(NoteRecord, record).text))
        runner = self.kernel.runner
        if len(runner.runs) > 0:
            for run in runner.runs.values():
                reason = run.cancel_reason
                if reason is not None and reason.startswith(_CUT):
                    facts.append(("cut off", run.task.behavior, reason))
            if len(runner.runs) > 1:
                going = [run.task.behavior for run in runner.runs.values() if run.cancel_reason is None]
                for pair in combinations(sorted(going), 2):
                    if frozenset(pair) in self._share_channel:
                        facts.append(("two at once", *pair))
        return moved, facts

    def _add_rule_facts(self, record: RuleRecord, facts: list[Fact]) -> int:
        """Add the facts of a rule's record; return the rule's bit, and the end's bit if it is reached."""
        rule, status = record.name, record.status
        moved = self._bits[rule]
        if record.transition is not None:
            facts.append(("transition", rule, record.previous, record.transition))
            if record.trigger in self._ends_of_acts:
                self._note_out_of_step(rule, record, self._ends_of_acts[record.trigger], facts)
        if status == "entered":
            facts.append(("state", rule, record.state))
        elif status == "ended":
            facts.append(("ended", rule, record.state))
            if rule == self.end:
                moved |= 1 << END_BIT
        elif status == "faulted":
            facts.append(("faulted", rule, record.reason))
        return moved

    def _note_out_of_step(self, rule: str, record: RuleRecord, act: str, facts: list[Fact]) -> None:
        """Note if a rule has reacted to the end of an act while an earlier request for the same act has not ended."""
        scheduler, last = self.kernel.kernel.scheduler, self.kernel.last_task
        going = [run.task for run in scheduler.runner.runs.values() if run.cancel_reason is None]
        if any(task.behavior == act and task.id <= last for task in (*scheduler.waiting, *going)):
            facts.append(("out of step", rule, record.previous, act))

    def _compare_failure(self, before: Situation, step: FollowedMove, succeeded: dict[int, Situation]) -> FollowedMove:
        """Check whether success and failure of this act have different effects, if a rule has started it."""
        index, how = step.move.place, step.move.how
        act = before.running[index]
        if act.source == PERSON:
            return step
        if how == "succeeded":
            succeeded[index] = step.situation
        elif how == "failed" and index in succeeded:
            alike = step.situation._replace(faults_left=before.faults_left) == succeeded[index]
            fact = ("failure alike" if alike else "failure matters", act.name, act.source)
            if fact not in self._known_facts:
                self._known_facts.add(fact)
                return step._replace(facts=(*step.facts, fact))
        return step


_HARMLESS = frozenset({"raiseEventTopic", "assignValue"})
"""Tasks whose changes other records show."""
_START_ACT = "startCommunicationRobotAct"
_CUT = ("interrupted by ", "stopped by rule:")


def _is_always_later(situation: Situation, zone: Zone, place: int) -> bool:
    """Return whether an equally long timer of an earlier transition, set with this one, always elapses first."""
    own = situation.countdowns[place]
    first = 1 + len(situation.running)
    return any(
        other[:2] == own[:2] == ("after", own.owner)
        and other.transition < own.transition
        and other.length == own.length
        and zone[first + at][first + place] == 0 == zone[first + place][first + at]
        for at, other in enumerate(situation.countdowns[:place])
    )


def asks_again(situation: Situation) -> bool:
    """Return whether a rule requested the last waiting act while its previous act of this name has not ended."""
    last = situation.waiting[-1]
    others = (*situation.waiting[:-1], *(act for act in situation.running if not _has_stopped(act)))
    return last.source != PERSON and any(act.name == last.name and act.source == last.source for act in others)


def _has_stopped(act: ActTask) -> bool:
    """Return whether it has ended except for the robot's confirmation."""
    return act.phase not in ("running", "doomed")
