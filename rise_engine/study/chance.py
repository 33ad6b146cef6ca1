"""Random numbers for a study's plan: the same seed gives the same numbers on every Python and in every language.

Python promises this only for `random()` and `seed()`, not for `shuffle`. Here a number is made by SHA-256 from the
seed, the purpose and the position; ten lines in any language repeat it (docs/reference/study.md).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from hashlib import sha256
from itertools import count, permutations
from typing import TypeVar

from rise_engine.study.model import WithinMethod

_Item = TypeVar("_Item")
_VALUES = 2**64


class Chance:
    """A sequence of numbers that depend only on a seed and on names for their purpose.

    Value k (0, 1, 2, ...) is the first 8 bytes, as a big-endian number, of SHA-256 of `seed/name/.../k` in UTF-8.

    >>> Chance(7, "block", 1).shuffle(["yes", "no", "maybe"])
    ['maybe', 'no', 'yes']
    """

    def __init__(self, seed: int, *names: object) -> None:
        """
        :param seed: the study's seed, or that of a row of its plan.
        :param names: words and numbers for the purpose; other names give other numbers.
        """
        self._prefix = "/".join(map(str, (seed, *names)))
        self._drawn = 0

    def _next(self) -> int:
        text = f"{self._prefix}/{self._drawn}"
        self._drawn += 1
        return int.from_bytes(sha256(text.encode()).digest()[:8], "big")

    def integer_below(self, count: int) -> int:
        """Draw a whole number from 0 to `count` - 1, all equally likely; `count` is from 1 to 2**64.

        Values in the incomplete last `count` numbers below 2**64 are drawn again: they would favour small results.
        """
        limit = _VALUES - _VALUES % count
        while (value := self._next()) >= limit:
            pass
        return value % count

    def choose(self, items: Sequence[_Item]) -> _Item:
        """Draw one of the items. There must be at least one."""
        return items[self.integer_below(len(items))]

    def shuffle(self, items: Sequence[_Item]) -> list[_Item]:
        """Return the items in random order, every order equally likely (Fisher and Yates, from the end)."""
        mixed = list(items)
        for at in range(len(mixed) - 1, 0, -1):
            other = self.integer_below(at + 1)
            mixed[at], mixed[other] = mixed[other], mixed[at]
        return mixed


SEEDS = 2**31
"""The limit of seeds of sessions and rows. All seeds that the program draws are below it."""


def session_seed(seed: int, slot: int, run: int) -> int:
    """Return the seed of one session of a study.

    :param seed: the study's seed.
    :param slot: the row of the plan; 0 for a session without a row.
    :param run: the number of the participant's session, from 1.
    """
    return Chance(seed, "session", slot, run).integer_below(SEEDS)


# --- orders -----------------------------------------------------------------------------------------------------------

Order = tuple[int, ...]
"""Which run comes first, second, and so on: each of 0 to n - 1 once."""


def williams(number: int) -> list[Order]:
    """Make Williams' design (1949): every run comes once at every place, and follows every other run equally often.

    An even number of runs needs as many orders as runs, an odd number twice as many.

    >>> williams(4)
    [(0, 1, 3, 2), (1, 2, 0, 3), (2, 3, 1, 0), (3, 0, 2, 1)]
    """
    first = [0, *((step + 1) // 2 if step % 2 else number - step // 2 for step in range(1, number))]
    rows = [tuple((run + row) % number for run in first) for row in range(number)]
    return rows if number % 2 == 0 or number == 1 else rows + [row[::-1] for row in rows]


def latin(number: int) -> list[Order]:
    """Make a cyclic Latin square: every run comes once at every place, but always after the same other run.

    >>> latin(3)
    [(0, 1, 2), (1, 2, 0), (2, 0, 1)]
    """
    return [tuple((run + row) % number for run in range(number)) for row in range(number)]


def order_set(method: WithinMethod, number: int) -> list[Order]:
    """Make one complete set of orders. For `random`, which has no sets, all orders.

    :param method: `within` in study.toml.
    :param number: the number of runs of each participant.
    """
    if method == "williams":
        return williams(number)
    if method == "latin":
        return latin(number)
    if method == "fixed":
        return [tuple(range(number))]
    return list(permutations(range(number)))


def make_orders(method: WithinMethod, runs: Sequence[str], seed: int, *names: object) -> Iterator[tuple[str, ...]]:
    """Give orders of these runs without end, one whole set after another.

    :param method: as for `order_set`, but not `random`, which draws each row separately.
    :param runs: the names of the runs.
    :param seed: the study's seed.
    :param names: the stratum and the cell that get these orders.
    """
    rows = order_set(method, len(runs))
    for number in count():
        named = list(runs) if method == "fixed" else Chance(seed, "names", *names, number).shuffle(runs)
        for row in Chance(seed, "orders", *names, number).shuffle(rows):
            yield tuple(named[run] for run in row)
