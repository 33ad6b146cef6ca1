"""Orders of the runs of a participant: sets of them in which every run comes equally often at every place.

A set is complete only as a whole; the plan repeats sets, each with its rows in another order and its runs under other
names, so that nobody can guess the next.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import count, permutations

from rise_engine.study.chance import Chance
from rise_engine.study.model import WithinMethod

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
