"""A filter over a log of 100,000 rows, a few at a time, so that no key waits for it (console.md 9.2). Pure."""

from __future__ import annotations

from bisect import bisect_left, insort
from collections.abc import Callable, Sequence

from rise_tui.model.filtering import Filter

ROWS_OF_STEP = 32


class RowSearch:
    """The ids that match: what is new first, then backwards from the newest.

    `ids` is the caller's list, ascending; it only grows at its end. `text_of` gives None for what is no longer known.
    """

    def __init__(
        self,
        filter: Filter,
        ids: Sequence[int],
        text_of: Callable[[int], str | None],
        is_live: Callable[[int], bool],
    ) -> None:
        """`is_live`: whether a task can still change, so that it must be looked at again."""
        self.filter = filter
        self.ids, self._text_of, self._is_live = ids, text_of, is_live
        self._from = self._to = len(ids)
        """What lies between has been looked at."""
        self._matching: list[int] = []
        self._earlier: list[list[int]] = []
        """What was found before all of these, the latest rows first."""
        self._live: list[int] = []

    @property
    def matching(self) -> list[int]:
        """All that was found so far. It grows at its end in place; for any other change it becomes another list."""
        if self._earlier:
            self._matching = [*(row for part in reversed(self._earlier) for row in part), *self._matching]
            self._earlier.clear()
        return self._matching

    @property
    def is_complete(self) -> bool:
        """Whether all rows have been looked at."""
        return self._from == 0 and self._to == len(self.ids)

    def step(self) -> int:
        """Look at a few rows more; gives how many, 0 at the end. Raises InvalidFilter."""
        if self._to < len(self.ids):
            start, end = self._to, min(self._to + ROWS_OF_STEP, len(self.ids))
            self._matching += self._find_matching(start, end)
            self._to = end
        else:
            start, end = max(0, self._from - ROWS_OF_STEP), self._from
            found = self._find_matching(start, end)
            self._from = start
            if found:
                self._earlier.append(found)
        return end - start

    def recheck_live(self) -> None:
        """What had not ended when it was looked at, may match by now, or no longer. Raises InvalidFilter."""
        for row in self._live:
            matching = self.matching
            index = bisect_left(matching, row)
            listed = index < len(matching) and matching[index] == row
            if self._matches(row) == listed:
                continue
            self._matching = list(matching)
            if listed:
                del self._matching[index]
            else:
                insort(self._matching, row)
        self._live = [row for row in self._live if self._is_live(row)]

    def expect_change(self, id: int) -> None:
        """This row has changed, although its task had ended."""
        index = bisect_left(self.ids, id)
        if self._from <= index < self._to and id not in self._live:
            self._live.append(id)

    def _find_matching(self, start: int, end: int) -> list[int]:
        found = []
        for index in range(start, end):
            row = self.ids[index]
            if self._matches(row):
                found.append(row)
            if self._is_live(row):
                self._live.append(row)
        return found

    def _matches(self, id: int) -> bool:
        text = self._text_of(id)
        return text is not None and self.filter.matches(text)
