"""What the author says must hold: `[always]`, `[reachable]` and `[eventually]` in scenario.toml."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import msgspec

from rise_engine.author.explore.explored import Explored, is_planned
from rise_engine.author.explore.finding import ExploreFinding
from rise_engine.author.explore.moves import Move
from rise_engine.author.explore.situation import Situation
from rise_engine.author.explore.space import Number
from rise_engine.expression import Environment, EvaluationError, Expression
from rise_engine.scenario.explore_settings import StudyProperty


class SituationView:
    """A situation, as conditions ask about it with `in`, `rule`, `runs` and `waits`."""

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
    """Asks the properties of a scenario of all situations that were found."""

    def __init__(self, explored: Explored) -> None:
        self._explored = explored
        self._decoded: dict[bytes, Any] = {}
        self._errors: dict[str, str] = {}

    def findings(self) -> Iterator[ExploreFinding]:
        """Those that do not hold, and those that cannot be worked out."""
        for each in self._explored.scenario.properties:
            broken = self._broken(each)
            if broken:
                yield self._finding(each, broken)
        for text, problem in self._errors.items():
            yield ExploreFinding(
                kind="property-error",
                level="warning",
                text=f"`{text}` cannot be worked out everywhere: {problem}; there it counts as false",
            )

    def told(self) -> Iterator[str]:
        """A sentence for each that holds."""
        within = ", as far as was looked" if self._explored.has_bounds else ""
        for each in self._explored.scenario.properties:
            if not self._broken(each):
                yield f'"{each.name}" ([{each.kind}]) holds in all of them{within}.'

    def _broken(self, wanted: StudyProperty) -> list[Number]:
        """The situations that show that it does not hold."""
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
            "eventually": f"`{wanted.condition.text}` need not come by itself {share}",
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
        """The situations in which a condition holds."""
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
