"""What tests draw. `./dev test` plays the same examples every time, on every machine; `./dev soak --search N` draws
others, and more of them."""

from __future__ import annotations

import os
import random
from collections.abc import Iterable
from typing import TypeVar

import pytest

T = TypeVar("T")
SEARCH = int(os.environ.get("RISE_SEARCH", "0"))
"""How many examples a property gets of each hundred that it asks for; 0: the fixed ones, and few."""
FIXED = 30

searched = (pytest.mark.search, pytest.mark.skipif(not SEARCH, reason="takes minutes: ./dev soak --search"))
"""Marks of tests that `./dev test` leaves to a search."""


def examples(usual: int) -> int:
    """How many examples a test gets whose property is worth so many, when 100 is usual."""
    return max(1, usual * (SEARCH or FIXED) // 100)


def some(cases: Iterable[T], every: int = 3) -> list[T]:
    """One case of so many, always the same ones; in a search all."""
    return [*cases][:: 1 if SEARCH else every]


def one_of(usual: T, *others: T) -> T:
    """The usual one; in a search any."""
    return random.SystemRandom().choice((usual, *others)) if SEARCH else usual


def seeds(count: int, first: int = 0) -> range:
    """Numbers to draw from: in a search others each time."""
    if SEARCH:
        first, count = random.SystemRandom().randrange(10**9), max(1, count * SEARCH // 100)
    return range(first, first + count)
