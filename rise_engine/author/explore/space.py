"""All situations that a scenario can reach, explored breadth first."""

from __future__ import annotations

from array import array
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator
from typing import TypeAlias

from rise_engine.author.explore.moves import Move
from rise_engine.author.explore.situation import Situation
from rise_engine.author.explore.stepper import Fact, FollowedMove, Stepper, asks_again
from rise_engine.author.explore.zones import NO_CLOCKS, Zone, hull, includes, widen, widest
from rise_engine.kernel.inputs import SessionStarted

Number: TypeAlias = int
"""The number of a situation, in the order of discovery."""
GROWTHS = 3
"""How often a situation's times grow before growing bounds become as large as possible."""
MAX_KEPT = 20
"""Maximum number of recorded steps for each act that would have waited once more."""
MAX_GROWTHS = 20
"""How often they grow before they become all possible times."""


class Space:
    """The situations and the steps between them."""

    def __init__(self, stepper: Stepper) -> None:
        self.stepper = stepper
        self.situations: list[Situation] = []
        self.numbers: dict[Situation, Number] = {}
        self.zones: list[Zone] = []
        self.moves: list[Move] = []
        """Every move found so far, by its number."""
        self.edges: list[array[int]] = []
        """For each situation, its steps in a row: move, next situation, rules that moved (`FollowedMove.moved`)."""
        self.beyond: dict[Number, frozenset[str]] = {}
        """The situations with a step that was not followed, and why."""
        self.keys_beyond: dict[Number, frozenset[str]] = {}
        """The keys of steps that were not followed."""
        self.beyond_steps: list[tuple[Number, Move, Situation]] = []
        """Steps that were not followed because the same act would have waited once more; some for each act."""
        self.facts: dict[Fact, tuple[Number, Move, Situation]] = {}
        """The observed facts: the first situation, the move, and the situation after it."""
        self.beginnings: list[Number] = []
        """The situations in which sessions begin."""
        self._begun: dict[Number, SessionStarted] = {}
        self.complete = False
        """Whether all situations within the bounds were explored."""
        self._move_numbers: dict[Move, int] = {}
        self._shared_sets: dict[frozenset[str], frozenset[str]] = {}
        self._kept_steps: Counter[tuple[str, str]] = Counter()
        self._values: list[set[bytes | None]] = [set() for _ in stepper.kernel.keys]
        self._growths: Counter[Number] = Counter()
        self.pending: deque[Number] = deque()
        """The situations that are not explored yet."""
        self._is_pending: set[Number] = set()

    def begin(self) -> None:
        """Add the situations in which sessions begin."""
        for begun, situation in zip(self.stepper.beginnings, self.stepper.begin(), strict=True):
            self._begun.setdefault(self._number(situation, NO_CLOCKS), begun)
        self.beginnings = sorted(self._begun)

    def begun_in(self, beginning: Number) -> SessionStarted:
        """Return a session that begins in this situation."""
        return self._begun[beginning]

    def explore(self, go_on: Callable[[], bool] = lambda: True) -> None:
        """Explore all situations. `go_on` is called before each; if it returns False, the results so far remain."""
        most = self.stepper.bounds.situations
        while self.pending:
            if len(self.situations) > most or not go_on():
                return
            number = self.pending.popleft()
            self._is_pending.discard(number)
            self.take(number, self.stepper.follow(self.situations[number], self.zones[number]))
        self.complete = True

    def take_pending(self, most: int) -> list[tuple[Number, Situation, Zone]]:
        """Take some unexplored situations; the caller explores them."""
        taken: list[tuple[Number, Situation, Zone]] = []
        while self.pending and len(taken) < most:
            number = self.pending.popleft()
            self._is_pending.discard(number)
            taken.append((number, self.situations[number], self.zones[number]))
        return taken

    def put_back(self, numbers: Iterable[Number]) -> None:
        """Return situations that were taken and not explored."""
        for number in numbers:
            self._enqueue(number)

    def take(self, number: Number, steps: Iterable[FollowedMove]) -> None:
        """Add the steps from a situation."""
        edges = array("q")
        seen = set()
        for step in steps:
            for fact in step.facts:
                if fact not in self.facts:
                    self.facts[fact] = (number, step.move, step.situation)
            if step.beyond:
                self._note(self.beyond, number, step.beyond)
                if step.move.kind == "key":
                    self._note(self.keys_beyond, number, step.move.name)
                if step.beyond == "line" and step.situation.waiting and asks_again(step.situation):
                    self._keep_beyond_step(number, step)
                if step.beyond != "chance":
                    continue
            if step.situation not in self.numbers and self._has_too_many_values(step.situation):
                self._note(self.beyond, number, "values")
                continue
            target = self._number(step.situation, step.zone)
            move = self._move_numbers.get(step.move)
            if move is None:
                move = self._move_numbers[step.move] = len(self.moves)
                self.moves.append(step.move)
            edge = (move, target, step.moved)
            if edge not in seen:
                seen.add(edge)
                edges.extend(edge)
        self.edges[number] = edges

    def _note(self, where: dict[Number, frozenset[str]], number: Number, what: str) -> None:
        """Add to a set. Hundreds of thousands of situations share these few sets."""
        before = where.get(number, _NOTHING)
        if what not in before:
            together = before | {what}
            where[number] = self._shared_sets.setdefault(together, together)

    def _keep_beyond_step(self, number: Number, step: FollowedMove) -> None:
        last = step.situation.waiting[-1]
        if self._kept_steps[last.name, last.source] < MAX_KEPT:
            self._kept_steps[last.name, last.source] += 1
            self.beyond_steps.append((number, step.move, step.situation))

    def _has_too_many_values(self, situation: Situation) -> bool:
        """Return whether a memory key has more values than are followed."""
        for known, value in zip(self._values, situation.memory, strict=True):
            if value not in known:
                if len(known) >= self.stepper.bounds.values:
                    return True
                known.add(value)
        return False

    def _number(self, situation: Situation, zone: Zone) -> Number:
        """Return the number of a situation, after adding these times to it."""
        number = self.numbers.get(situation)
        if number is None:
            number = self.numbers[situation] = len(self.situations)
            self.situations.append(situation)
            self.zones.append(zone)
            self.edges.append(_NONE)
            self._enqueue(number)
            return number
        known = self.zones[number]
        if not includes(known, zone):
            self._growths[number] += 1
            if self._growths[number] > MAX_GROWTHS:
                self.zones[number] = widest(self.stepper.moves.limits(situation))
            elif self._growths[number] > GROWTHS:
                self.zones[number] = widen(known, zone, self.stepper.moves.limits(situation))
            else:
                self.zones[number] = hull(known, zone)
            self._enqueue(number)
        return number

    def _enqueue(self, number: Number) -> None:
        if number not in self._is_pending:
            self._is_pending.add(number)
            self.pending.append(number)

    def steps_from(self, number: Number) -> Iterator[tuple[Move, Number, int]]:
        """Yield the steps from a situation."""
        edges = self.edges[number]
        for at in range(0, len(edges), 3):
            yield self.moves[edges[at]], edges[at + 1], edges[at + 2]


_NONE: array[int] = array("q")
_NOTHING: frozenset[str] = frozenset()
