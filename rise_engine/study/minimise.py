"""Minimisation after Pocock and Simon (1975): the cell of a participant is found when they take their slot."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from rise_engine.study.chance import Chance
from rise_engine.study.design import cells
from rise_engine.study.model import Slot, Study

BEST_OUT_OF = (4, 5)
"""How often the cell that balances best is taken. Always would mean that whoever knows the others can foretell it."""


def cell_for(
    study: Study,
    taken_so_far: Sequence[tuple[Mapping[str, str], Mapping[str, str]]],
    strata: Mapping[str, str],
    slot: Slot,
) -> dict[str, str]:
    """The levels of the between factors for somebody who takes a slot now.

    For each cell it is asked how unequal the cells would be if this participant came into it: over all who have their
    values, column by column, and over everybody; unequal means the largest count less the smallest. Of the cells where
    the sum is smallest one is drawn, four times out of five; otherwise one of the rest. The same arguments give the
    same cell.

    :param study: the study, whose method is `minimise`.
    :param taken_so_far: strata and levels of everybody who holds a slot and counts, in any order.
    :param strata: those of the participant.
    :param slot: the row that they take; its seed is where the chance comes from.
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
    takes_best = chance.integer_below(BEST_OUT_OF[1]) < BEST_OUT_OF[0]
    return dict(chance.choose(best if takes_best or not rest else rest))
