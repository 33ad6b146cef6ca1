"""The chance of a study's plan: the same numbers from the same seed, on every Python and in every other language.

Python promises that only of `random()` and `seed()`, not of `shuffle`. Here a number is what SHA-256 makes of the seed,
of what it is drawn for and of its place in the row; ten lines in any language repeat it (docs/reference/study.md).
What a plan draws with it: orders of conditions, and the group that evens out strata best.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from hashlib import sha256
from itertools import count, permutations
from typing import TypeVar

from rise_engine.study.design import cells
from rise_engine.study.model import Slot, Study, WithinMethod

_Item = TypeVar("_Item")
_VALUES = 2**64


class Chance:
    """Numbers that depend on nothing but a seed and the names of what they are drawn for.

    Value k (0, 1, 2, ...) is the first 8 bytes, as a big-endian number, of SHA-256 of `seed/name/.../k` in UTF-8.

    >>> Chance(7, "block", 1).shuffle(["yes", "no", "maybe"])
    ['maybe', 'no', 'yes']
    """

    def __init__(self, seed: int, *names: object) -> None:
        """
        :param seed: the study's, or that of a row of its plan.
        :param names: what is drawn, in words and numbers; other names, other numbers.
        """
        self._prefix = "/".join(map(str, (seed, *names)))
        self._drawn = 0

    def _next(self) -> int:
        text = f"{self._prefix}/{self._drawn}"
        self._drawn += 1
        return int.from_bytes(sha256(text.encode()).digest()[:8], "big")

    def integer_below(self, count: int) -> int:
        """A whole number from 0 to `count` - 1, each as likely as the others; `count` is from 1 to 2**64.

        Values of the incomplete last `count` numbers below 2**64 are drawn again: they would make small ones likelier.
        """
        limit = _VALUES - _VALUES % count
        while (value := self._next()) >= limit:
            pass
        return value % count

    def choose(self, items: Sequence[_Item]) -> _Item:
        """One of them; there is at least one."""
        return items[self.integer_below(len(items))]

    def shuffle(self, items: Sequence[_Item]) -> list[_Item]:
        """The same items in another order, every order as likely: Fisher and Yates, from the end."""
        mixed = list(items)
        for at in range(len(mixed) - 1, 0, -1):
            other = self.integer_below(at + 1)
            mixed[at], mixed[other] = mixed[other], mixed[at]
        return mixed


SEEDS = 2**31
"""A session's seed and that of a row are below this, as every seed that the program draws itself."""


def session_seed(seed: int, slot: int, run: int) -> int:
    """The seed of one session of a study.

    :param seed: the study's.
    :param slot: the row of the plan; 0 for a session that has none.
    :param run: which session of the participant, from 1.
    """
    return Chance(seed, "session", slot, run).integer_below(SEEDS)


# --- orders -----------------------------------------------------------------------------------------------------------

Order = tuple[int, ...]
"""Which run comes first, second, ...: each of 0 to n - 1 once."""


def williams(number: int) -> list[Order]:
    """Williams' design (1949): every run comes once at every place, and follows every other one equally often.

    With an even number of runs these are as many orders as runs, otherwise twice as many.

    >>> williams(4)
    [(0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1)]
    """
    first = [0, *((step + 1) // 2 if step % 2 else number - step // 2 for step in range(1, number))]
    rows = [tuple((run + row) % number for run in first) for row in range(number)]
    return rows if number % 2 == 0 or number == 1 else rows + [row[::-1] for row in rows]


def latin(number: int) -> list[Order]:
    """A cyclic Latin square: every run comes once at every place, but always behind the same other one.

    >>> latin(3)
    [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
    """
    return [tuple((run + row) % number for run in range(number)) for row in range(number)]


def order_set(method: WithinMethod, number: int) -> list[Order]:
    """One complete set of orders; of `random`, which has no sets, every order.

    :param method: how they are made (`within` in study.toml).
    :param number: how many runs each participant has.
    """
    if method == "williams":
        return williams(number)
    if method == "latin":
        return latin(number)
    if method == "fixed":
        return [tuple(range(number))]
    return list(permutations(range(number)))


def make_orders(method: WithinMethod, runs: Sequence[str], seed: int, *names: object) -> Iterator[tuple[str, ...]]:
    """Orders of these runs without end, whole set after whole set.

    :param method: as of `order_set`; not `random`, whose rows are drawn each for itself.
    :param runs: what is put in order.
    :param seed: the study's.
    :param names: of whom these orders are: the stratum and the cell.
    """
    rows = order_set(method, len(runs))
    for number in count():
        named = list(runs) if method == "fixed" else Chance(seed, "names", *names, number).shuffle(runs)
        for row in Chance(seed, "orders", *names, number).shuffle(rows):
            yield tuple(named[run] for run in row)


# --- minimisation -----------------------------------------------------------------------------------------------------

BEST_OUT_OF = (4, 5)
"""How often the cell that balances best is taken. Always would mean that whoever knows the others can foretell it."""


def cell_for(
    study: Study,
    taken_so_far: Sequence[tuple[Mapping[str, str], Mapping[str, str]]],
    strata: Mapping[str, str],
    slot: Slot,
) -> dict[str, str]:
    """The levels of the between factors for somebody who takes a slot now.

    For each cell it is asked how unequal the cells would be if this participant came into it: over all who have their
    values, column by column, and over everybody; unequal means the largest count less the smallest. Of the cells where
    the sum is smallest one is drawn, four times out of five; otherwise one of the rest. The same arguments give the
    same cell.

    :param study: the study, whose method is `minimise`.
    :param taken_so_far: strata and levels of everybody who holds a slot and counts, in any order.
    :param strata: those of the participant.
    :param slot: the row that they take; its seed is where the chance comes from.
    """
    every = cells(study)
    groups: list[tuple[str, str] | None] = [None, *((column, strata[column]) for column in study.assignment.strata)]
    totals = [0] * len(every)
    for group in groups:
        counts = Counter(
            tuple(levels.values())
            for others, levels in taken_so_far
            if group is None or others.get(group[0]) == group[1]
        )
        before = [counts[tuple(cell.values())] for cell in every]
        for at in range(len(every)):
            after = [number + (index == at) for index, number in enumerate(before)]
            totals[at] += max(after) - min(after)
    least = min(totals)
    best = [cell for cell, total in zip(every, totals, strict=True) if total == least]
    rest = [cell for cell, total in zip(every, totals, strict=True) if total != least]
    chance = Chance(slot.seed, "minimise")
    takes_best = chance.integer_below(BEST_OUT_OF[1]) < BEST_OUT_OF[0]
    return dict(chance.choose(best if takes_best or not rest else rest))
