"""The few statistics that tables and reports give, each with its definition, so that others can compute them anew.

Quantiles are those of Hyndman & Fan 1996 (The American Statistician 50(4), 361-365; doi
10.1080/00031305.1996.10473566), definition 7: with the values in order, x(1) to x(n), and h = (n - 1) p + 1, the
quantile lies between x(floor h) and the next one, as far as h lies beyond its floor. It is what `quantile` of R and
`numpy.quantile` do when nothing else is asked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from msgspec import Struct

Z_95 = 1.959963984540054
"""The standard normal distribution has 95 % of itself between minus this and this."""


class Summary(Struct, frozen=True):
    """Some values, in the numbers that are told of them. There is no mean: a few long waits would make it."""

    n: int
    minimum: float
    lower: float
    """First quartile."""
    median: float
    upper: float
    """Third quartile."""
    p95: float
    maximum: float

    @property
    def iqr(self) -> float:
        """Interquartile range: how far the middle half of the values reaches."""
        return round(self.upper - self.lower, 6)


class Share(Struct, frozen=True):
    """So many of so many."""

    count: int
    n: int

    @property
    def fraction(self) -> float | None:
        """From 0 to 1; None: of nothing."""
        return self.count / self.n if self.n else None

    @property
    def interval(self) -> tuple[float, float] | None:
        """Its 95 % interval after Wilson; None: of nothing."""
        return wilson_interval(self.count, self.n)


def quantile(values: Iterable[float], p: float) -> float | None:
    """The value below which the part `p` (0 to 1) of the values lies, as the head of this module defines it.

    :return: None when there are no values.

    >>> quantile([1.0, 2.0, 4.0, 8.0], 0.95)
    7.4
    """
    return _quantile_of_sorted(sorted(values), p)


def median(values: Iterable[float]) -> float | None:
    """The middle value, or what lies halfway between the two in the middle; None when there are no values."""
    return quantile(values, 0.5)


def summarise(values: Iterable[float]) -> Summary | None:
    """The numbers that are told of some values; None when there are none.

    >>> summarise([0.2, 0.4, 0.9])
    Summary(n=3, minimum=0.2, lower=0.3, median=0.4, upper=0.65, p95=0.85, maximum=0.9)
    """
    ordered = sorted(values)
    if not ordered:
        return None
    lower, middle, upper, p95 = (_quantile_of_sorted(ordered, p) or 0.0 for p in (0.25, 0.5, 0.75, 0.95))
    return Summary(len(ordered), ordered[0], lower, middle, upper, p95, ordered[-1])


def median_interval(values: Iterable[float]) -> tuple[float, float] | None:
    """The 95 % interval of a median by order statistics: of n values in order, from the k-th to the k-th from the end,
    with the largest k for which a binomial of n and 1/2 is below k with at most 2.5 %. It holds for every distribution,
    with at least 95 %.

    :return: from and to; None of fewer than 6 values, whose range is no such interval.

    >>> median_interval([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0]), median_interval([1.0, 2.0])
    ((2.0, 9.0), None)
    """
    ordered = sorted(values)
    n, k, ways, below = len(ordered), 0, 1, 1  # of 2 ** n ways, those in which fewer than k + 1 lie below the median
    while below * 40 <= 2**n:
        k += 1
        ways = ways * (n - k + 1) // k
        below += ways
    return (ordered[k - 1], ordered[n - k]) if k else None


def share_over(values: Iterable[float], limit: float) -> Share:
    """How many values lie above the limit; one that is equal to it does not.

    >>> share_over([0.4, 1.0, 1.1, 2.5], 1.0).fraction
    0.5
    """
    given = list(values)
    return Share(sum(value > limit for value in given), len(given))


def wilson_interval(count: int, n: int) -> tuple[float, float] | None:
    """The 95 % interval of a share: Wilson 1927 (Journal of the American Statistical Association 22, 209-212,
    doi 10.1080/01621459.1927.10502953), without correction for continuity. It is good for few and for rare ones, too.

    :param count: how many, from 0 to n.
    :param n: of how many.
    :return: from and to, each from 0 to 1; None when n is 0.

    >>> wilson_interval(1, 10)
    (0.017876, 0.40415)
    """
    if n <= 0:
        return None
    part, square = count / n, Z_95 * Z_95
    middle = part + square / (2 * n)
    reach = Z_95 * math.sqrt(part * (1 - part) / n + square / (4 * n * n))
    low, high = (middle - reach) / (1 + square / n), (middle + reach) / (1 + square / n)
    return (0.0 if count == 0 else round(max(0.0, low), 6), 1.0 if count == n else round(min(1.0, high), 6))


def _quantile_of_sorted(ordered: Sequence[float], p: float) -> float | None:
    if not ordered:
        return None
    place = (len(ordered) - 1) * p
    below = min(math.floor(place), len(ordered) - 1)
    above = min(below + 1, len(ordered) - 1)
    return round(ordered[below] + (place - below) * (ordered[above] - ordered[below]), 6)
