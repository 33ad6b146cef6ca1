"""Statistics against the standard library's, worked examples of the papers, and what must be so of any values."""

from __future__ import annotations

import statistics as python
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.results.analysis.statistics import Share, median, quantile, share_over, summarise, wilson_interval

seconds = st.floats(min_value=0, max_value=1e4, allow_nan=False).map(lambda value: round(value, 6))


def test_nothing_of_nothing():
    assert summarise([]) is None
    assert median([]) is None
    assert quantile([], 0.95) is None
    assert wilson_interval(0, 0) is None
    assert Share(0, 0).fraction is None
    assert Share(0, 0).interval is None
    assert share_over([], 1.0) == Share(0, 0)


def test_one_value_is_all_of_its_quantiles():
    found = summarise([0.7])
    assert found is not None
    assert {found.minimum, found.lower, found.median, found.upper, found.p95, found.maximum} == {0.7}
    assert found.iqr == 0


@given(st.lists(seconds, min_size=2, max_size=60))
def test_quartiles_are_those_of_the_standard_library(values):
    """`statistics.quantiles(method="inclusive")` is definition 7, too, by other code."""
    found = summarise(values)
    assert found is not None
    lower, middle, upper = python.quantiles(values, n=4, method="inclusive")
    assert found.lower == pytest.approx(lower, abs=2e-6)
    assert found.median == pytest.approx(middle, abs=2e-6)
    assert found.median == pytest.approx(python.median(values), abs=2e-6)
    assert found.upper == pytest.approx(upper, abs=2e-6)
    assert found.p95 == pytest.approx(python.quantiles(values, n=20, method="inclusive")[-1], abs=2e-6)


@given(st.lists(seconds, min_size=1, max_size=60))
def test_the_numbers_are_in_order_whatever_the_order_of_the_values(values):
    found = summarise(values)
    assert found is not None
    assert found == summarise(reversed(values))
    numbers = [found.minimum, found.lower, found.median, found.upper, found.p95, found.maximum]
    assert all(one <= next + 1e-6 for one, next in pairwise(numbers))


def test_a_value_at_the_limit_is_not_over_it():
    assert share_over([0.5, 1.0, 1.000001, 3.0], 1.0) == Share(2, 4)


@pytest.mark.parametrize(
    ("count", "n", "low", "high"),
    [  # Newcombe 1998, Statistics in Medicine 17, 857-872, table I, method 3
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
    ],
)
def test_wilson_intervals_of_newcombe(count, n, low, high):
    found = wilson_interval(count, n)
    assert found is not None
    assert found[0] == pytest.approx(low, abs=6e-5)
    assert found[1] == pytest.approx(high, abs=6e-5)


@given(st.integers(min_value=1, max_value=5000).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_a_wilson_interval_holds_its_share_and_mirrors(counts):
    count, n = counts
    low, high = wilson_interval(count, n) or (1, 0)
    assert 0 <= low <= count / n + 1e-6
    assert count / n - 1e-6 <= high <= 1
    mirrored = wilson_interval(n - count, n) or (1, 0)
    assert mirrored == pytest.approx((1 - high, 1 - low), abs=2e-6)
