"""Counts how balanced the rows of a plan are, whatever method made them."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Sequence
from itertools import pairwise

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.base.text import pluralize
from rise_engine.study.model import Slot, Study
from rise_engine.study.plan import cells, condition_name, make_plan, runs, strata_of, stratum_name

_FEW = 8
"""Maximum number of numbers that a line lists in full."""


class Counts(Struct, frozen=True):
    """How often each of several names occurs in a list of rows."""

    counts: dict[str, int]
    equal_after: tuple[int, ...]
    """The numbers of rows after which all have occurred equally often."""
    largest_difference: int
    """The largest difference between the most and the least frequent name after any row."""

    @property
    def is_equal(self) -> bool:
        """Whether all names occur equally often in the end."""
        return len(set(self.counts.values())) <= 1


class OrderBalance(Struct, frozen=True):
    """The balance of the orders of runs within one cell of one stratum."""

    stratum: str
    cell: str
    rows: int
    positions: Counts
    """Counts of `run at place`."""
    carry_over: Counts
    """Counts of `run after run`."""


class StratumBalance(Struct, frozen=True):
    """The balance of the cells of one stratum."""

    stratum: str
    rows: int
    cells: Counts


class Balance(Struct, frozen=True):
    """How balanced a plan is."""

    strata: tuple[StratumBalance, ...]
    orders: tuple[OrderBalance, ...]
    lines: tuple[str, ...]
    """The same in sentences, including what is not balanced."""


def prove_balance(study: Study, slots: Sequence[Slot]) -> Balance:
    """Count how often cells, places and pairs of runs occur in a plan.

    :param study: the study, which defines the cells, runs and strata.
    :param slots: the plan.
    """
    strata: list[StratumBalance] = []
    orders: list[OrderBalance] = []
    names = [condition_name(cell) for cell in cells(study)]
    each = runs(study)
    drawn_later = study.assignment.between == "minimise"
    for values in strata_of(study):
        stratum = stratum_name(values)
        rows = [slot for slot in slots if slot.strata == values]
        if not drawn_later:
            counted = count_rows([[condition_name(slot.levels)] for slot in rows], names)
            strata.append(StratumBalance(stratum, len(rows), counted))
        for cell in ["", *names] if drawn_later else names:
            within = [slot for slot in rows if condition_name(slot.levels) == cell]
            if len(each) > 1 and (within or not drawn_later):
                orders.append(_order_balance(stratum, cell, within, each))
    return Balance(tuple(strata), tuple(orders), tuple(_lines(study, strata, orders, slots)))


def block_problems(study: Study, slots: Sequence[Slot]) -> list[str]:
    """Explain why the cells will be less balanced than possible when `n` participants are complete. Only blocks are
    checked. Strata are assumed to have equal numbers, rounded down to whole ones.

    :param study: the study.
    :param slots: its plan.
    :return: sentences without a full stop.
    """
    names = [condition_name(cell) for cell in cells(study)]
    if study.assignment.between != "blocks" or len(names) < 2:
        return []
    found: list[str] = []
    every = strata_of(study)
    expected = study.n // len(every)
    within = f"{expected} in each of the {len(every)} strata" if len(every) > 1 else f"n = {expected}"
    if len(every) > 1 and expected % len(names):
        found.append(
            f"with {within} and {len(names)} cells, some cells have one more: n would have to be a multiple of "
            f"{len(every) * len(names)}"
        )
    for values in every:
        rows = [slot for slot in slots if slot.strata == values][:expected]
        counts = count_rows([[condition_name(slot.levels)] for slot in rows], names).counts
        most, least = max(counts, key=lambda name: counts[name]), min(counts, key=lambda name: counts[name])
        if len(rows) == expected and counts[most] - counts[least] > bool(expected % len(names)):
            blocks = " or ".join(str(size * len(names)) for size in sorted(set(study.assignment.block)))
            where = f" for {stratum_name(values)}" if len(every) > 1 else ""
            found.append(
                f"with {within} and {len(names)} cells, blocks of {blocks} do not come out even{where}: among the "
                f"first {expected} rows {most} comes {_times(counts[most])}, and {least} {_times(counts[least])}. "
                "With block = [1] they do"
            )
    return found


def with_blocks_that_fit(study: Study) -> Study:
    """Return the study with blocks of one or two of each cell, so that nobody can predict a block's last cell. If these
    are uneven at `n`, or few of them fit, each cell comes once in a block."""
    room = study.n // len(strata_of(study)) >= 4 * len(cells(study))
    for block in ((1, 2), (1, 1, 2)) if room else ():
        tried = replace(study, assignment=replace(study.assignment, block=block))
        if not block_problems(tried, make_plan(tried)):
            return tried
    return replace(study, assignment=replace(study.assignment, block=(1,)))


def _times(number: int) -> str:
    return {0: "never", 1: "once", 2: "twice"}.get(number, f"{number} times")


def _order_balance(stratum: str, cell: str, rows: Sequence[Slot], each: Sequence[str]) -> OrderBalance:
    places = [[f"{run} at {at}" for at, run in enumerate(slot.order, start=1)] for slot in rows]
    pairs = [[f"{after} after {before}" for before, after in pairwise(slot.order)] for slot in rows]
    return OrderBalance(
        stratum=stratum,
        cell=cell,
        rows=len(rows),
        positions=count_rows(places, [f"{run} at {at}" for run in each for at in range(1, len(each) + 1)]),
        carry_over=count_rows(
            pairs, [f"{after} after {before}" for before in each for after in each if after != before]
        ),
    )


def count_rows(rows: Iterable[Sequence[str]], known: Iterable[str]) -> Counts:
    """Count how often each of `known` occurs in the rows, and after which rows all have occurred equally often.

    >>> count_rows([["a"], ["b"], ["b"], ["a"], ["a"]], ["a", "b"]).equal_after
    (2, 4)
    """
    counts: dict[str, int] = dict.fromkeys(known, 0)
    equal_after: list[int] = []
    largest = 0
    for number, row in enumerate(rows, start=1):
        for name in row:
            counts[name] = counts.get(name, 0) + 1
        least, most = min(counts.values()), max(counts.values())
        largest = max(largest, most - least)
        if least == most:
            equal_after.append(number)
    return Counts(counts, tuple(equal_after), largest)


def _lines(
    study: Study, strata: Sequence[StratumBalance], orders: Sequence[OrderBalance], slots: Sequence[Slot]
) -> Iterable[str]:
    made = {"blocks": "in permuted blocks", "minimise": "by minimisation", "random": "by chance", "list": "as a list"}
    yield f"{pluralize(len(slots), 'slot')} for {study.n} complete participants, {made[study.assignment.between]}"
    cell_number = len(cells(study))
    if study.assignment.between == "minimise":
        yield (
            "The cell is chosen when somebody takes a slot: four times out of five, the one that makes the cells "
            "differ least. `study status` counts the result."
        )
    elif cell_number > 1:
        yield from _cell_lines(study, strata, slots)
    else:
        yield "There is no between factor: everybody gets the same."
    if orders:
        yield from _order_lines(study, orders)


def _cell_lines(study: Study, strata: Sequence[StratumBalance], slots: Sequence[Slot]) -> Iterable[str]:
    for stratum in strata:
        counts = stratum.cells
        where = f"{stratum.stratum}: " if stratum.stratum else ""
        listed = ", ".join(f"{name} {count}" for name, count in counts.counts.items())
        yield f"{where}{pluralize(stratum.rows, 'row')}: {listed}"
        if not stratum.rows:
            yield "  NO ROWS: no participant of this stratum can take part"
            continue
        if not counts.equal_after:
            yield "  NOT BALANCED: the cells are equally full after no row"
            continue
        between = f"between, they differ by at most {counts.largest_difference}"
        yield f"  equally full after {_numbers(counts.equal_after)} rows; {between}"
        if not counts.is_equal:
            difference = max(counts.counts.values()) - min(counts.counts.values())
            yield f"  NOT BALANCED: at the end they differ by {difference}"
    number, rest = len(cells(study)), study.n % len(cells(study))
    if rest and len(strata) < 2:  # the sizes of the strata decide which cells are fuller
        yield f"n = {study.n} is not a multiple of the {number} cells: {rest} of them will have one more."
    yield from (f"NOTE: {problem}." for problem in block_problems(study, slots))
    if len(strata) > 1:
        most = sum(stratum.cells.largest_difference for stratum in strata)
        yield (
            f"Each stratum is balanced on its own, however many participants it will have. Over all {len(strata)} "
            f"strata the cells differ by at most {most}."
        )


def _order_lines(study: Study, orders: Sequence[OrderBalance]) -> Iterable[str]:
    each = len(runs(study))
    yield f"Orders of {each} runs ({study.assignment.within}):"
    for key, group in _alike(orders):
        positions, carry_over, rows = key
        yield f"  {group}: {pluralize(rows, 'row')}"
        yield f"    {_order_sentence('every run is equally often at every place', positions)}"
        yield f"    {_order_sentence('every run follows every other one equally often', carry_over)}"
    yield from _last_set_lines(study, orders)
    if study.assignment.within == "fixed":
        yield "  Everybody has the same order, so its effect cannot be separated from that of the factor."
    if study.assignment.within == "random":
        yield "  Orders are drawn for each participant alone: they are balanced in the long run only."


def _last_set_lines(study: Study, orders: Sequence[OrderBalance]) -> Iterable[str]:
    """Warn if the last set of orders is incomplete when `n` are complete, where this can be predicted."""
    cell_number = len(cells(study))
    in_cell, rest = divmod(study.n, cell_number)
    if (
        len(strata_of(study)) > 1
        or rest
        or len(orders) != cell_number
        or study.assignment.within in ("fixed", "random")
    ):
        return
    if any(order.rows >= in_cell and in_cell not in order.positions.equal_after for order in orders):
        where = f"with {in_cell} in each cell" if cell_number > 1 else f"with {in_cell}"
        yield f"  At n = {study.n}, {where}, the last set of orders is not complete: places differ by at most one set."


def _alike(orders: Sequence[OrderBalance]) -> list[tuple[tuple[tuple[int, ...], tuple[int, ...], int], str]]:
    """Group the cells with the same results: each result with the names of its cells."""
    groups: dict[tuple[tuple[int, ...], tuple[int, ...], int], list[str]] = {}
    for order in orders:
        key = (order.positions.equal_after, order.carry_over.equal_after, order.rows)
        groups.setdefault(key, []).append(" ".join(part for part in (order.stratum, order.cell) if part))
    total = len(orders)
    return [
        (
            key,
            ("all rows" if total == 1 else f"in each of the {total} cells")
            if len(names) == total
            else ", ".join(names),
        )
        for key, names in groups.items()
    ]


def _order_sentence(what: str, equal_after: tuple[int, ...]) -> str:
    return f"{what} after {_numbers(equal_after)} rows" if equal_after else f"NOT BALANCED: at no row {what}"


def _numbers(numbers: Sequence[Hashable]) -> str:
    """List numbers: `2, 4, 6 ... 30`."""
    if len(numbers) <= _FEW:
        *rest, last = map(str, numbers)
        return f"{', '.join(rest)} and {last}" if rest else last
    return f"{', '.join(map(str, numbers[: _FEW - 1]))}, ..., {numbers[-1]}"
