"""The filter typed after `/`: the rows that it shows, and its matches in them. Pure.

- Words, in any order: the row must contain each of them, as typed or with letters omitted (`rin2` finds
  `R_Instruction_2`). A word with a capital is case-sensitive. `!word`: rows with this word are hidden.
- `/...` or `re:...`: one regular expression; `!/...`: rows that it matches are hidden.

A regular expression may never end on one row, and until then the console would not react to a key, not even stop. So
`regex` runs it with a time limit, on at most MAX_CHARACTERS of a row. It must also be valid for Python's `re`, whose
errors are shown.
"""

from __future__ import annotations

import re
import warnings
from bisect import bisect_left, insort
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress

import regex

from rise_engine.base.errors import RiseError
from rise_tui.rendering.text import ListRow, StyledLine, highlight_matches, plain_text

MAX_CHARACTERS = 500
"""Characters of a row that a regular expression examines."""
PATIENCE = 0.004
"""Seconds that a regular expression may take for one row."""
TOO_LONG = "this regular expression takes too long; use fewer * and +"
MIN_LETTERS, MAX_LETTERS = 3, 40
"""The length of a word that may omit letters. Nearly every row contains two given letters in order."""

_PART = r"(?:(?<![^\W_])|(?-i:(?<=[a-z])(?=[A-Z])))"
"""The start of a part of a name: `Instruction` in `R_Instruction` and in `RunInstruction`."""
_REASONS = (
    ("unterminated character set", "the [ is not closed"),
    ("unterminated subpattern", "the ( is not closed"),
    ("unbalanced parenthesis", "this ) closes nothing"),
    ("nothing to repeat", "there is nothing before this to repeat"),
    ("multiple repeat", "two repetitions in a row"),
    ("bad escape", "the \\ has no meaning before this character"),
    ("bad character range", "this range runs backwards"),
    ("min repeat greater", "this repetition runs backwards"),
    ("look-behind", "a look-behind must have a fixed length"),
)


class InvalidFilter(RiseError, ValueError):
    """A text is not a filter, or not yet. The message names the place and the reason, for a person."""


class Filter:
    """One filter, as typed."""

    def __init__(self, text: str) -> None:
        """Raises InvalidFilter."""
        self.text = text
        self._terms: list[tuple[_Word | _Expression, bool]] = []
        """Terms that a row must contain (true) or must not contain (false)."""
        bare = text.strip()
        refused = bare.startswith("!")
        rest = bare.removeprefix("!")
        for lead in ("re:", "/"):
            if rest.startswith(lead):
                at = text.index(lead) + len(lead)
                expression = _compile_expression(rest.removeprefix(lead), at, slash=lead == "/")
                self._terms += [(expression, not refused)] if expression is not None else []
                return
        words = [(word.removeprefix("!"), not word.startswith("!")) for word in bare.split()]
        self._terms += [(_Word(word, loose=wanted), wanted) for word, wanted in words if word]

    def __bool__(self) -> bool:
        """False while no typed term could hide a row."""
        return bool(self._terms)

    def matches(self, text: str) -> bool:
        """Whether a row with this text should be shown. Raises InvalidFilter for an expression that takes too long."""
        return all(term.found_in(text) == wanted for term, wanted in self._terms)

    def match_spans(self, text: str) -> list[tuple[int, int]]:
        """Where the filter matches: first and last positions, in order and without overlaps. Raises as `matches`."""
        found = sorted(span for term, wanted in self._terms if wanted for span in term.spans(text))
        merged: list[tuple[int, int]] = []
        for start, end in found:
            if merged and start <= merged[-1][1]:
                merged[-1] = merged[-1][0], max(end, merged[-1][1])
            elif start < end:
                merged.append((start, end))
        return merged


class _Word:
    """A word, as typed or with letters omitted."""

    def __init__(self, word: str, *, loose: bool) -> None:
        flags = re.NOFLAG if any(letter.isupper() for letter in word) else re.IGNORECASE
        self._exact = re.compile(re.escape(word), flags)
        short = not MIN_LETTERS <= len(word) <= MAX_LETTERS
        self._loose = re.compile(_PART + "".join(_letter_patterns(word)), flags) if loose and not short else None

    def found_in(self, text: str) -> bool:
        return self._exact.search(text) is not None or (
            self._loose is not None and self._loose.search(text) is not None
        )

    def spans(self, text: str) -> Iterator[tuple[int, int]]:
        exact = [found.span() for found in self._exact.finditer(text)]
        if exact or self._loose is None:
            yield from exact
        elif (found := self._loose.search(text)) is not None:
            yield from (found.span(letter) for letter in range(1, self._loose.groups + 1))


def _letter_patterns(word: str) -> Iterator[str]:
    """Return patterns that find letters in order within one name. They are quick, because each gap matches in only one
    way.

    Digits are not separated: `topic2` does not find `topic12`.
    """
    for at, letter in enumerate(word):
        if at:
            yield r"[^\s\d]*" if letter.isdigit() else rf"[^\s{re.escape(letter)}]*"
        yield f"({re.escape(letter)})"


class _Expression:
    """A regular expression with a time limit."""

    def __init__(self, pattern: regex.Pattern[str]) -> None:
        self._pattern = pattern

    def found_in(self, text: str) -> bool:
        for _ in range(2):  # another process may have taken the time: try again
            with suppress(TimeoutError):
                return self._pattern.search(text, 0, MAX_CHARACTERS, timeout=PATIENCE) is not None
        raise InvalidFilter(TOO_LONG)

    def spans(self, text: str) -> Iterator[tuple[int, int]]:
        try:
            yield from (found.span() for found in self._pattern.finditer(text, 0, MAX_CHARACTERS, timeout=2 * PATIENCE))
        except TimeoutError:
            raise InvalidFilter(TOO_LONG) from None


def _compile_expression(pattern: str, at: int, *, slash: bool) -> _Expression | None:
    """A regular expression from `at` of the typed text; None: it is empty."""
    if slash and len(pattern) > 1 and pattern.endswith("/") and not pattern.endswith("\\/"):
        pattern = pattern[:-1]
    if not pattern:
        return None
    minds_capitals = any(each.isupper() for each in re.sub(r"\\.", "", pattern))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            re.compile(pattern)
            return _Expression(regex.compile(pattern, 0 if minds_capitals else regex.IGNORECASE))
    except re.error as error:
        reason = next((reason for known, reason in _REASONS if known in error.msg), error.msg)
        raise InvalidFilter(f"at {at + (error.pos or 0) + 1}: {reason}") from error
    except regex.error as error:  # valid only for `re`
        raise InvalidFilter(str(error)) from error
    except (OverflowError, RecursionError, MemoryError) as error:
        raise InvalidFilter("this regular expression is too large") from error


def mark_line(line: StyledLine, wanted: Filter | None) -> StyledLine:
    """The line with the filter's matches marked. Raises as `Filter.matches`."""
    return line if wanted is None else highlight_matches(line, wanted.match_spans(plain_text(line)))


def filter_rows(rows: Iterable[ListRow], wanted: Filter) -> list[ListRow]:
    """The rows that the filter shows, with matches marked, without headings and similar rows. Raises the same."""
    return [
        row._replace(line=mark_line(row.line, wanted))
        for row in rows
        if row.selectable and wanted.matches(row.full or plain_text(row.line))
    ]


# --- searching a log -------------------------------------------------------------------------------------------------

ROWS_OF_STEP = 32


class RowSearch:
    """The ids that match. The search takes new ids first, then goes backwards from the newest.

    `ids` is the caller's ascending list, which only grows at its end. `text_of` returns None for a forgotten id.
    """

    def __init__(
        self,
        filter: Filter,
        ids: Sequence[int],
        text_of: Callable[[int], str | None],
        is_live: Callable[[int], bool],
    ) -> None:
        """`is_live`: whether a task can still change, so that it must be checked again."""
        self.filter = filter
        self.ids, self._text_of, self._is_live = ids, text_of, is_live
        self._from = self._to = len(ids)
        """The rows between these have been checked."""
        self._matching: list[int] = []
        self._earlier: list[list[int]] = []
        """Earlier matches, the latest rows first."""
        self._live: list[int] = []

    @property
    def matching(self) -> list[int]:
        """All matches so far. The list grows at its end in place; any other change makes a new list."""
        if self._earlier:
            self._matching = [*(row for part in reversed(self._earlier) for row in part), *self._matching]
            self._earlier.clear()
        return self._matching

    @property
    def is_complete(self) -> bool:
        """Whether all rows have been checked."""
        return self._from == 0 and self._to == len(self.ids)

    def step(self) -> int:
        """Check a few more rows. Returns their number, 0 at the end. Raises InvalidFilter."""
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
        """Check unfinished rows again: they may match now, or no longer match. Raises InvalidFilter."""
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
        """Note that this row has changed after the end of its task."""
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
