"""How the conditions of a study are called on screens: by their names, by the labels of a blinded study, or not at all.
Pure."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import NamedTuple

from rise_engine.study.model import Level, Study

HIDDEN = "hidden until the session begins"
"""Of a condition, where the study says so."""


class Conditions(NamedTuple):
    """Of one study."""

    labels: Mapping[str, str]
    """By the name of each condition: how it is shown. Also those of the between factors alone."""
    hidden: bool = False

    def label(self, condition: str) -> str:
        """How a condition is shown in its session; one that is of no design is shown as it is."""
        return self.labels.get(condition, condition)

    def shown(self, condition: str) -> str:
        """How a condition is shown outside its session: empty in a hidden study."""
        return "" if self.hidden else self.label(condition)


NO_CONDITIONS = Conditions({})


def conditions_of(study: Study) -> Conditions:
    """The conditions of a design, in the order of its factors."""
    every = [factor.levels for factor in study.factors]
    between = [factor.levels for factor in study.factors if factor.kind == "between"]
    labels = {_join(levels, named=True): _join(levels, named=False) for levels in product(*every)}
    for levels in product(*between):
        labels.setdefault(_join(levels, named=True), _join(levels, named=False))
    labels.pop("", None)
    return Conditions(labels, study.assignment.hidden)


def condition_names(study: Study) -> list[str]:
    """Every condition that a session can have, in the order of the design."""
    return [name for levels in product(*(factor.levels for factor in study.factors)) if (name := _join(levels))]


def _join(levels: tuple[Level, ...], *, named: bool = True) -> str:
    return "+".join(level.name if named else level.label or level.name for level in levels)
