"""The plan's own chance: stored values, so that no Python and no change of ours moves a plan."""

from __future__ import annotations

from collections import Counter
from hashlib import sha256
from itertools import permutations

import pytest

from rise_engine.study.chance import Chance, session_seed


def test_values_are_those_of_the_definition() -> None:
    """Value k is the first 8 bytes of SHA-256 of seed/name/.../k; below 2**64 nothing is rejected."""
    chance = Chance(20261122, "block", "language=de", 3)
    expected = [
        int.from_bytes(sha256(f"20261122/block/language=de/3/{k}".encode()).digest()[:8], "big") for k in range(5)
    ]
    assert [chance.integer_below(2**64) for _ in range(5)] == expected


def test_stored_values() -> None:
    assert [Chance(1, "a").integer_below(1000) for _ in range(2)] == [90, 90]
    chance = Chance(1, "a")
    assert [chance.integer_below(6) for _ in range(12)] == [2, 2, 4, 0, 3, 2, 0, 3, 1, 5, 1, 4]
    assert Chance(42, "x", 2).shuffle("abcdefgh") == list("afcbeghd")
    assert session_seed(20261122, 3, 2) == 1806423634


@pytest.mark.parametrize("count", [2, 3, 7, 10])
def test_every_number_is_as_likely(count: int) -> None:
    chance = Chance(5, "likely")
    drawn = Counter(chance.integer_below(count) for _ in range(4000))
    assert set(drawn) == set(range(count))
    assert all(abs(number - 4000 / count) < 5 * (4000 / count) ** 0.5 for number in drawn.values())


def test_what_is_too_large_is_drawn_again() -> None:
    """With 2**63 + 1 numbers nearly half of the values are beyond the last whole multiple."""
    count = 2**63 + 1
    chance = Chance(9, "reject")
    values = [int.from_bytes(sha256(f"9/reject/{k}".encode()).digest()[:8], "big") for k in range(60)]
    expected = [value for value in values if value < count]
    assert 10 < len(expected) < 50
    assert [chance.integer_below(count) for _ in expected] == expected


def test_every_order_comes() -> None:
    drawn = Counter("".join(Chance(3, "order", number).shuffle("abc")) for number in range(1200))
    assert set(drawn) == {"".join(each) for each in permutations("abc")}
    assert min(drawn.values()) > 140


def test_other_names_are_another_row() -> None:
    assert Chance(1, "a", "b").integer_below(2**64) != Chance(1, "a", "c").integer_below(2**64)
