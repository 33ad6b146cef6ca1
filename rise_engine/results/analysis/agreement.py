"""Agreement of raters (percent, kappa, alpha, ICC, limits of agreement), and of wizards.

There are five formulas from the literature. Tests compare them with published data sets and four libraries, which
cannot be dependencies (two are under the GPL). An undefined statistic has a sentence instead of a number:
`Estimate.value` is None, and `Estimate.why` gives the reason. `compare_wizards` applies them to the decisions of
wizards about the same cues, over sessions: overall and by condition.

Sources: Cohen 1960 (kappa), Fleiss, Cohen and Everitt 1969 (its error), Krippendorff 2004 (alpha), McGraw and Wong 1996
and Shrout and Fleiss 1979 (ICC), Bland and Altman 1986 (limits of agreement).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from itertools import combinations
from math import exp, fsum, lgamma, log, log1p, sqrt
from typing import TypeAlias, TypeVar

from msgspec import Struct, field

from rise_engine.results.analysis.judged_cues import JudgedCue, JudgedSession, MarkedAct
from rise_engine.results.analysis.statistics import Z_95, wilson_interval

Value = TypeVar("Value", bound=Hashable)
Pair: TypeAlias = tuple[Value, Value]

NOTHING_SHARED = "nothing was judged by two of them"
_NO_ERROR = 1e-6
"""A smaller error is only rounding (the root of 1e-16)."""
_SAME = 1e-12
"""Sums with a smaller relative difference are equal; the rest is rounding."""


class Estimate(Struct, frozen=True, kw_only=True):
    """One statistic of a sample."""

    value: float | None = None
    """None: it is undefined for this sample."""
    error: float | None = None
    """The standard error."""
    low: float | None = None
    high: float | None = None
    """The ends of the 95 % interval."""
    n: int = 0
    """The number of units, or of pairs of judgements."""
    why: str = ""
    """The reason why there is no value or no interval, as a sentence."""


class Differences(Struct, frozen=True, kw_only=True):
    """The differences second minus first of pairs (Bland and Altman 1986)."""

    n: int = 0
    mean: float | None = None
    deviation: float | None = None
    """The standard deviation of the differences."""
    low: float | None = None
    high: float | None = None
    """The limits of agreement: 95 % of normally distributed differences are between them."""
    why: str = ""


def percent_agreement(pairs: Sequence[Pair[Value]]) -> Estimate:
    """Compute the share of units on which both agree, from 0 to 1, with Wilson's interval.

    It ignores agreement by chance, so read it together with kappa.
    """
    if not pairs:
        return Estimate(why=NOTHING_SHARED)
    hits = sum(first == second for first, second in pairs)
    low, high = wilson_interval(hits, len(pairs)) or (None, None)
    return Estimate(value=hits / len(pairs), low=low, high=high, n=len(pairs))


def cohen_kappa(pairs: Sequence[Pair[Value]]) -> Estimate:
    """Compute Cohen's kappa of two raters over nominal categories, unweighted.

    This is the agreement beyond that of two blind raters with the same category frequencies: 0 is chance, 1 is perfect.
    The standard error is the one for a kappa other than 0 (Fleiss, Cohen and Everitt 1969), for large samples. The
    interval is value ± 1.96 errors, cut at -1 and 1. There is none if the error is 0.

    :param pairs: one pair of categories for each unit that both have judged.
    """
    n = len(pairs)
    if not n:
        return Estimate(why=NOTHING_SHARED)
    cells = Counter(pairs)
    rows, columns = Counter(first for first, _ in pairs), Counter(second for _, second in pairs)
    observed = sum(count for (first, second), count in cells.items() if first == second) / n
    expected = fsum(rows[each] * columns[each] for each in rows) / (n * n)
    if sum(rows[each] * columns[each] for each in rows) == n * n:
        return Estimate(n=n, why=_one_category(next(iter(rows))))
    kappa = (observed - expected) / (1 - expected)
    # p_ij is the share of a cell, p_i. and p_.j are those of its row and its column.
    agreeing = fsum(cells[each, each] / n * (1 - (rows[each] + columns[each]) / n * (1 - kappa)) ** 2 for each in rows)
    other = (1 - kappa) ** 2 * fsum(
        count / n * ((columns[first] + rows[second]) / n) ** 2
        for (first, second), count in cells.items()
        if first != second
    )
    variance = (agreeing + other - (kappa - expected * (1 - kappa)) ** 2) / (n * (1 - expected) ** 2)
    error = sqrt(max(0.0, variance))
    if all(first == second for first, second in cells):
        return Estimate(value=1.0, error=0.0, n=n, why="no interval: they never differed")
    if error < _NO_ERROR:
        same = len(rows) == 1 or len(columns) == 1
        why = "one of them always chose the same" if same else "the formula gives no error here"
        return Estimate(value=kappa, error=0.0, n=n, why=f"no interval: {why}")
    return Estimate(
        value=kappa, error=error, low=max(-1.0, kappa - Z_95 * error), high=min(1.0, kappa + Z_95 * error), n=n
    )


def krippendorff_alpha(units: Sequence[Sequence[Value | None]]) -> Estimate:
    """Compute Krippendorff's alpha of nominal values for any number of raters, with missing judgements.

    It is 1 minus the observed disagreement divided by the disagreement expected if the given values were assigned by
    chance; 0 is chance, 1 is perfect.

    :param units: for each unit one value of each rater, None if missing. Units with fewer than two values are ignored.
    :return: without error or interval; `n` is the number of units used.
    """
    paired = [[value for value in unit if value is not None] for unit in units]
    paired = [values for values in paired if len(values) > 1]
    if not paired:
        return Estimate(why=NOTHING_SHARED)
    given = Counter(value for values in paired for value in values)
    total = sum(given.values())
    observed = fsum(_disagreement(Counter(values)) / (len(values) - 1) for values in paired) / total
    expected = _disagreement(given) / (total * (total - 1))
    if expected == 0:
        return Estimate(n=len(paired), why=_one_category(next(iter(given))))
    return Estimate(value=1 - observed / expected, n=len(paired))


def _disagreement(counts: Counter[Value]) -> int:
    """Count the ordered pairs of values that differ."""
    return sum(counts.values()) ** 2 - sum(count**2 for count in counts.values())


def _one_category(value: object) -> str:
    return (
        f"all of them always chose the same ({value}), so agreement cannot be distinguished from habit: "
        "the number is not defined"
    )


def icc_a1(rows: Sequence[Sequence[float]]) -> Estimate:
    """Compute ICC(A,1), also called ICC(2,1): absolute agreement of single raters from a random sample.

    This is the share of the variance between units, where differences between raters also count as error. A second
    wizard who is always 0.3 s later lowers it. The 95 % interval is that of McGraw and Wong 1996.

    :param rows: for each unit one number of each rater, at least two, none missing.
    :raises ValueError: the rows have different lengths, or fewer than two numbers.
    """
    if not rows:
        return Estimate(why=NOTHING_SHARED)
    n, k = len(rows), len(rows[0])
    if k < 2 or any(len(row) != k for row in rows):
        raise ValueError("every unit needs a number of every rater, and there must be at least two raters")
    if n < 2:
        return Estimate(n=n, why="one unit has no variance: at least two are needed")
    grand = fsum(value for row in rows for value in row) / (n * k)
    means = [fsum(row) / k for row in rows]
    rater_means = [fsum(row[rater] for row in rows) / n for rater in range(k)]
    between = k * fsum((mean - grand) ** 2 for mean in means) / (n - 1)
    raters = n * fsum((mean - grand) ** 2 for mean in rater_means) / (k - 1)
    residual = fsum(
        (row[rater] - mean - rater_means[rater] + grand) ** 2
        for row, mean in zip(rows, means, strict=True)
        for rater in range(k)
    ) / ((n - 1) * (k - 1))
    size = max(abs(value) for row in rows for value in row) ** 2
    if max(between, raters, residual) <= _SAME * size:
        return Estimate(n=n, why="all values are the same: without variance the number is not defined")
    icc = (between - residual) / (between + (k - 1) * residual + k * (raters - residual) / n)
    low, high = _icc_interval(icc, between, raters, residual, n, k, smallest=_SAME * size)
    return Estimate(value=icc, low=low, high=high, n=n)


def _icc_interval(
    icc: float, between: float, raters: float, residual: float, n: int, k: int, *, smallest: float
) -> tuple[float | None, float | None]:
    """Compute the interval. Mean squares below `smallest` are rounding. (None, None): the approximation fails."""
    if residual <= smallest:  # the raters differ by a constant, or not at all
        return (icc, icc) if raters <= smallest else (None, None)
    ratio = raters / residual
    weight = n * (1 + (k - 1) * icc) - k * icc
    freedom_above = (k - 1) * (n - 1) * (k * icc * ratio + weight) ** 2
    freedom_below = (n - 1) * k * k * icc * icc * ratio * ratio + weight**2
    if freedom_above <= 0 or freedom_below <= 0:
        return None, None
    freedom = freedom_above / freedom_below
    lower, upper = f_quantile(0.975, n - 1, freedom), f_quantile(0.975, freedom, n - 1)
    rest = k * raters + (k * n - k - n) * residual
    low = n * (between - lower * residual) / (lower * rest + n * between)
    high = n * (upper * between - residual) / (rest + n * upper * between)
    return low, high


def limits_of_agreement(pairs: Sequence[tuple[float, float]]) -> Differences:
    """Compute the mean of second minus first, and the limits that contain 95 % of the differences.

    :param pairs: two numbers for each unit, both in the same unit of measurement.
    """
    n = len(pairs)
    if not n:
        return Differences(why=NOTHING_SHARED)
    differences = [second - first for first, second in pairs]
    mean = fsum(differences) / n
    if n < 2:
        return Differences(n=n, mean=mean, why="one difference has no spread: at least two are needed")
    deviation = sqrt(fsum((each - mean) ** 2 for each in differences) / (n - 1))
    return Differences(n=n, mean=mean, deviation=deviation, low=mean - Z_95 * deviation, high=mean + Z_95 * deviation)


# --- the distribution F -----------------------------------------------------------------------------------------------


def f_quantile(share: float, above: float, below: float) -> float:
    """Compute the value below which `share` of an F distribution lies.

    :param share: between 0 and 1, both excluded.
    :param above: degrees of freedom of the numerator; need not be whole.
    :param below: degrees of freedom of the denominator.
    """
    low, high = 0.0, 1.0
    while _f_share(high, above, below) < share and high < 1e300:
        low, high = high, high * 2
    for _ in range(200):
        middle = (low + high) / 2
        if middle in (low, high):
            break
        low, high = (middle, high) if _f_share(middle, above, below) < share else (low, middle)
    return (low + high) / 2


def _f_share(value: float, above: float, below: float) -> float:
    return _beta_share(above * value / (above * value + below), above / 2, below / 2)


def _beta_share(x: float, a: float, b: float) -> float:
    """Compute the regularised incomplete beta function by its continued fraction (DLMF 8.17.22), in its fast range."""
    if x <= 0:
        return 0.0
    if x >= 1:
        return 1.0
    if x > (a + 1) / (a + b + 2):
        return 1 - _beta_share(1 - x, b, a)
    front = exp(lgamma(a + b) - lgamma(a) - lgamma(b) + a * log(x) + b * log1p(-x)) / a
    # Evaluate the fraction from its first term on, with numerators and denominators by Wallis and Lentz.
    tiny = 1e-300
    fraction, last_top, last_bottom = 1.0, 1.0, 0.0
    for step in range(100_000):
        half = step // 2
        if step == 0:
            term = 1.0
        elif step % 2:
            term = -(a + half) * (a + b + half) * x / ((a + 2 * half) * (a + 2 * half + 1))
        else:
            term = half * (b - half) * x / ((a + 2 * half - 1) * (a + 2 * half))
        last_bottom = 1 / (1 + term * last_bottom or tiny)
        last_top = 1 + term / last_top or tiny
        change = last_top * last_bottom
        fraction *= change
        if step and abs(change - 1) < 1e-15:
            break
    return front * (fraction - 1)


# --- wizards about the same cues --------------------------------------------------------------------------------------


ALL = ""
"""The group of all units."""
SMALL_SAMPLE = 30
"""With fewer units, the intervals of two wizards are wide, and that of kappa is too narrow."""


NO_TIMES = "there is no cue to which all of them did something"
MIN_TIMED = 3
"""With fewer units, an ICC is arbitrary."""


class CellCount(Struct, frozen=True):
    """How often a pair of decisions occurred: the first wizard's and the second's."""

    first: str
    second: str
    count: int


class PairStatistics(Struct, frozen=True, kw_only=True):
    """The statistics of two wizards over what both have judged."""

    first: str
    second: str
    percent: Estimate
    kappa: Estimate
    confusion: tuple[CellCount, ...]
    """The most frequent pair first."""
    icc: Estimate
    """ICC(A,1) of the latencies of cues to which both reacted."""
    latency: Differences
    """Latency of the second wizard minus that of the first, in seconds."""


class GroupStatistics(Struct, frozen=True, kw_only=True):
    """The statistics of all wizards over one group of units."""

    group: str
    """The condition. Empty: all units."""
    units: int
    """The number of units that at least two wizards have judged."""
    alpha: Estimate
    icc: Estimate
    """ICC of all wizards, over the cues to which each of them reacted."""
    pairs: tuple[PairStatistics, ...]


class AgreementReport(Struct, kw_only=True):
    """The result of a comparison."""

    wizards: list[str] = field(default_factory=list)
    """First the wizards who ran sessions, then those who judged."""
    cues: list[JudgedCue] = field(default_factory=list)
    groups: list[GroupStatistics] = field(default_factory=list)
    """All cues first, then each condition if there are several."""
    marks: list[MarkedAct] = field(default_factory=list)
    marked: GroupStatistics | None = None
    """Statistics of the marks for mistakes. None: fewer than two have marked any."""
    sessions: int = 0
    undone: int = 0
    """The number of undone cues."""
    remarks: list[str] = field(default_factory=list)


def compare_wizards(sessions: Iterable[JudgedSession]) -> AgreementReport:
    """Compare the decisions in sessions, which are read one after the other."""
    report = AgreementReport()
    live: dict[str, None] = {}
    judges: dict[str, None] = {}
    for session in sessions:
        report.sessions += 1
        report.undone += session.undone
        report.cues += session.cues
        report.marks += session.acts
        report.remarks += session.remarks
        live[session.live] = None
        judges.update(dict.fromkeys(name for cue in session.cues for name in cue.decisions))
    report.wizards = list(dict.fromkeys([*live, *judges]))
    conditions = sorted({cue.facts.condition for cue in report.cues})
    report.groups = [_compare_cues(ALL, report.cues, report.wizards)]
    if len(conditions) > 1:
        report.groups += [
            _compare_cues(each or "(none)", [cue for cue in report.cues if cue.facts.condition == each], report.wizards)
            for each in conditions
        ]
    report.marked = _compare_marks(report.marks)
    return report


def _compare_cues(group: str, cues: Sequence[JudgedCue], wizards: Sequence[str]) -> GroupStatistics:
    present = [name for name in wizards if any(name in cue.decisions for cue in cues)]
    pairs = []
    for first, second in combinations(present, 2):
        both = [
            (cue.decisions[first], cue.decisions[second])
            for cue in cues
            if first in cue.decisions and second in cue.decisions
        ]
        if both:
            timed = [
                (one.latency, other.latency)
                for one, other in both
                if one.latency is not None and other.latency is not None
            ]
            pairs.append(_pair(first, second, [(one.label, other.label) for one, other in both], timed))
    latencies = [[cue.decisions[name].latency for name in present if name in cue.decisions] for cue in cues]
    complete = [
        [each for each in row if each is not None]
        for row in latencies
        if len(row) == len(present) > 1 and None not in row
    ]
    judged = [[cue.decisions[name].label if name in cue.decisions else None for name in present] for cue in cues]
    return GroupStatistics(
        group=group,
        units=sum(len(cue.decisions) > 1 for cue in cues),
        alpha=krippendorff_alpha(judged),
        icc=_icc(complete),
        pairs=tuple(pairs),
    )


def _pair(
    first: str, second: str, labels: Sequence[tuple[str, str]], timed: Sequence[tuple[float, float]]
) -> PairStatistics:
    counts = Counter(labels)
    return PairStatistics(
        first=first,
        second=second,
        percent=percent_agreement(labels),
        kappa=cohen_kappa(labels),
        confusion=tuple(CellCount(one, other, count) for (one, other), count in counts.most_common()),
        icc=_icc(timed),
        latency=limits_of_agreement(timed) if timed else Differences(why=NO_TIMES),
    )


def _icc(rows: Sequence[Sequence[float]]) -> Estimate:
    if not rows:
        return Estimate(why=NO_TIMES)
    if len(rows) < MIN_TIMED:
        return Estimate(n=len(rows), why=f"it needs {MIN_TIMED} cues to which all of them did something")
    return icc_a1(rows)


def _compare_marks(acts: Sequence[MarkedAct]) -> GroupStatistics | None:
    coders = list(dict.fromkeys(name for act in acts for name in act.marks))
    if len(coders) < 2:
        return None
    pairs = []
    for first, second in combinations(coders, 2):
        both = [(act.marks[first], act.marks[second]) for act in acts if first in act.marks and second in act.marks]
        if both:
            pairs.append(_pair(first, second, both, []))
    return GroupStatistics(
        group=ALL,
        units=sum(len(act.marks) > 1 for act in acts),
        alpha=krippendorff_alpha([[act.marks.get(name) for name in coders] for act in acts]),
        icc=Estimate(),
        pairs=tuple(pairs),
    )
