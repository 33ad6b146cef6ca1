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
SAID_LATER = frozenset({"wizards", "report", "retention", "participants", "questionnaire"})
"""Tables of study.toml that no session depends on."""


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


def with_hashes(study: Study, values: Mapping[str, Json]) -> Study:
    """The study with the hash of its file and that of its design.

    :param values: study.toml, as TOML has it.
    """
    return replace(study, hash=content_hash(values), design_hash=design_hash(study))


def content_hash(values: Mapping[str, Json]) -> str:
    """SHA-256 of what study.toml says, without comments and without what people may add after the sessions
    (`SAID_LATER`, and descriptions of levels). So the study.toml of a bundle, which names no wizards, has the same.

    :param values: study.toml, as TOML has it.

    >>> content_hash({"n": 4, "report": {"story": "Tea"}}) == content_hash({"n": 4}) != content_hash({"n": 5})
    True
    """
    told = {name: value for name, value in values.items() if name not in SAID_LATER}
    if "factors" in told:
        told["factors"] = _without_descriptions(told["factors"])
    return _hash_of(told)


def _without_descriptions(factors: Json) -> Json:
    """`[factors]` without what is said about levels for readers."""
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
    """SHA-256 of all that the plan and its conditions are made of; titles, labels and checks may change."""
    return _hash_of(design_of(study))


def _hash_of(values: Json) -> str:
    text = json.dumps(values, ensure_ascii=False, sort_keys=True, separators=(",", ":"), default=str)  # TOML has dates
    return sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


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
