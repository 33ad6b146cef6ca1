"""The graph of explored situations, prepared for queries: which situations lead where, forwards and backwards."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Container, Iterable, Iterator
from functools import cached_property
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.author.explore.moves import Move
from rise_engine.author.explore.paths import Path, Paths
from rise_engine.author.explore.situation import Situation
from rise_engine.author.explore.space import Number, Space
from rise_engine.author.explore.stepper import END_BIT, Fact
from rise_engine.scenario.model import Scenario, SourceLocation

# --- findings ---------------------------------------------------------------------------------------------------------

FindingLevel: TypeAlias = Literal["problem", "warning", "remark"]
"""problem: a session can go wrong; warning: look at it; remark: good to know."""


_NAMED = 4
"""Maximum number of states that a sentence names."""


class ExploreFinding(Struct, frozen=True, kw_only=True):
    """A finding of exploring."""

    kind: str
    """A word for programs: `dead-end`, `no-end`, `never-taken`, ... (docs/reference/explore.md)."""
    level: FindingLevel
    text: str
    location: SourceLocation | None = None
    """The place in the study's files that it is about."""
    rule: str = ""
    state: str = ""
    act: str = ""
    key: str = ""
    path: Path | None = None
    """How a session gets there, the shortest path; None: no single path shows it."""


def some_states(states: Iterable[str]) -> str:
    """Name the first few of these states, and how many more there are."""
    names = list(states)
    more = len(names) - _NAMED
    return " or ".join(names) if more <= 0 else f"{', '.join(names[:_NAMED])} or {more} other states"


class Explored:
    """An explored space, with what its queries share."""

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
        """The situations with unexplored successors, apart from more kept events: those could come later as well."""
        return {number for number, why in self.space.beyond.items() if why - {"kept"}} | set(self.space.pending)

    @cached_property
    def ends(self) -> set[Number]:
        """The situations from which one move ends the study."""
        return self.with_moved(1 << END_BIT)

    @property
    def has_bounds(self) -> bool:
        """Whether the bounds left something unexplored."""
        return bool(self.unknown)

    def stuck(self, rule: str) -> list[Number]:
        """Return the situations in which a rule runs that nothing planned can move any more."""
        if rule not in self._stuck:
            running = [number for number in range(len(self.situations)) if self.state_of(rule, number) is not None]
            able = self.with_moved(self.bits[rule])
            if not able.issuperset(running):
                able = self.reaching(able | self.unknown, is_planned)
            self._stuck[rule] = [number for number in running if number not in able]
        return self._stuck[rule]

    def state_of(self, rule: str, number: Number) -> str | None:
        """Return the state of a rule in a situation; None: it does not run."""
        for standing in self.situations[number].rules:
            if standing.name == rule:
                return standing.state
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
