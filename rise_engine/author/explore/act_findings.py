"""Findings about acts: two at once, one cut off, a growing queue, the end of one act mistaken for another's."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import msgspec

from rise_engine.author.explore.moves import Move
from rise_engine.author.explore.situation import Situation
from rise_engine.author.explore.situation_graph import Explored, ExploreFinding, is_planned
from rise_engine.author.explore.space import Number
from rise_engine.author.explore.stepper import Fact
from rise_engine.expression import Environment, EvaluationError, Expression
from rise_engine.scenario.explore_settings import StudyProperty

# --- properties -------------------------------------------------------------------------------------------------------


class SituationView:
    """A situation for conditions that use `in`, `rule`, `runs` and `waits`."""

    def __init__(self, situation: Situation) -> None:
        self._situation = situation

    def in_state(self, rule: str, state: str) -> bool:
        return any(each.name == rule and each.state == state for each in self._situation.rules)

    def rule_runs(self, rule: str) -> bool:
        return any(each.name == rule for each in self._situation.rules)

    def act_runs(self, act: str) -> bool:
        return any(each.name == act for each in self._situation.running)

    def act_waits(self, act: str) -> bool:
        return any(each.name == act for each in self._situation.waiting)


class PropertyChecker:
    """Checks a scenario's properties in all explored situations."""

    def __init__(self, explored: Explored) -> None:
        self._explored = explored
        self._decoded: dict[bytes, Any] = {}
        self._errors: dict[str, str] = {}

    def findings(self) -> Iterator[ExploreFinding]:
        """Yield the properties that do not hold, and the conditions that cannot be evaluated."""
        for each in self._explored.scenario.properties:
            broken = self._broken(each)
            if broken:
                yield self._finding(each, broken)
        for text, problem in self._errors.items():
            yield ExploreFinding(
                kind="property-error",
                level="warning",
                text=f"`{text}` has no value in some situations: {problem}; it counts as false there",
            )

    def sentences(self) -> Iterator[str]:
        """Yield a sentence for each property that holds."""
        within = ", as far as the study was explored" if self._explored.has_bounds else ""
        for each in self._explored.scenario.properties:
            if not self._broken(each):
                yield f'"{each.name}" ([{each.kind}]) holds in all of them{within}.'

    def _broken(self, wanted: StudyProperty) -> list[Number]:
        """Return the situations that violate the property."""
        explored = self._explored
        holds = self._where(wanted.condition)
        everything = range(len(explored.situations))
        if wanted.kind == "always":
            return [number for number in everything if number not in holds]
        if wanted.kind == "reachable":
            able = explored.reaching(holds | explored.unknown, is_planned)
            return [number for number in everything if number not in able]
        asked = self._where(wanted.after) if wanted.after is not None else set(everything)
        released = holds | (self._where(wanted.unless) if wanted.unless is not None else set())
        able = explored.reaching(released | explored.unknown, _is_spontaneous)
        missed = explored.reaching(set(everything) - able, _is_spontaneous, avoiding=released)
        return sorted(asked & missed)

    def _finding(self, wanted: StudyProperty, broken: list[Number]) -> ExploreFinding:
        explored = self._explored
        number = explored.paths.nearest(broken)
        share = f"in {len(broken):,} of {len(explored.situations):,} situations"
        text = {
            "always": f"`{wanted.condition.text}` does not hold {share}",
            "reachable": f"`{wanted.condition.text}` cannot be reached any more {share}",
            "eventually": f"`{wanted.condition.text}` does not always become true by itself {share}",
        }[wanted.kind]
        if wanted.after is not None:
            text += f" in which `{wanted.after.text}`"
        return ExploreFinding(
            kind=wanted.kind,
            level="problem",
            text=f'"{wanted.name}": {text}',
            location=wanted.location,
            path=explored.paths.to(number) if number is not None else None,
        )

    def _where(self, condition: Expression) -> set[Number]:
        """Return the situations in which a condition holds."""
        explored = self._explored
        keys = explored.space.stepper.kernel.keys
        memory: dict[str, Any] = {**explored.scenario.memory, **explored.scenario.table_memory}
        environment = Environment(memory, lambda: 0.0, set(), lambda count: 0)
        holds = condition.compiled_condition
        found = set()
        for number, situation in enumerate(explored.situations):
            for key, value in zip(keys, situation.memory, strict=True):
                if value is None:
                    memory.pop(key, None)
                else:
                    memory[key] = self._decode(value)
            environment.situation = SituationView(situation)
            try:
                if holds(environment):
                    found.add(number)
            except EvaluationError as problem:
                self._errors.setdefault(condition.text, str(problem))
        return found

    def _decode(self, value: bytes) -> Any:
        if value not in self._decoded:
            self._decoded[value] = msgspec.json.decode(value)
        return self._decoded[value]


def _is_spontaneous(move: Move) -> bool:
    return move.is_spontaneous


_MAX_TRIES = 5
"""Maximum number of cases that are tested for repetition."""


def find_two_at_once(explored: Explored) -> Iterator[ExploreFinding]:
    """Find acts that use the same part of the robot at the same time."""
    acts = explored.scenario.acts
    for fact in explored.facts("two at once"):
        _, one, other = fact
        shared = ", ".join(sorted(acts[one].channels & acts[other].channels))
        who = f"{one} can run twice at once" if one == other else f"{one} and {other} can run at once"
        yield ExploreFinding(
            kind="two-at-once",
            level="warning",
            text=f"{who}, and both use {shared}: neither waits for the other, because both run beside other acts",
            location=acts[one].location,
            act=one,
            path=explored.paths.to_fact(fact),
        )


def find_cut_off(explored: Explored) -> Iterator[ExploreFinding]:
    """Find the acts that can be cut off, with the causes."""
    by: dict[str, dict[str, None]] = {}
    first: dict[str, Fact] = {}
    for fact in explored.facts("cut off"):
        _, act, reason = fact
        what = reason.removeprefix("interrupted by ").removeprefix("stopped by rule:")
        by.setdefault(act, {})[what if reason.startswith("interrupted") else f"the rule {what}"] = None
        first.setdefault(act, fact)
    for act, causes in by.items():
        yield ExploreFinding(
            kind="cut-off",
            level="remark",
            text=f"{act} can be cut off by {', '.join(causes)}",
            location=explored.scenario.acts[act].location,
            act=act,
            path=explored.paths.to_fact(first[act]),
        )


def find_growing_lines(explored: Explored) -> Iterator[ExploreFinding]:
    """Find acts that a rule queues again while the same act still waits or runs."""
    cases: dict[tuple[str, str], list[tuple[Number, Situation]]] = {}
    for number, _, situation in explored.space.beyond_steps:
        last = situation.waiting[-1]
        cases.setdefault((last.name, last.source.removeprefix("rule:")), []).append((number, situation))
    for (act, rule), found in cases.items():
        endless = any(_can_grow_again(explored, number, situation) for number, situation in found[:_MAX_TRIES])
        times = "any number of times" if endless else "twice"
        fact = ("in line", act, f"rule:{rule}")
        yield ExploreFinding(
            kind="line-grows",
            level="warning",
            text=f"{act} can wait in the queue {times}: {rule} asks for it again before the last one has run, "
            "and later acts have to wait for all of them",
            location=explored.scenario.acts[act].location,
            act=act,
            rule=rule,
            path=explored.paths.to_fact(fact),
        )


def _can_grow_again(explored: Explored, number: Number, longer: Situation) -> bool:
    """Return whether the queue can grow again: the situation without the added act can lead to the same addition.

    The behaviour of rules does not depend on the queue.
    """
    shorter = longer._replace(waiting=longer.waiting[:-1])
    last = len(longer.waiting) - 1
    shorter = shorter._replace(
        rules=tuple(
            rule._replace(
                own_acts=tuple(
                    (name, at if at < last else last - 1 if at == last else at - 1) for name, at in rule.own_acts
                )
            )
            for rule in shorter.rules
        )
    )
    known = explored.space.numbers.get(shorter)
    return known is not None and number in explored.reachable_from(known)


def find_out_of_step(explored: Explored) -> Iterator[ExploreFinding]:
    """Find rules that mistake the end of one act for the end of another with the same name."""
    for fact in explored.facts("out of step"):
        _, rule, state, act = fact
        yield ExploreFinding(
            kind="out-of-step",
            level="warning",
            text=f"{rule} goes on from {state} at the end of {act} while another {act} is still waiting: the "
            "first end counts for both (`ended` waits for its own act)",
            location=explored.scenario.rules[rule].states[state].location,
            rule=rule,
            state=state,
            act=act,
            path=explored.paths.to_fact(fact),
        )


def find_failures_alike(explored: Explored) -> Iterator[ExploreFinding]:
    """Find acts of rules whose failure makes no difference."""
    matters = {(fact[1], fact[2]) for fact in explored.facts("failure matters")}
    for fact in explored.facts("failure alike"):
        _, act, source = fact
        if (act, source) not in matters:
            rule = source.removeprefix("rule:")
            yield ExploreFinding(
                kind="failure-alike",
                level="warning",
                text=f"to {rule} it makes no difference whether {act} was done or failed",
                location=explored.scenario.acts[act].location,
                act=act,
                rule=rule,
                path=explored.paths.to_fact(fact),
            )
