"""A filter over a list of 100,000 tasks, a slice at a time, so that no key waits for it (console.md 9.2). Pure."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable, Sequence
from time import perf_counter

from rise_tui.model.filtering import Filter

SLICE = 0.004
"""Seconds of one turn."""
FEW = 32
"""Rows between two looks at the clock."""


class Sieve:
    """The ids that match: what is new first, then backwards from the newest.

    `ids` is the caller's list, ascending; it only grows at its end. `text_of` gives None for what is no longer known.
    """

    def __init__(
        self,
        filter: Filter,
        ids: Sequence[int],
        text_of: Callable[[int], str | None],
        lives: Callable[[int], bool],
    ) -> None:
        """`lives`: whether a task can still change, so that it must be looked at again."""
        self.filter = filter
        self.matching: list[int] = []
        """Grows at its end in place; for any other change it becomes another list."""
        self._ids, self._text_of, self._lives = ids, text_of, lives
        self._from = self._to = len(ids)
        """What lies between has been looked at."""
        self._living: list[int] = []

    @property
    def done(self) -> bool:
        return self._from == 0 and self._to == len(self._ids)

    def work(self, seconds: float = SLICE) -> bool:
        """Look at some more; True when there is nothing left. Raises BrokenFilter."""
        end = perf_counter() + seconds
        self._look_again()
        while self._to < len(self._ids):
            upto = min(self._to + FEW, len(self._ids))
            self.matching += self._pick(self._to, upto)
            self._to = upto
            if perf_counter() > end:
                return self.done
        earlier: list[list[int]] = []
        while self._from > 0:
            start = max(0, self._from - FEW)
            earlier.append(self._pick(start, self._from))
            self._from = start
            if perf_counter() > end:
                break
        found = [one for part in reversed(earlier) for one in part]
        if found:
            self.matching = found + self.matching
        return self.done

    def look_again_at(self, id: int) -> None:
        """This task has changed, although it had ended."""
        place = bisect_left(self._ids, id)
        if self._from <= place < self._to and id not in self._living:
            self._living.append(id)

    def _pick(self, start: int, end: int) -> list[int]:
        picked = []
        for index in range(start, end):
            one = self._ids[index]
            if self._matches(one):
                picked.append(one)
            if self._lives(one):
                self._living.append(one)
        return picked

    def _matches(self, id: int) -> bool:
        text = self._text_of(id)
        return text is not None and self.filter.matches(text)

    def _look_again(self) -> None:
        """What had not ended when it was looked at, may match by now, or no longer."""
        for one in self._living:
            place = bisect_left(self.matching, one)
            there = place < len(self.matching) and self.matching[place] == one
            if self._matches(one) != there:
                self.matching = list(self.matching)
                if there:
                    del self.matching[place]
                else:
                    insort(self.matching, one)
        self._living = [one for one in self._living if self._lives(one)]
