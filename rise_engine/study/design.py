"""What follows from a study's design: its cells, the runs of a participant, its strata, and the hash of it all."""

from __future__ import annotations

import json
from collections.abc import Mapping
from hashlib import sha256
from itertools import product

from msgspec import to_builtins
from msgspec.structs import replace

from rise_engine.scenario.model import Json
from rise_engine.study.model import Factor, Study

PLAN_COLUMNS = ("slot", "order", "seed")
"""Columns that every plan.csv has, beside its strata and between factors."""


def factors_of(study: Study, kind: str) -> tuple[Factor, ...]:
    """The factors of one kind, `between` or `within`, in the order of the file."""
    return tuple(factor for factor in study.factors if factor.kind == kind)


def cells(study: Study) -> list[dict[str, str]]:
    """Every combination of levels of the between factors, by factor; one that is empty where there is none."""
    return _combinations(factors_of(study, "between"))


def runs(study: Study) -> list[str]:
    """What each participant does: every combination of levels of the within factors, joined by `+`; one empty text
    where there is none."""
    return ["+".join(combination.values()) for combination in _combinations(factors_of(study, "within"))]


def strata_of(study: Study) -> list[dict[str, str]]:
    """Every combination of values of the columns within which the plan is balanced; one that is empty without any.

    With `minimise` the plan itself has none: the cell is found when somebody takes the slot.
    """
    if study.assignment.between == "minimise":
        return [{}]
    columns = study.assignment.strata
    return [
        dict(zip(columns, values, strict=True))
        for values in product(*(study.strata.get(column, ()) for column in columns))
    ]


def condition_name(levels: dict[str, str]) -> str:
    """The name of a condition: its levels joined by `+`.

    >>> condition_name({"hesitation": "yes", "noise": "loud"})
    'yes+loud'
    """
    return "+".join(levels.values())


def stratum_name(strata: dict[str, str]) -> str:
    """A stratum for people and for chance; empty where there is only one.

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


def with_hashes(study: Study, data: bytes) -> Study:
    """The study with the hash of its file and that of its design.

    :param data: study.toml.
    """
    return replace(study, hash=sha256(data).hexdigest(), design_hash=design_hash(study))


def design_hash(study: Study) -> str:
    """SHA-256 of all that the plan and its conditions are made of; titles, labels and checks may change."""
    text = json.dumps(design_of(study), ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()


def design_of(study: Study) -> dict[str, Json]:
    """What the plan and its conditions are made of, by the keys and tables of study.toml."""
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
    """The keys and tables of study.toml in which the design is another than it was.

    :param before: the design as it was, of `design_of`.
    :param study: as it is now.
    """
    now = design_of(study)
    return [part for part in dict.fromkeys([*before, *now]) if before.get(part) != now.get(part)]
