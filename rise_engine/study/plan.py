"""The plan of a study: the cell and order of each slot, made once and only read after that."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from math import ceil

from msgspec.structs import replace

from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.model import Json
from rise_engine.study.chance import SEEDS, Chance, make_orders, session_seed
from rise_engine.study.design import cells, condition_name, factors_of, runs, strata_of, stratum_name
from rise_engine.study.model import Factor, PlannedRun, Slot, Study
from rise_engine.study.study_scenarios import scenario_folder, scenario_of


def slot_seed(study: Study, number: int) -> int:
    """Return the seed of a row of the plan, for everything that is drawn for this row only."""
    return Chance(study.seed, "slot", number).integer_below(SEEDS)


def rows_wanted(study: Study) -> int:
    """Return the least number of rows of each stratum: `n` and the spare ones."""
    return ceil(study.n * (1 + Fraction(repr(study.assignment.spare))))


def make_plan(study: Study, held: Sequence[Slot] = (), first: int = 1) -> tuple[Slot, ...]:
    """Make the rows of a study's plan, stratum by stratum. The same study gives the same rows on every Python.

    Each stratum has rows for all `n` participants and the spare ones, because the sizes of strata are unknown. Its last
    block is complete.

    :param study: the study; `between` must not be "list".
    :param held: rows of an earlier plan that participants hold. They come first in their stratum, unchanged, and the
        new rows complete their blocks.
    :param first: the number of the first new row.
    :raises ValueError: people make the plan (`between = "list"`).
    """
    if study.assignment.between == "list":
        raise ValueError('with between = "list", people make plan.csv')
    plan: list[Slot] = []
    number = first
    for strata in strata_of(study):
        kept = [slot for slot in held if slot.strata == strata]
        made = list(_rows(study, strata, first=number))
        for slot in kept:
            _take_away(made, slot)
        plan += kept
        for row in made:
            plan.append(replace(row, slot=number, seed=slot_seed(study, number)))
            number += 1
    if study.assignment.between == "random" or study.assignment.within == "random":
        kept_numbers = {slot.slot for slot in held}
        plan = [slot if slot.slot in kept_numbers else _draw(study, slot) for slot in plan]
    return tuple(plan)


def _rows(study: Study, strata: dict[str, str], first: int) -> Iterator[Slot]:
    """Give the rows of one stratum, numbered from `first`, without what is drawn for each row."""
    name = stratum_name(strata)
    every = cells(study)
    orders: dict[str, Iterator[tuple[str, ...]]] = {}
    for at, levels in enumerate(_cells_in_blocks(study, name, every)):
        cell = condition_name(levels)
        if cell not in orders:
            method = "fixed" if study.assignment.within == "random" else study.assignment.within
            orders[cell] = make_orders(method, runs(study), study.seed, name, cell)
        yield Slot(first + at, strata, levels, next(orders[cell]), 0)


def _cells_in_blocks(study: Study, stratum: str, every: list[dict[str, str]]) -> Iterator[dict[str, str]]:
    """Give a cell for each row of a stratum, up to the end of a block."""
    wanted = rows_wanted(study)
    if study.assignment.between != "blocks":
        yield from ({} for _ in range(wanted))
        return
    made = number = 0
    while made < wanted:
        size = Chance(study.seed, "block size", stratum, number).choose(study.assignment.block)
        block = Chance(study.seed, "block", stratum, number).shuffle(every * size)
        yield from block
        made += len(block)
        number += 1


def _draw(study: Study, slot: Slot) -> Slot:
    """Return the row with what is drawn for it alone."""
    levels, order = slot.levels, slot.order
    if study.assignment.between == "random":
        levels = Chance(slot.seed, "cell").choose(cells(study))
    if study.assignment.within == "random":
        order = tuple(Chance(slot.seed, "order").shuffle(runs(study)))
    return replace(slot, levels=levels, order=order)


def _take_away(rows: list[Slot], held: Slot) -> None:
    """Remove the row that a held one replaces: one of the same cell, and of the same order if possible."""
    same_cell = [row for row in rows if row.levels == held.levels] or rows[:1]
    if same_cell:
        rows.remove(next((row for row in same_cell if row.order == held.order), same_cell[0]))


def runs_of(study: Study, slot: Slot, levels: Mapping[str, str] | None = None) -> tuple[PlannedRun, ...]:
    """Return the sessions of the participant with this slot, in their order.

    :param study: the study.
    :param slot: the row.
    :param levels: the between levels, if the row has none (`minimise`).
    :raises ValueError: neither the row nor `levels` has a level for a between factor.
    """
    between = dict(levels if levels is not None else slot.levels)
    missing = [factor.name for factor in factors_of(study, "between") if factor.name not in between]
    if missing:
        raise ValueError(f"slot {slot.slot} has no level of {in_backquotes(missing)} yet: it is drawn when it is taken")
    within = [factor.name for factor in factors_of(study, "within")]
    return tuple(
        planned_run(
            study,
            {**between, **dict(zip(within, combined.split("+"), strict=True))} if within else between,
            slot=slot.slot,
            run=number,
        )
        for number, combined in enumerate(slot.order, start=1)
    )


def planned_run(study: Study, levels: Mapping[str, str], *, slot: int = 0, run: int = 1) -> PlannedRun:
    """Return one session in these levels.

    :param study: the study.
    :param levels: one level of each factor, by factor.
    :param slot: the session's slot; 0 for a session without one.
    :param run: the number of the session in the slot.
    """
    factors = {factor.name: levels[factor.name] for factor in study.factors}
    memory: dict[str, Json] = {}
    for factor in study.factors:
        level = next(level for level in factor.levels if level.name == factors[factor.name])
        memory.update(level.memory)
    return PlannedRun(
        slot=slot,
        run=run,
        factors=factors,
        condition=condition_name(factors),
        memory=memory,
        scenario=scenario_folder(study, scenario_of(study, factors)),
        seed=session_seed(study.seed, slot, run),
    )


def parse_condition(study: Study, text: str) -> dict[str, str]:
    """Split a condition's name into its levels, one of each factor, in their order, joined by `+`.

    :raises ValueError: it is not a condition of this study; the text names the possible ones.
    """
    parts = text.split("+") if text else []
    if len(parts) != len(study.factors):
        example = "+".join(factor.levels[0].name for factor in study.factors)
        what = f"a level of each factor ({in_backquotes(factor.name for factor in study.factors)}), as in {example}"
        raise ValueError(
            f"`{text}` is not a condition: name {what}" if study.factors else "this study has no conditions"
        )
    for factor, part in zip(study.factors, parts, strict=True):
        names = _level_names(factor)
        if part not in names:
            raise ValueError(f"`{factor.name}` has no level `{part}`{did_you_mean(part, names)}")
    return {factor.name: part for factor, part in zip(study.factors, parts, strict=True)}


def _level_names(factor: Factor) -> list[str]:
    return [level.name for level in factor.levels]
