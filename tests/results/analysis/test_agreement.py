"""How far people agree: against published data sets, against libraries, and by what must always hold.

Numbers of libraries were computed once, with scikit-learn 1.7, statsmodels 0.14, krippendorff 0.9.0 and pingouin 0.7.0
(the last two are GPL-3.0, and no dependency); data and number stand here side by side.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.results.analysis.agreement import (
    cohen_kappa,
    f_quantile,
    icc_a1,
    krippendorff_alpha,
    limits_of_agreement,
    percent_agreement,
)

SIX = 5e-7
"""Six places."""


def cells(table: Sequence[Sequence[int]]) -> list[tuple[int, int]]:
    """The pairs of a table of counts."""
    return [
        (row, column) for row, counts in enumerate(table) for column, count in enumerate(counts) for _ in range(count)
    ]


# Three wizards, forty cues: p, r, h, m are four acts, - is a cue that was not shown.
ANNA = "hrmppphprppmmprpmpprpmprprhmrphrprhppprm"
BEN = "mmmpprhprppmmprpmpphpmpphrhmmphrprhpprmm"
CARL = "prmppphpmrpmmprpmpprpmmrprhmmphrprhppmrm"
BEN_PART = "mmmpp-hprppmmprp-pphpmpphrh-mphrprhppr-m"
CARL_PART = "prm-pphpmr-mmprpm-prpmmr-rhmmph-prhppm-m"
TIMES_ANNA = (
    "0.92 0.95 0.58 1.67 1.89 1.1 1.13 0.53 0.55 0.91 0.8 1.64 0.64 0.43 1.83 1.19 0.62 1.21 0.44 1.19 1.87 1.69 "
)
TIMES_ANNA += "1.44 0.79 0.95"
TIMES_BEN = (
    "1.21 1.37 0.36 1.72 1.94 1.34 1.47 0.11 0.89 0.74 1.06 1.46 0.8 0.79 1.92 1.35 0.9 1.36 0.54 1.62 2.2 1.75 "
)
TIMES_BEN += "2.11 0.68 1.25"
TIMES_CARL = (
    "0.79 0.94 0.74 1.69 2.03 0.59 0.63 0.66 0.21 0.55 0.31 1.97 0.81 0.82 1.5 1.14 0.23 1.39 0.87 0.87 2.29 1.94 "
)
TIMES_CARL += "1.34 0.15 1.32"

JUDGES = [(9, 2, 5, 8), (6, 1, 3, 2), (8, 4, 6, 8), (7, 1, 2, 6), (10, 5, 6, 9), (6, 2, 4, 7)]
"""Four judges, six targets: Shrout and Fleiss 1979, table 2."""

RELIABILITY: list[tuple[int | None, ...]] = list(
    zip(
        (1, 2, 3, 3, 2, 1, 4, 1, 2, None, None, None),
        (1, 2, 3, 3, 2, 2, 4, 1, 2, 5, None, 3),
        (None, 3, 3, 3, 2, 3, 4, 2, 2, 5, 1, None),
        (1, 2, 3, 3, 2, 4, 4, 1, 2, 5, 1, None),
        strict=True,
    )
)
"""Four observers, twelve units, values missing: Krippendorff, "Computing Krippendorff's Alpha-Reliability", 2011."""


def units(*raters: str) -> list[tuple[str | None, ...]]:
    return [tuple(None if each == "-" else each for each in unit) for unit in zip(*raters, strict=True)]


def times(text: str) -> list[float]:
    return [float(each) for each in text.split()]


# --- kappa ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("table", "kappa", "error"),
    [
        # Cohen 1960, table 1, of 200 diagnoses; its error by statsmodels.
        ([[88, 14, 18], [10, 40, 10], [2, 6, 12]], 0.491525, 0.051002),
        # The example of Fleiss, Cohen and Everitt 1969, of 200: kappa 0.429, variance 0.002885.
        ([[106, 10, 4], [22, 28, 10], [2, 12, 6]], 0.428571, 0.053711),
        ([[20, 5], [10, 15]], 0.4, 0.126996),
    ],
)
def test_kappa_and_its_error_are_those_of_the_literature(table: list[list[int]], kappa: float, error: float) -> None:
    found = cohen_kappa(cells(table))
    assert found.value == pytest.approx(kappa, abs=SIX)
    assert found.error == pytest.approx(error, abs=SIX)


def test_kappa_is_that_of_scikit_learn_and_its_error_that_of_statsmodels() -> None:
    found = cohen_kappa(list(zip(ANNA, BEN, strict=True)))
    assert found.value == pytest.approx(0.682819, abs=SIX)
    assert found.error == pytest.approx(0.089688, abs=SIX)
    assert found.n == 40
    assert found.low == pytest.approx(0.682819 - 1.959964 * 0.089688, abs=2e-6)


def test_two_who_agree_as_chance_has_it_have_a_kappa_of_nothing() -> None:
    assert cohen_kappa(cells([[4, 2], [2, 1]])).value == pytest.approx(0.0, abs=1e-12)


def test_two_who_always_contradict_each_other_lie_below_chance() -> None:
    found = cohen_kappa(cells([[0, 5], [5, 0]]))
    assert found.value == pytest.approx(-1.0)
    assert cohen_kappa(cells([[1, 9], [9, 1]])).low == -1.0


@pytest.mark.parametrize(
    ("pairs", "value", "why"),
    [
        ([("a", "a"), ("b", "b")], 1.0, "no interval: they never differed"),
        ([("a", "a"), ("b", "a"), ("a", "a")], 0.0, "no interval: one of them always chose the same"),
    ],
)
def test_an_error_of_nothing_makes_no_interval(pairs: list[tuple[str, str]], value: float, why: str) -> None:
    found = cohen_kappa(pairs)
    assert found.value == pytest.approx(value, abs=1e-12)
    assert (found.error, found.low, found.high, found.why) == (0.0, None, None, why)


@pytest.mark.parametrize("pairs", [[("a", "a")], [("a", "a")] * 12])
def test_one_category_gives_a_sentence_and_no_number(pairs: list[tuple[str, str]]) -> None:
    for found in (cohen_kappa(pairs), krippendorff_alpha(pairs)):
        assert found.value is None
        assert found.why == (
            "all of them always chose the same (a), so agreement cannot be distinguished from habit: the number "
            "is not defined"
        )


def test_nothing_judged_gives_a_sentence_and_no_number() -> None:
    for found in (
        cohen_kappa([]),
        percent_agreement([]),
        krippendorff_alpha([]),
        krippendorff_alpha([("a", None), (None, "b")]),
        icc_a1([]),
    ):
        assert found.value is None
        assert found.why == "nothing was judged by two of them"
    assert limits_of_agreement([]).why == "nothing was judged by two of them"


# --- alpha ------------------------------------------------------------------------------------------------------------


def test_alpha_is_that_of_krippendorff_himself() -> None:
    assert krippendorff_alpha(RELIABILITY).value == pytest.approx(0.743421, abs=SIX)
    assert krippendorff_alpha(RELIABILITY).n == 11  # the twelfth unit has one value


@pytest.mark.parametrize(
    ("judged", "alpha"),
    [(units(ANNA, BEN), 0.684701), (units(ANNA, BEN, CARL), 0.695412), (units(ANNA, BEN_PART, CARL_PART), 0.716468)],
)
def test_alpha_is_that_of_the_library(judged: list[tuple[str | None, ...]], alpha: float) -> None:
    assert krippendorff_alpha(judged).value == pytest.approx(alpha, abs=SIX)


# --- ICC --------------------------------------------------------------------------------------------------------------


def test_icc_is_that_of_shrout_and_fleiss() -> None:
    found = icc_a1(JUDGES)
    assert found.value == pytest.approx(0.289764, abs=SIX)  # ICC(2,1), printed as .29
    assert found.low == pytest.approx(0.019, abs=5e-4)
    assert found.high == pytest.approx(0.761, abs=5e-4)


@pytest.mark.parametrize(
    ("raters", "icc", "low", "high"),
    [((TIMES_ANNA, TIMES_BEN), 0.849498, 0.58, 0.94), ((TIMES_ANNA, TIMES_BEN, TIMES_CARL), 0.772865, 0.60, 0.88)],
)
def test_icc_and_its_interval_are_those_of_pingouin(
    raters: tuple[str, ...], icc: float, low: float, high: float
) -> None:
    found = icc_a1(list(zip(*map(times, raters), strict=True)))
    assert found.value == pytest.approx(icc, abs=SIX)
    assert found.low == pytest.approx(low, abs=5e-3)
    assert found.high == pytest.approx(high, abs=5e-3)


def test_a_constant_delay_lowers_absolute_agreement() -> None:
    together = [(each, each) for each in times(TIMES_ANNA)]
    later = [(first, second + 0.5) for first, second in together]
    assert icc_a1(together).value == pytest.approx(1.0)
    found = icc_a1(later)
    assert found.value is not None
    assert found.value < 0.8
    assert (found.low, found.high) == (None, None)  # without any other difference there is no interval


def test_no_variance_gives_a_sentence() -> None:
    found = icc_a1([(1.5, 1.5), (1.5, 1.5), (1.5, 1.5)])
    assert (found.value, found.why) == (None, "all values are the same: without variance the number is not defined")
    assert icc_a1([(1.0, 2.0)]).why == "one unit has no variance: at least two are needed"


def test_missing_values_are_no_business_of_icc() -> None:
    with pytest.raises(ValueError, match="a number of every rater"):
        icc_a1([(1.0, 2.0), (1.0,)])


@pytest.mark.parametrize(
    ("above", "below", "value"),
    [(5, 3, 14.884823), (2.5, 7.3, 6.000258), (24, 40.25, 2.004503), (400, 3.5, 10.343309)],  # by scipy
)
def test_quantiles_of_f(above: float, below: float, value: float) -> None:
    assert f_quantile(0.975, above, below) == pytest.approx(value, abs=SIX)


# --- percent, differences ---------------------------------------------------------------------------------------------


def test_percent_has_wilsons_interval() -> None:
    pairs = [("a", "a")] * 29 + [("a", "b")] * 11
    found = percent_agreement(pairs)
    assert found.value == pytest.approx(0.725)
    assert found.low == pytest.approx(0.571650, abs=2 * SIX)  # statsmodels, proportion_confint(method="wilson")
    assert found.high == pytest.approx(0.838920, abs=2 * SIX)


def test_limits_of_agreement() -> None:
    found = limits_of_agreement(list(zip(times(TIMES_ANNA), times(TIMES_BEN), strict=True)))
    assert found.mean == pytest.approx(0.1592, abs=SIX)
    assert found.deviation == pytest.approx(0.243463, abs=SIX)
    assert found.low == pytest.approx(0.1592 - 1.959964 * 0.243463, abs=2e-6)
    assert limits_of_agreement([(1.0, 2.0)]).deviation is None


# --- what must always hold --------------------------------------------------------------------------------------------

categories = st.sampled_from("abcd")
pair_lists = st.lists(st.tuples(categories, categories), min_size=1, max_size=60)
numbers = st.floats(-100, 100, allow_nan=False).map(lambda each: round(each, 3))


def number_rows(raters: int) -> st.SearchStrategy[list[tuple[float, ...]]]:
    return st.lists(st.tuples(*[numbers] * raters), min_size=2, max_size=30)


@given(pair_lists)
def test_kappa_has_bounds_and_needs_no_order(pairs: list[tuple[str, str]]) -> None:
    found = cohen_kappa(pairs)
    swapped = cohen_kappa([(second, first) for first, second in reversed(pairs)])
    renamed = cohen_kappa([("dcba"["abcd".index(a)], "dcba"["abcd".index(b)]) for a, b in pairs])
    if found.value is None:
        assert len({each for pair in pairs for each in pair}) == 1
        return
    assert -1 <= found.value <= 1 + 1e-12
    assert found.error is not None
    assert found.error >= 0
    for other in (swapped, renamed):
        assert other.value == pytest.approx(found.value, abs=1e-9)
        assert other.error == pytest.approx(found.error, abs=1e-6)
    assert (found.value > 1 - 1e-12) == all(a == b for a, b in pairs)


@given(st.lists(st.tuples(*[st.one_of(st.none(), categories)] * 3), max_size=40), st.permutations(range(3)))
def test_alpha_needs_no_order_of_raters_and_is_at_most_one(
    judged: list[tuple[str | None, ...]], order: list[int]
) -> None:
    found = krippendorff_alpha(judged)
    other = krippendorff_alpha([tuple(unit[rater] for rater in order) for unit in reversed(judged)])
    if found.value is None:
        assert found.why
        assert other.value is None
        return
    assert other.value == pytest.approx(found.value, abs=1e-9)
    assert found.value <= 1
    agree = all(len({each for each in unit if each is not None}) <= 1 for unit in judged)
    assert (found.value == 1) == agree


@given(pair_lists)
def test_alpha_of_two_is_kappa_but_for_the_size_of_the_sample(pairs: list[tuple[str, str]]) -> None:
    """With N values dealt out, alpha = 1 - (1 - pi) (N - 1) / N, where pi is Scott's."""
    n = 2 * len(pairs)
    given_ = [each for pair in pairs for each in pair]
    expected = math.fsum((given_.count(each) / n) ** 2 for each in set(given_))
    observed = sum(a == b for a, b in pairs) / len(pairs)
    found = krippendorff_alpha(pairs).value
    if found is not None:
        assert found == pytest.approx(1 - (1 - observed) / (1 - expected) * (n - 1) / n, abs=1e-9)


@given(number_rows(3), st.permutations(range(3)), numbers)
def test_icc_has_bounds_and_needs_neither_order_nor_zero(
    rows: list[tuple[float, ...]], order: list[int], shift: float
) -> None:
    found = icc_a1(rows)
    moved = icc_a1([tuple(row[rater] + shift for rater in order) for row in reversed(rows)])
    if found.value is None or moved.value is None:
        assert found.why or moved.why
        return
    assert found.value <= 1 + 1e-9
    assert moved.value == pytest.approx(found.value, abs=1e-5)


@given(st.lists(numbers, min_size=2, max_size=30))
def test_who_agree_perfectly_have_an_icc_of_one(values: list[float]) -> None:
    found = icc_a1([(each, each) for each in values])
    if len(set(values)) == 1:
        assert found.value is None
    elif found.value is not None:
        assert found.value == pytest.approx(1.0, abs=1e-6)
