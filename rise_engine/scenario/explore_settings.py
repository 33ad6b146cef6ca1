"""What `rise-engine explore` looks at, and what the author says of all situations of a study (`[explore]`, `[always]`,
`[reachable]` and `[eventually]` in scenario.toml): plain values. `explore_tables` reads them.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

from msgspec import Struct, field

from rise_engine.expression import Expression
from rise_engine.expression.environment import Json
from rise_engine.scenario.source_location import SourceLocation

PropertyKind: TypeAlias = Literal["always", "reachable", "eventually"]
"""always: it holds in every situation; reachable: it can still come from every situation; eventually: it comes by
itself."""
ExploredKeys: TypeAlias = Literal["rules", "all"]


class ExploreSettings(Struct, frozen=True):
    """How far exploring goes."""

    end: str = ""
    """The rule whose end is the end of the study; empty: the rule of the first key that starts one."""
    faults: int = 1
    """How many things go wrong on one way."""
    line: int = 1
    """How many acts wait at most."""
    beside: int = 2
    """How many acts of calling type None run at once."""
    pace: tuple[float, float] | None = (0.5, 3.0)
    """How many times as long as expected acts take, at least and at most; null: any time."""
    tries: dict[str, tuple[Json, ...]] = field(default_factory=dict)
    """By memory key: values that somebody may type or a node may write."""
    keys: ExploredKeys = "rules"
    """all: also the keys that start acts by hand."""


class StudyProperty(Struct, frozen=True):
    """What the author says of all situations of a study."""

    kind: PropertyKind
    name: str
    condition: Expression
    """Of `eventually`: what comes by itself (`then`)."""
    after: Expression | None = None
    """Only of `eventually`: from where on it is waited for; null: from everywhere."""
    unless: Expression | None = None
    """Only of `eventually`: what makes it needless."""
    location: SourceLocation = field(default=SourceLocation(""), name="place")
