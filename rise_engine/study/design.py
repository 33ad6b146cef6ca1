"""The consequences of a study's design: cells, runs of a participant, strata, and hashes."""

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
"""Columns that every plan.csv has beside strata and between factors."""
SAID_LATER = frozenset({"wizards", "report", "retention", "participants", "questionnaire"})
"""Tables of study.toml that do not affect any session."""


def factors_of(study: Study, kind: str) -> tuple[Factor, ...]:
    """Return the factors of one kind, `between` or `within`, in the order of the file."""
    return tuple(factor for factor in study.factors if factor.kind == kind)


def cells(study: Study) -> list[dict[str, str]]:
    """Return all combinations of between levels, by factor. One empty combination if there is no factor."""
    return _combinations(factors_of(study, "between"))


def runs(study: Study) -> list[str]:
    """Return each participant's runs: all combinations of within levels, joined by `+`. One empty text if there is no
    factor."""
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
    """Return the SHA-256 of study.toml without comments, `SAID_LATER` and descriptions of levels.

    People may add these after the sessions. So the study.toml of a bundle, which names no wizards, has the same hash.

    :param values: the values of study.toml.
    >>> content_hash({"n": 4, "report": {"story": "Tea"}}) == content_hash({"n": 4}) != content_hash({"n": 5})
    True
    """
    told = {name: value for name, value in values.items() if name not in SAID_LATER}
    if "factors" in told:
        told["factors"] = _without_descriptions(told["factors"])
    return _hash_of(told)


def _without_descriptions(factors: Json) -> Json:
    """Remove the levels' descriptions from `[factors]`."""
    if not isinstance(factors, dict):
        return factors
    told: dict[str, Json] = {}
    for name, factor in factors.items():
        levels = factor.get("levels") if isinstance(factor, dict) else None
        told[name] = factor
        if isinstance(factor, dict) and isinstance(levels, dict):
            told[name] = {**factor, "levels": {level: _plain_level(values) for level, values in levels.items()}}
    return told


def _plain_level(level: Json) -> Json:
    return {key: value for key, value in level.items() if key != "description"} if isinstance(level, dict) else level


def design_hash(study: Study) -> str:
    """Return the SHA-256 of everything that the plan depends on. Titles, labels and checks may change."""
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
