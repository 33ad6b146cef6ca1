"""The chance of a study's plan: the same numbers from the same seed, on every Python and in every other language.

Python promises that only of `random()` and `seed()`, not of `shuffle`. Here a number is what SHA-256 makes of the seed,
of what it is drawn for and of its place in the row; ten lines in any language repeat it (docs/reference/study.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from hashlib import sha256
from typing import TypeVar

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
