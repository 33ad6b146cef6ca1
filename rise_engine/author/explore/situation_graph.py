"""The graph of explored situations, prepared for queries: successors, predecessors and shortest paths."""

from __future__ import annotations

from array import array
from collections import deque
from collections.abc import Callable, Container, Iterable, Iterator
from functools import cached_property
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.author.explore.moves import Move
from rise_engine.author.explore.situation import Situation
from rise_engine.author.explore.space import Number, Space
from rise_engine.author.explore.stepper import END_BIT, Fact
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.scenario.model import Scenario, SourceLocation


class PathStep(Struct, frozen=True):
    """One move of a path, and the situation after it."""

    move: Move
    situation: Situation


class Path(Struct, frozen=True):
    """A way for a session to reach a situation."""

    begun: SessionStarted
    """The session with which it begins, whose condition determines the memory."""
    beginning: Situation
    steps: tuple[PathStep, ...]

    @property
    def end(self) -> Situation:
        """The situation that it leads to."""
        return self.steps[-1].situation if self.steps else self.beginning


class Paths:
    """The shortest paths with the fewest mishaps to all situations."""

    def __init__(self, space: Space) -> None:
        self._space = space
        self._came_from: dict[Number, tuple[Number, int]] = {}
        """For each situation, its predecessor and the number of the move between them."""
        self.mishaps: dict[Number, int] = dict.fromkeys(space.beginnings, 0)
        """The minimum number of mishaps on the way to each situation."""
        wrongs = [move.is_mishap for move in space.moves]
        levels = [deque(space.beginnings)]
        for level, pending in enumerate(levels):  # situations with this number of mishaps, the nearest first
            while pending:
                number = pending.popleft()
                if self.mishaps[number] < level:
                    continue
                edges = space.edges[number]
                for at in range(0, len(edges), 3):
                    wrong, target = level + wrongs[edges[at]], edges[at + 1]
                    if wrong < self.mishaps.get(target, wrong + 1):
                        self.mishaps[target] = wrong
                        self._came_from[target] = (number, edges[at])
                        if wrong == len(levels):
                            levels.append(deque())
                        levels[wrong].append(target)

    def to(self, number: Number, then: tuple[Move, Situation] | None = None) -> Path:
        """Return the path to a situation, optionally with one more step."""
        space = self._space
        steps: list[PathStep] = []
        at = number
        while at in self._came_from:
            before, move = self._came_from[at]
            steps.append(PathStep(space.moves[move], space.situations[at]))
            at = before
        steps.reverse()
        if then is not None:
            steps.append(PathStep(*then))
        return Path(space.begun_in(at), space.situations[at], tuple(steps))

    def to_fact(self, fact: Fact) -> Path | None:
        """Return the path to a fact's first observation, with its move; None: it was not observed."""
        found = self._space.facts.get(fact)
        if found is None:
            return None
        number, move, situation = found
        return self.to(number, (move, situation))

    def nearest(self, numbers: Iterable[Number]) -> Number | None:
        """Return the situation among these with the fewest mishaps on its path; None: there is none."""
        best = min(numbers, key=lambda number: (self.mishaps.get(number, 1 << 30), number), default=None)
        return best if best is not None and best in self.mishaps else None


# --- findings ---------------------------------------------------------------------------------------------------------

FindingLevel: TypeAlias = Literal["problem", "warning", "remark"]
"""problem: a session can go wrong; warning: check it; remark: good to know."""


_NAMED = 4
"""Maximum number of states in a sentence."""


class ExploreFinding(Struct, frozen=True, kw_only=True):
    """A finding of exploring."""

    kind: str
    """A word for programs: `dead-end`, `no-end`, `never-taken`, ... (docs/reference/explore.md)."""
    level: FindingLevel
    text: str
    location: SourceLocation | None = None
    """Its place in the study's files."""
    rule: str = ""
    state: str = ""
    act: str = ""
    key: str = ""
    path: Path | None = None
    """The shortest path to it; None: no single path shows it."""


def some_states(states: Iterable[str]) -> str:
    """Return the first few of these states, and the number of the others."""
    names = list(states)
    more = len(names) - _NAMED
    return " or ".join(names) if more <= 0 else f"{', '.join(names[:_NAMED])} or {more} other states"


class Explored:
    """An explored space with shared results of queries."""

    def __init__(self, space: Space) -> None:
        self.space = space
        self.scenario: Scenario = space.stepper.scenario
        self.end = space.stepper.end
        """The rule that ends the study."""
        self.situations: list[Situation] = space.situations
        self.bits = {name: 1 << number for number, name in enumerate(self.scenario.rules, 1)}
        """For each rule, its bit in `FollowedMove.moved`."""

        self._stuck: dict[str, list[Number]] = {}

    @cached_property
    def paths(self) -> Paths:
        return Paths(self.space)

    @cached_property
    def unknown(self) -> set[Number]:
        """The situations with unexplored successors, except for more kept events, which could also come later."""
        return {number for number, why in self.space.beyond.items() if why - {"kept"}} | set(self.space.pending)

    @cached_property
    def ends(self) -> set[Number]:
        """The situations from which one move ends the study."""
        return self.with_moved(1 << END_BIT)

    @property
    def has_bounds(self) -> bool:
        """Whether the bounds left something unexplored."""
        return bool(self.unknown)

    def stuck_situations(self, rule: str) -> list[Number]:
        """Return the situations in which the rule runs and no planned move can still change it."""
        if rule not in self._stuck:
            running = [number for number in range(len(self.situations)) if self.state_of(rule, number) is not None]
            able = self.with_moved(self.bits[rule])
            if not able.issuperset(running):
                able = self.reaching(able | self.unknown, is_planned)
            self._stuck[rule] = [number for number in running if number not in able]
        return self._stuck[rule]

    def state_of(self, rule: str, number: Number) -> str | None:
        """Return the state of a rule in a situation; None: it does not run."""
        for state in self.situations[number].rules:
            if state.name == rule:
                return state.state
        return None

    def facts(self, kind: str) -> Iterator[Fact]:
        """Return the facts of this kind, the earliest first."""
        return (fact for fact in self.space.facts if fact[0] == kind)

    def with_moved(self, bits: int, *, mishaps: bool = False) -> set[Number]:
        """Return the situations with a move that lets one of these rules move; `mishaps`: including mishaps."""
        moves = self.space.moves
        found = set()
        for number, edges in enumerate(self.space.edges):
            for at in range(0, len(edges), 3):
                if edges[at + 2] & bits and (mishaps or not moves[edges[at]].is_mishap):
                    found.add(number)
                    break
        return found

    def reaching(
        self, goals: Iterable[Number], allowed: Callable[[Move], bool], avoiding: Container[Number] = ()
    ) -> set[Number]:
        """Return the situations that can reach a goal by allowed moves, including the goals, without those to avoid."""
        allows = [allowed(move) for move in self.space.moves]
        found = set(goals)
        pending = list(found)
        before = self._before
        while pending:
            came = before[pending.pop()]
            for at in range(0, len(came), 2):
                number = came[at + 1]
                if number not in found and allows[came[at]] and number not in avoiding:
                    found.add(number)
                    pending.append(number)
        return found

    def reachable_from(self, number: Number) -> set[Number]:
        """Return the situations that can follow one, including itself."""
        if number not in self._after:
            found = {number}
            pending = [number]
            while pending:
                edges = self.space.edges[pending.pop()]
                for at in range(0, len(edges), 3):
                    if edges[at + 1] not in found:
                        found.add(edges[at + 1])
                        pending.append(edges[at + 1])
            self._after[number] = found
        return self._after[number]

    @cached_property
    def _after(self) -> dict[Number, set[Number]]:
        return {}

    @cached_property
    def _before(self) -> list[array[int]]:
        """For each situation, the moves and situations that lead to it, alternating."""
        before = [array("q") for _ in self.situations]
        for number, edges in enumerate(self.space.edges):
            for at in range(0, len(edges), 3):
                if edges[at + 1] != number:
                    before[edges[at + 1]].extend((edges[at], number))
        return before


def is_planned(move: Move) -> bool:
    """Return whether a move is not a mishap."""
    return not move.is_mishap
