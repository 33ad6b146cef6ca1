"""The statistics of tables and reports, each with its definition, so that others can recompute them.

Quantiles follow definition 7 of Hyndman & Fan 1996 (The American Statistician 50(4), 361-365; doi
10.1080/00031305.1996.10473566). For ordered values x(1) to x(n) and h = (n - 1) p + 1, the quantile is interpolated
between x(floor h) and the next value by the fraction of h. This is the default of `quantile` in R and of
`numpy.quantile`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from msgspec import Struct

Z_95 = 1.959963984540054
"""95 % of the standard normal distribution is between minus this and this."""


class Summary(Struct, frozen=True):
    """A summary of some values. It has no mean, because a few long waits would dominate it."""

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
        """The interquartile range, the width of the middle half of the values."""
        return round(self.upper - self.lower, 6)


class Share(Struct, frozen=True):
    """A count out of a total."""

    count: int
    n: int

    @property
    def fraction(self) -> float | None:
        """The fraction from 0 to 1. None if the total is 0."""
        return self.count / self.n if self.n else None

    @property
    def interval(self) -> tuple[float, float] | None:
        """Wilson's 95 % interval. None if the total is 0."""
        return wilson_interval(self.count, self.n)


def quantile(values: Iterable[float], p: float) -> float | None:
    """Compute the value below which the part `p` (0 to 1) of the values lies, as defined at the top of this module.

    :return: None if there are no values.

    >>> quantile([1.0, 2.0, 4.0, 8.0], 0.95)
    7.4
    """
    return _quantile_of_sorted(sorted(values), p)


def median(values: Iterable[float]) -> float | None:
    """Compute the middle value, or the mean of the two middle values. None: there are no values."""
    return quantile(values, 0.5)


def summarise(values: Iterable[float]) -> Summary | None:
    """Summarise some values. None: there are none.

    >>> summarise([0.2, 0.4, 0.9])
    Summary(n=3, minimum=0.2, lower=0.3, median=0.4, upper=0.65, p95=0.85, maximum=0.9)
    """
    ordered = sorted(values)
    if not ordered:
        return None
    lower, middle, upper, p95 = (_quantile_of_sorted(ordered, p) or 0.0 for p in (0.25, 0.5, 0.75, 0.95))
    return Summary(len(ordered), ordered[0], lower, middle, upper, p95, ordered[-1])


def median_interval(values: Iterable[float]) -> tuple[float, float] | None:
    """Compute the 95 % interval of a median by order statistics: from the k-th of n ordered values to the k-th last. k
    is the largest number for which a binomial of n and 1/2 is below k with at most 2.5 %. The interval covers at least
    95 % for every distribution.

    :return: its ends; None for fewer than 6 values, whose range is too narrow.

    >>> median_interval([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 10.0]), median_interval([1.0, 2.0])
    ((2.0, 9.0), None)
    """
    ordered = sorted(values)
    n, k, ways, below = len(ordered), 0, 1, 1  # the number of the 2 ** n ways with at most k values below the median
    while below * 40 <= 2**n:
        k += 1
        ways = ways * (n - k + 1) // k
        below += ways
    return (ordered[k - 1], ordered[n - k]) if k else None


def share_over(values: Iterable[float], limit: float) -> Share:
    """Count the values above the limit. Values equal to it are not counted.

    >>> share_over([0.4, 1.0, 1.1, 2.5], 1.0).fraction
    0.5
    """
    given = list(values)
    return Share(sum(value > limit for value in given), len(given))


def wilson_interval(count: int, n: int) -> tuple[float, float] | None:
    """Compute the 95 % interval of a share by Wilson 1927 (Journal of the American Statistical Association 22, 209-212,
    doi 10.1080/01621459.1927.10502953), without continuity correction. It also suits small samples and rare events.

    :param count: the number of hits, from 0 to n.
    :param n: the total.
    :return: its ends, each from 0 to 1; None: n is 0.

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
