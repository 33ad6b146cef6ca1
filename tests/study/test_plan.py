"""Plans: balanced after every complete block, balanced orders, the same on every Python, and right after dropouts."""

from __future__ import annotations

import random
from collections import Counter
from collections.abc import Sequence
from hashlib import sha256
from itertools import pairwise
from math import ceil
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from rise_engine.study.balance import block_problems, prove_balance, with_blocks_that_fit
from rise_engine.study.chance import Chance, latin, order_set, session_seed, williams
from rise_engine.study.model import Slot, Study, WithinMethod
from rise_engine.study.plan import (
    cell_for,
    cells,
    condition_name,
    make_plan,
    parse_condition,
    planned_run,
    runs,
    runs_of,
    strata_of,
    stratum_name,
)
from rise_engine.study.plan_file import plan_text
from rise_engine.study.review import review_study
from tests.chance import examples
from tests.study.designs import make_study
from tests.study.studies import DESIGN, write_study

SIZES = st.integers(2, 3)
STUDIES = st.builds(
    make_study,
    st.lists(SIZES, max_size=3),
    st.lists(SIZES, max_size=2),
    n=st.integers(1, 40),
    seed=st.integers(0, 2**53),
    strata=st.lists(SIZES, max_size=2),
    block=st.lists(st.integers(1, 3), min_size=1, max_size=3).map(tuple),
    orders=st.sampled_from(["williams", "latin", "fixed", "random"]),
    spare=st.sampled_from([0.0, 0.1, 0.25, 1.0]),
)


def block_sizes(study: Study, stratum: str) -> list[int]:
    """How many rows the blocks of a stratum have, drawn once more."""
    sizes: list[int] = []
    wanted = ceil(round(study.n * (1 + study.assignment.spare), 6))
    while sum(sizes) < wanted:
        drawn = Chance(study.seed, "block size", stratum, len(sizes)).choose(study.assignment.block)
        sizes.append(drawn * len(cells(study)))
    return sizes


@given(STUDIES)
def test_every_complete_block_is_balanced(study: Study) -> None:
    """In every stratum, every block has every cell equally often; and there are rows for all and the spare ones."""
    plan = make_plan(study)
    assert [slot.slot for slot in plan] == list(range(1, len(plan) + 1))
    names = sorted(condition_name(cell) for cell in cells(study))
    seen = 0
    for strata in strata_of(study):
        rows = [slot for slot in plan if slot.strata == strata]
        seen += len(rows)
        at = 0
        for size in block_sizes(study, stratum_name(strata)):
            counted = Counter(condition_name(slot.levels) for slot in rows[at : at + size])
            assert sorted(counted) == names
            assert len(set(counted.values())) == 1
            at += size
        assert at == len(rows)
    assert seen == len(plan)


@given(STUDIES)
def test_orders_are_balanced_within_each_cell(study: Study) -> None:
    """Every whole set of orders in a cell has every run equally often at every place; Williams also every pair."""
    method = study.assignment.within
    each = runs(study)
    assert all(sorted(slot.order) == sorted(each) for slot in make_plan(study))
    if method == "random":
        return
    whole = len(order_set(method, len(each)))
    groups: dict[tuple[str, str], list[Slot]] = {}
    for slot in make_plan(study):
        groups.setdefault((stratum_name(slot.strata), condition_name(slot.levels)), []).append(slot)
    for rows in groups.values():
        for at in range(0, len(rows) - whole + 1, whole):
            orders = [slot.order for slot in rows[at : at + whole]]
            if method != "fixed":
                for place in range(len(each)):
                    assert set(Counter(order[place] for order in orders).values()) == {whole // len(each)}
            if method == "williams" and len(each) > 1:
                assert len(set(pair_counts(orders).values())) == 1
                assert len(pair_counts(orders)) == len(each) * (len(each) - 1)


@pytest.mark.parametrize(
    ("n", "spare", "rows"), [(10, 0.1, 11), (10, 0.0, 10), (24, 0.25, 30), (7, 0.25, 9), (3, 2.0, 9)]
)
def test_spare_rows_are_no_more_than_was_asked_for(n: int, spare: float, rows: int) -> None:
    """As people calculate it: a tenth of ten is one, although 10 * 1.1 is more than 11 for a computer."""
    assert len(make_plan(make_study([], n=n, spare=spare))) == rows


def pair_counts(orders: Sequence[Sequence[object]]) -> Counter[tuple[object, object]]:
    return Counter(pair for order in orders for pair in pairwise(order))


@pytest.mark.parametrize("number", range(2, 9))
def test_williams(number: int) -> None:
    """In n rows for an even n and 2n for an odd one, places and neighbours are balanced."""
    rows = williams(number)
    assert len(rows) == (number if number % 2 == 0 else 2 * number)
    assert all(sorted(row) == list(range(number)) for row in rows)
    for place in range(number):
        assert set(Counter(row[place] for row in rows).values()) == {len(rows) // number}
    pairs = pair_counts(rows)
    assert len(pairs) == number * (number - 1)
    assert set(pairs.values()) == {1 if number % 2 == 0 else 2}


@pytest.mark.parametrize("number", range(2, 9))
def test_latin_squares_balance_places_and_not_neighbours(number: int) -> None:
    rows = latin(number)
    assert all(sorted(row[place] for row in rows) == list(range(number)) for place in range(number))
    if number > 2:
        assert len(pair_counts(rows)) == number


@pytest.mark.parametrize(("method", "number"), [("all", 24), ("fixed", 1), ("latin", 4), ("williams", 4)])
def test_sets(method: WithinMethod, number: int) -> None:
    rows = order_set(method, 4)
    assert (len(rows), len(set(rows))) == (number, number)


def test_one_run_is_one_order() -> None:
    assert [order_set(method, 1) for method in ("williams", "latin", "all", "fixed")] == [[(0,)]] * 4


def test_sets_of_one_cell_are_not_all_alike() -> None:
    """Each set has its rows in another order: nobody can guess the next one."""
    plan = make_plan(make_study([], [4], n=16, spare=0))
    sets = [tuple(slot.order for slot in plan[at : at + 4]) for at in range(0, 16, 4)]
    assert len(set(sets)) == 4


STORED = "9ed3cb12c7adac9b438f2a1b914ae955c099b718f6cd036ed8099cf4a5a75549"


def test_the_plan_is_the_same_everywhere() -> None:
    """On every Python and every machine: the hash of large ones, with everything that is drawn (3.11, 3.12, 3.13)."""
    texts = [
        plan_text(study, make_plan(study))
        for study in (
            make_study([2, 3], [3], n=30, seed=20261122, strata=[2, 2], block=(1, 2, 3)),
            make_study([2], [2, 2], n=25, seed=3, method="random", orders="random"),
            make_study([2], [4], n=25, seed=3, strata=[2], method="minimise", orders="latin", spare=0.1),
            make_study([], [4], n=25, seed=3, orders="all"),
        )
    ]
    assert texts[0].startswith("slot,s0,s1,f0,f1,order,seed\n1,v0,v0,")
    assert sha256("".join(texts).encode()).hexdigest() == STORED


# --- people who drop out ----------------------------------------------------------------------------------------------


class Taker:
    """Gives participants slots in the plainest way: the first free row of their stratum."""

    def __init__(self, plan: Sequence[Slot]) -> None:
        self.plan = plan
        self.held: set[int] = set()

    def take(self, strata: dict[str, str]) -> Slot | None:
        row = next((each for each in self.plan if each.strata == strata and each.slot not in self.held), None)
        if row is not None:
            self.held.add(row.slot)
        return row

    def holes(self, strata: dict[str, str]) -> int:
        """Rows that were given back and stand before one that is held."""
        rows = [each.slot in self.held for each in self.plan if each.strata == strata]
        return rows[: max((at for at, held in enumerate(rows, start=1) if held), default=0)].count(False)

    def difference(self, study: Study, strata: dict[str, str]) -> int:
        counts = Counter(
            condition_name(row.levels) for row in self.plan if row.slot in self.held and row.strata == strata
        )
        each = [counts[condition_name(cell)] for cell in cells(study)]
        return max(each) - min(each)


@pytest.mark.parametrize("seed", range(5))
def test_cells_stay_within_a_block_whoever_drops_out(seed: int) -> None:
    """Many dropouts over five studies: lost slots are given first, then no two cells differ by more than a block."""
    study = make_study([2, 2], n=24, seed=seed, strata=[2], block=(1, 2))
    taker = Taker(make_plan(study))
    rng = random.Random(seed)
    dropouts = full = 0
    while dropouts < examples(2000):
        strata = rng.choice(strata_of(study))
        if rng.random() < 0.55:
            full += taker.take(strata) is None
        elif taker.held:
            taker.held.remove(rng.choice(sorted(taker.held)))
            dropouts += 1
        for each in strata_of(study):
            assert taker.difference(study, each) <= max(study.assignment.block) + taker.holes(each)
    assert full > 0, "also the last row was taken"
    for strata in strata_of(study):
        for _ in range(taker.holes(strata)):
            taker.take(strata)
        assert taker.difference(study, strata) <= max(study.assignment.block)


def test_minimisation_balances_every_column() -> None:
    """Over many studies, cells differ little within each value of each column; by chance they would by far more."""
    worst = 0
    for seed in range(20):
        study = make_study([2], n=48, seed=seed, strata=[2, 3], method="minimise")
        rng = random.Random(seed)
        taken: list[tuple[dict[str, str], dict[str, str]]] = []
        for slot in make_plan(study):
            strata = {column: rng.choice(values) for column, values in study.strata.items()}
            levels = cell_for(study, taken, strata, slot)
            assert levels == cell_for(study, list(reversed(taken)), strata, slot), "the same cell, in whatever order"
            taken.append((strata, levels))
        for column, values in study.strata.items():
            for value in values:
                counted = Counter(levels["f0"] for strata, levels in taken if strata[column] == value)
                worst = max(worst, abs(counted["a0"] - counted["b0"]))
    assert worst <= 6


def test_minimisation_takes_the_emptier_cell_four_times_out_of_five() -> None:
    study = make_study([2], n=48, method="minimise")
    taken: list[tuple[dict[str, str], dict[str, str]]] = [({}, {"f0": "a0"})]
    drawn = Counter(
        cell_for(study, taken, {}, slot)["f0"] for slot in make_plan(make_study([2], n=2000, method="minimise"))
    )
    assert 0.77 < drawn["b0"] / drawn.total() < 0.83


# --- a new plan while slots are held ----------------------------------------------------------------------------------


@given(STUDIES, st.integers(0, 30), st.integers(1, 20))
def test_held_rows_stay_and_their_blocks_are_completed(study: Study, number: int, more: int) -> None:
    """More participants are wanted: who holds a row keeps it, and the rest completes the blocks."""
    before = make_plan(study)
    rng = random.Random(number)
    held = tuple(sorted(rng.sample(before, min(number, len(before))), key=lambda slot: slot.slot))
    first = max((slot.slot for slot in held), default=0) + 1
    larger = replace(study, n=study.n + more)
    plan = make_plan(larger, held, first)
    assert [slot for slot in plan if slot.slot < first] == sorted(held, key=lambda slot: plan.index(slot))
    assert len({slot.slot for slot in plan}) == len(plan)
    fresh = make_plan(larger)
    for strata in strata_of(study):
        rows = [condition_name(slot.levels) for slot in plan if slot.strata == strata]
        kept = Counter(condition_name(slot.levels) for slot in held if slot.strata == strata)
        wanted = Counter(condition_name(slot.levels) for slot in fresh if slot.strata == strata)
        assert Counter(rows) == wanted | kept
        assert rows[: kept.total()] == [condition_name(slot.levels) for slot in held if slot.strata == strata]


def test_completed_blocks_after_some_are_held() -> None:
    """Of an example by hand: two cells in blocks of two; three rows are held; the fourth completes the second block."""
    study = make_study([2], n=8, spare=0)
    held = make_plan(study)[:3]
    plan = make_plan(study, held, 10)
    assert plan[:3] == held
    assert [slot.slot for slot in plan[3:]] == [10, 11, 12, 13, 14]
    counted = Counter(condition_name(slot.levels) for slot in plan[:4])
    assert set(counted.values()) == {2}


# --- what a slot means ------------------------------------------------------------------------------------------------


def test_runs_of_a_slot() -> None:
    study = make_study([2], [2, 2], seed=11)
    slot = Slot(5, {}, {"f0": "b0"}, ("b1+a2", "a1+a2", "b1+b2", "a1+b2"), 99)
    sessions = runs_of(study, slot)
    assert [(each.slot, each.run, each.condition) for each in sessions] == [
        (5, 1, "b0+b1+a2"),
        (5, 2, "b0+a1+a2"),
        (5, 3, "b0+b1+b2"),
        (5, 4, "b0+a1+b2"),
    ]
    assert sessions[1].factors == {"f0": "b0", "f1": "a1", "f2": "a2"}
    assert [each.seed for each in sessions] == [session_seed(11, 5, run) for run in (1, 2, 3, 4)]


def test_a_slot_without_its_cell_has_no_runs_yet() -> None:
    study = make_study([2], method="minimise")
    slot = make_plan(study)[0]
    with pytest.raises(ValueError, match="slot 1 has no level of `f0` yet"):
        runs_of(study, slot)
    assert [each.condition for each in runs_of(study, slot, {"f0": "b0"})] == ["b0"]


def test_a_study_without_factors_has_one_session() -> None:
    (slot, *_) = make_plan(make_study([]))
    (only,) = runs_of(make_study([]), slot)
    assert (only.condition, only.factors, only.memory, only.scenario) == ("", {}, {}, "/nowhere/scenario")


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a0", r"`a0` is not a condition: name a level of each factor \(`f0`, `f1`\), as in a0\+a1"),
        ("a0+b11", "`f1` has no level `b11`; did you mean `b1`"),
        ("", "`` is not a condition"),
    ],
)
def test_conditions_that_are_none(text: str, problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        parse_condition(make_study([2], [2]), text)


def test_conditions_by_name() -> None:
    study = make_study([2], [2])
    assert parse_condition(study, "b0+a1") == {"f0": "b0", "f1": "a1"}
    assert planned_run(study, parse_condition(study, "b0+a1")).condition == "b0+a1"


# --- the proof --------------------------------------------------------------------------------------------------------


def test_the_proof_counts_what_is_there() -> None:
    """Of rows that nobody made in a balanced way."""
    study = make_study([2], [2], n=4)
    rows = [("a0", "a1 b1"), ("a0", "a1 b1"), ("b0", "a1 b1"), ("b0", "b1 a1"), ("a0", "b1 a1")]
    plan = [Slot(at, {}, {"f0": cell}, tuple(order.split()), 0) for at, (cell, order) in enumerate(rows, start=1)]
    balance = prove_balance(study, plan)
    (stratum,) = balance.strata
    assert stratum.cells.counts == {"a0": 3, "b0": 2}
    assert (stratum.cells.equal_after, stratum.cells.largest_difference) == ((4,), 2)
    of_a, of_b = balance.orders
    assert of_a.positions.counts == {"a1 at 1": 2, "a1 at 2": 1, "b1 at 1": 1, "b1 at 2": 2}
    assert (of_a.positions.equal_after, of_b.positions.equal_after) == ((), (2,))
    assert of_b.carry_over.counts == {"b1 after a1": 1, "a1 after b1": 1}
    text = "\n".join(balance.lines)
    assert "NOT BALANCED: at the end they differ by 1" in text
    assert "a0: 3 rows\n    NOT BALANCED: at no row every run is equally often at every place" in text


@pytest.mark.parametrize(
    ("study", "line"),
    [
        (make_study([2], n=7), "n = 7 is not a multiple of the 2 cells: 1 of them will have one more."),
        (
            make_study([], [5], orders="latin"),
            "NOT BALANCED: at no row every run follows every other one equally often",
        ),
        (make_study([], [3], orders="fixed"), "Everybody has the same order"),
        (make_study([], [3], orders="random"), "Orders are drawn for each participant alone"),
        (make_study([2], [3], n=8), "At n = 8, with 4 in each cell, the last set of orders is not complete"),
        (make_study([2], n=8, method="minimise"), "The cell is chosen when somebody takes a slot"),
        (make_study([2], n=8, strata=[2]), "Each stratum is balanced on its own"),
        (make_study([]), "There is no between factor: everybody gets the same."),
        (
            make_study([2, 2], n=4, block=(2,)),
            "NOTE: with n = 4 and 4 cells, blocks of 8 do not come out even: among the first 4 rows",
        ),
        (make_study([2, 2], n=4, block=(2,)), ". With block = [1] they do."),
        (
            make_study([2, 2], n=8, block=(2,), strata=[2]),
            "NOTE: with 4 in each of the 2 strata and 4 cells, blocks of 8 do not come out even for ",
        ),
        (make_study([3], n=8, strata=[2]), "some cells have one more: n would have to be a multiple of 6."),
    ],
)
def test_the_proof_says_what_is_not_balanced(study: Study, line: str) -> None:
    assert line in "\n".join(prove_balance(study, make_plan(study)).lines)


def test_with_strata_nobody_knows_which_cells_have_one_more() -> None:
    study = make_study([2], n=7, strata=[2])
    assert "will have one more" not in "\n".join(prove_balance(study, make_plan(study)).lines)


@pytest.mark.parametrize(
    ("study", "block"),
    [(make_study([2, 2], n=8, strata=[2]), (1,)), (make_study([2, 2], n=4), (1,)), (make_study([]), (1, 2))],
)
def test_blocks_that_fit_are_proposed(study: Study, block: tuple[int, ...]) -> None:
    assert with_blocks_that_fit(study).assignment.block == block


def test_blocks_that_do_not_fit_are_warned_about_at_the_number_of_participants(tmp_path: Path) -> None:
    write_study(tmp_path, DESIGN.replace("spare = 0.5", "spare = 0.5\nblock = [5]"), plan=False)
    warning, *_ = [each for each in review_study(tmp_path).diagnostics if each.code == "uneven-blocks"]
    line = DESIGN.splitlines().index("n = 4") + 1
    assert (warning.location.file, warning.location.line, warning.location.column) == ("study.toml", line, 5)


@pytest.mark.parametrize("seed", range(1, 9))
def test_proposed_blocks_come_out_even(seed: int) -> None:
    made = with_blocks_that_fit(replace(make_study([2], n=24, strata=[2]), seed=seed))
    assert not block_problems(made, make_plan(made))


@given(STUDIES)
def test_the_proof_finds_every_plan_of_blocks_balanced(study: Study) -> None:
    balance = prove_balance(study, make_plan(study))
    for stratum in balance.strata:
        assert stratum.cells.is_equal
        assert stratum.cells.largest_difference <= max(study.assignment.block)
