"""The functions that give lists, and exactly what they draw (semantics.md 8.6)."""

from __future__ import annotations

from collections import Counter
from itertools import pairwise
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.expression import EvaluationError, Expression
from rise_engine.expression.operators import MAX_ENTRIES
from rise_engine.kernel.rng import Rng

MEMORY: dict[str, Any] = {"letters": ["a", "b", "c", "d", "e"], "n": 2, "name": "Ada", "long": [0] * (MAX_ENTRIES + 1)}

FIXED = {
    "range(0)": [],
    "range(3)": [0, 1, 2],
    "range(n, 5)": [2, 3, 4],
    "range(-2, 1)": [-2, -1, 0],
    "range(5, 2)": [],
    "range(-3)": [],
    "range(2.0)": [0, 1],
    "range(nobody)": [],
    "shuffle(nobody)": [],
    "sample(letters, 0)": [],
    "latin(nobody, 3)": [],
    "latin(range(4), 0)": [0, 1, 3, 2],
    "latin(range(4), 1)": [1, 2, 0, 3],
    "latin(range(4), 2)": [2, 3, 1, 0],
    "latin(range(4), 3)": [3, 0, 2, 1],
    "latin(range(4), 4)": [0, 1, 3, 2],
    "latin(range(3), 0)": [0, 1, 2],
    "latin(range(3), 1)": [1, 2, 0],
    "latin(range(3), 2)": [2, 0, 1],
    "latin(range(3), 3)": [2, 1, 0],
    "latin(range(3), 5)": [1, 0, 2],
    "latin(range(3), 6)": [0, 1, 2],
    "latin(letters, 9007199254740992)[0]": "c",
    "length(range(10000))": 10_000,
}


@pytest.mark.parametrize(("text", "expected"), FIXED.items())
def test_without_chance(text: str, expected: object) -> None:
    rng = Rng(1)
    assert Expression.parse(text).value(MEMORY, below=rng.integer_below) == expected
    assert rng.state == Rng(1).state, "nothing is drawn"


WRONG = {
    "range(10001)": "at most 10,000 entries, not 10,001",
    "range(0.5)": "whole numbers, not 0.5",
    "range(1e300)": "whole numbers",
    "range(0 / 0)": "whole numbers, not nan",
    "range(1 / 0)": "whole numbers, not inf",
    "range(name)": "is not a number",
    "shuffle(name)": 'takes a list, not the text "Ada"',
    "shuffle(long)": "at most 10,000 entries, not 10,001",
    "sample(letters, 6)": "cannot draw 6 different entries from a list of 5",
    "sample(letters, -1)": "no number below 0",
    "sample(letters, 1.5)": "whole numbers, not 1.5",
    "latin(letters, -1)": "no number below 0",
    "latin(n, 1)": "takes a list, not the number 2",
    "shuffle(letters) + 1": "is a list, which is not a number",
}


@pytest.mark.parametrize(("text", "why"), WRONG.items())
def test_what_does_not_fit(text: str, why: str) -> None:
    with pytest.raises(EvaluationError) as error:
        Expression.parse(text).value(MEMORY, below=Rng(1).integer_below)
    assert why in str(error.value)


@pytest.mark.parametrize("text", ["shuffle(letters)", "sample(letters, 2)"])
def test_without_a_source_of_chance_there_is_no_value(text: str) -> None:
    with pytest.raises(EvaluationError, match="no source of chance"):
        Expression.parse(text).value(MEMORY)


def test_the_same_on_every_python() -> None:
    """Numbers of semantics.md 8.6, worked out once; no version of Python may give others."""
    rng = Rng(2026)
    drawn = [Expression.parse(text).value(MEMORY, below=rng.integer_below) for text in (
        "shuffle(letters)", "sample(letters, 3)", "shuffle(range(10))",
    )]  # fmt: skip
    assert drawn == [["d", "a", "c", "b", "e"], ["d", "c", "e"], [6, 0, 9, 4, 7, 5, 2, 1, 3, 8]]
    assert rng.state == (2026 + (4 + 3 + 9) * 0x9E3779B97F4A7C15) % 2**64, "as many draws as the page says"


class Written:
    """semantics.md 8.6 once more, written down without looking at the program."""

    def __init__(self, seed: int) -> None:
        self.s = seed % 2**64

    def below(self, n: int) -> int:
        self.s = (self.s + 0x9E3779B97F4A7C15) % 2**64
        z = self.s
        z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 % 2**64
        z = (z ^ (z >> 27)) * 0x94D049BB133111EB % 2**64
        return (z ^ (z >> 31)) * n // 2**64

    def shuffle(self, entries: list[Any]) -> list[Any]:
        e = list(entries)
        i = len(e) - 1
        while i >= 1:
            j = self.below(i + 1)
            e[i], e[j] = e[j], e[i]
            i -= 1
        return e

    def sample(self, entries: list[Any], n: int) -> list[Any]:
        left, result = list(entries), []
        for _ in range(n):
            j = self.below(len(left))
            result.append(left[j])
            last = left.pop()
            if j < len(left):
                left[j] = last
        return result


@given(st.lists(st.integers() | st.text(max_size=2), max_size=30), st.integers(0, 2**64 - 1), st.data())
def test_shuffle_and_sample_are_as_written(entries: list[Any], seed: int, data: st.DataObject) -> None:
    count = data.draw(st.integers(0, len(entries)))
    rng, written, before = Rng(seed), Written(seed), entries.copy()
    memory = {"entries": entries, "count": count}
    order = Expression.parse("shuffle(entries)").value(memory, below=rng.integer_below)
    some = Expression.parse("sample(entries, count)").value(memory, below=rng.integer_below)
    assert (order, some) == (written.shuffle(entries), written.sample(entries, count))
    assert rng.state == written.s
    assert entries == before, "the memory's own list is as it was"
    assert Counter(map(repr, order)) == Counter(map(repr, entries))
    assert not Counter(map(repr, some)) - Counter(map(repr, entries)) and len(some) == count


@pytest.mark.parametrize("size", range(2, 12))
def test_a_latin_square_is_balanced(size: int) -> None:
    rows = size if size % 2 == 0 else 2 * size
    square = [Expression.parse(f"latin(range({size}), {row})").value({}) for row in range(rows)]
    for place in range(size):
        assert set(Counter(row[place] for row in square).values()) == {rows // size}, "every entry in every place"
    following = Counter(pair for row in square for pair in pairwise(row))
    assert len(following) == size * (size - 1) and set(following.values()) == {rows // size}
    assert Expression.parse(f"latin(range({size}), {rows})").value({}) == square[0], "then again from the start"
