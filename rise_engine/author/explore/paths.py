"""Shortest paths through the situations."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from msgspec import Struct

from rise_engine.author.explore.moves import Move
from rise_engine.author.explore.situation import Situation
from rise_engine.author.explore.space import Number, Space
from rise_engine.author.explore.stepper import Fact
from rise_engine.kernel.inputs import SessionStarted


class PathStep(Struct, frozen=True):
    """One move of a path, and the situation after it."""

    move: Move
    situation: Situation


class Path(Struct, frozen=True):
    """A way for a session to reach a situation."""

    begun: SessionStarted
    """The session that it begins with, whose condition decides the memory."""
    beginning: Situation
    steps: tuple[PathStep, ...]

    @property
    def end(self) -> Situation:
        """The situation that it leads to."""
        return self.steps[-1].situation if self.steps else self.beginning


class Paths:
    """The shortest path to each situation with the fewest mishaps."""

    def __init__(self, space: Space) -> None:
        self._space = space
        self._came_from: dict[Number, tuple[Number, int]] = {}
        """For each situation, the one before it and the number of the move between them."""
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
        """Return the path to a fact's first observation, with the move that showed it; None: it was not observed."""
        found = self._space.facts.get(fact)
        if found is None:
            return None
        number, move, situation = found
        return self.to(number, (move, situation))

    def nearest(self, numbers: Iterable[Number]) -> Number | None:
        """Return the situation among these with the fewest mishaps on its path; None: there is none."""
        best = min(numbers, key=lambda number: (self.mishaps.get(number, 1 << 30), number), default=None)
        return best if best is not None and best in self.mishaps else None
