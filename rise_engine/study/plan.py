"""A study's cells, runs, strata and hashes, and its plan.

The plan assigns a cell and an order to each slot. It is made once and only read afterwards.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from hashlib import sha256
from itertools import product
from math import ceil

from msgspec import to_builtins
from msgspec.structs import replace

from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.model import Json
from rise_engine.study.chance import SEEDS, Chance, make_orders, session_seed
from rise_engine.study.model import Factor, PlannedRun, Slot, Study
from rise_engine.study.study_scenarios import scenario_folder, scenario_of

PLAN_COLUMNS = ("slot", "order", "seed")
"""Columns that every plan.csv has beside strata and between factors."""
NOT_IN_DESIGN = frozenset({"wizards", "report", "retention", "participants", "questionnaire"})
"""Tables of study.toml that do not affect any session."""


def factors_of(study: Study, kind: str) -> tuple[Factor, ...]:
    """Return the factors of one kind, `between` or `within`, in the order of the file."""
    return tuple(factor for factor in study.factors if factor.kind == kind)


def cells(study: Study) -> list[dict[str, str]]:
    """Return all combinations of between levels, by factor. One empty combination if there is no factor."""
    return _combinations(factors_of(study, "between"))


def runs(study: Study) -> list[str]:
    """Return each participant's runs: combinations of within levels, joined by `+`. No factor: one empty text."""
    return ["+".join(combination.values()) for combination in _combinations(factors_of(study, "within"))]


def strata_of(study: Study) -> list[dict[str, str]]:
    """Return all combinations of the strata within which the plan is balanced. One empty combination if there are none.

    With `minimise` the plan has no strata, because the cell is chosen when somebody takes the slot.
    """
    if study.assignment.between == "minimise":
        return [{}]
    columns = study.assignment.strata
    return [
        dict(zip(columns, values, strict=True))
        for values in product(*(study.strata.get(column, ()) for column in columns))
    ]


def condition_name(levels: dict[str, str]) -> str:
    """Return the name of a condition: its levels joined by `+`.

    >>> condition_name({"hesitation": "yes", "noise": "loud"})
    'yes+loud'
    """
    return "+".join(levels.values())


def stratum_name(strata: dict[str, str]) -> str:
    """Return the name of a stratum, also used for drawing. Empty where there is only one.

    >>> stratum_name({"language": "de", "age": "18-25"})
    'language=de/age=18-25'
    """
    return "/".join(f"{column}={value}" for column, value in strata.items())


def _combinations(factors: tuple[Factor, ...]) -> list[dict[str, str]]:
    names = [factor.name for factor in factors]
    return [
        dict(zip(names, levels, strict=True))
        for levels in product(*([level.name for level in factor.levels] for factor in factors))
    ]


def with_hashes(study: Study, values: Mapping[str, Json]) -> Study:
    """Return the study with the hashes of its file and its design.

    :param values: the values of study.toml.
    """
    return replace(study, hash=content_hash(values), design_hash=design_hash(study))


def content_hash(values: Mapping[str, Json]) -> str:
    """Return the SHA-256 of study.toml without comments, `NOT_IN_DESIGN` and descriptions of levels.

    People may add these after the sessions. So the study.toml of a bundle, which names no wizards, has the same hash.

    :param values: the values of study.toml.
    >>> content_hash({"n": 4, "report": {"story": "Tea"}}) == content_hash({"n": 4}) != content_hash({"n": 5})
    True
    """
    hashed = {name: value for name, value in values.items() if name not in NOT_IN_DESIGN}
    if "factors" in hashed:
        hashed["factors"] = _without_descriptions(hashed["factors"])
    return _hash_of(hashed)


def _without_descriptions(factors: Json) -> Json:
    """Remove the levels' descriptions from `[factors]`."""
    if not isinstance(factors, dict):
        return factors
    plain: dict[str, Json] = {}
    for name, factor in factors.items():
        levels = factor.get("levels") if isinstance(factor, dict) else None
        plain[name] = factor
        if isinstance(factor, dict) and isinstance(levels, dict):
            plain[name] = {**factor, "levels": {level: _plain_level(values) for level, values in levels.items()}}
    return plain


def _plain_level(level: Json) -> Json:
    return {key: value for key, value in level.items() if key != "description"} if isinstance(level, dict) else level


def design_hash(study: Study) -> str:
    """Return the SHA-256 of everything that the plan depends on, without titles, labels and checks."""
    return _hash_of(design_of(study))


def _hash_of(values: Json) -> str:
    text = json.dumps(values, ensure_ascii=False, sort_keys=True, separators=(",", ":"), default=str)  # TOML has dates
    return sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def design_of(study: Study) -> dict[str, Json]:
    """Return what the plan and its conditions depend on, by the keys and tables of study.toml."""
    assignment = to_builtins(study.assignment)
    del assignment["hidden"]
    factors = {
        f"factors.{factor.name}": {
            "place": place,
            "kind": factor.kind,
            "levels": [
                {"name": level.name, "memory": level.memory, "scenario": level.scenario} for level in factor.levels
            ],
        }
        for place, factor in enumerate(study.factors)
    }
    return {
        "seed": study.seed,
        "n": study.n,
        "scenario": study.scenario,
        **factors,
        "assignment": {name: list(value) if isinstance(value, tuple) else value for name, value in assignment.items()},
        "strata": {column: list(study.strata.get(column, ())) for column in study.assignment.strata},
    }


def changed_parts(before: Mapping[str, Json], study: Study) -> list[str]:
    """Return the keys and tables of study.toml in which the design has changed.

    :param before: the earlier result of `design_of`.
    :param study: the study now.
    """
    now = design_of(study)
    return [part for part in dict.fromkeys([*before, *now]) if before.get(part) != now.get(part)]


def slot_seed(study: Study, number: int) -> int:
    """Return the seed of a row of the plan, for everything that is drawn for this row only."""
    return Chance(study.seed, "slot", number).integer_below(SEEDS)


def rows_wanted(study: Study) -> int:
    """Return the minimum number of rows of each stratum: `n` and the spare ones."""
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
            _remove_replaced(made, slot)
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
    """Return the row with the values that are drawn for this row only."""
    levels, order = slot.levels, slot.order
    if study.assignment.between == "random":
        levels = Chance(slot.seed, "cell").choose(cells(study))
    if study.assignment.within == "random":
        order = tuple(Chance(slot.seed, "order").shuffle(runs(study)))
    return replace(slot, levels=levels, order=order)


def _remove_replaced(rows: list[Slot], held: Slot) -> None:
    """Remove a row that a held one replaces: one of the same cell, and of the same order if possible."""
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


# --- minimisation -----------------------------------------------------------------------------------------------------

BEST_CELL_ODDS = (4, 5)
"""How often the best-balancing cell is taken (4 of 5). If always, its choice could be predicted from the others."""


def cell_for(
    study: Study,
    taken_so_far: Sequence[tuple[Mapping[str, str], Mapping[str, str]]],
    strata: Mapping[str, str],
    slot: Slot,
) -> dict[str, str]:
    """Choose the levels of the between factors for a participant who takes a slot now.

    For each cell, compute how unequal the cells would be with this participant in it: once over all participants, and
    once for each stratum column over those with the same value. Inequality is the largest count minus the smallest. One
    of the cells with the smallest sum is drawn four times out of five, otherwise one of the rest. The same arguments
    give the same cell.

    :param study: the study, with the method `minimise`.
    :param taken_so_far: strata and levels of all who hold a slot and count, in any order.
    :param strata: the participant's strata.
    :param slot: the row that they take; its seed is used for the draw.
    """
    every = cells(study)
    groups: list[tuple[str, str] | None] = [None, *((column, strata[column]) for column in study.assignment.strata)]
    totals = [0] * len(every)
    for group in groups:
        counts = Counter(
            tuple(levels.values())
            for others, levels in taken_so_far
            if group is None or others.get(group[0]) == group[1]
        )
        before = [counts[tuple(cell.values())] for cell in every]
        for at in range(len(every)):
            after = [number + (index == at) for index, number in enumerate(before)]
            totals[at] += max(after) - min(after)
    least = min(totals)
    best = [cell for cell, total in zip(every, totals, strict=True) if total == least]
    rest = [cell for cell, total in zip(every, totals, strict=True) if total != least]
    chance = Chance(slot.seed, "minimise")
    takes_best = chance.integer_below(BEST_CELL_ODDS[1]) < BEST_CELL_ODDS[0]
    return dict(chance.choose(best if takes_best or not rest else rest))
