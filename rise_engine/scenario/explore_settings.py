"""The settings of `rise-engine explore` and the properties of a study, as plain values.

They come from `[explore]`, `[always]`, `[reachable]` and `[eventually]` in scenario.toml, which `explore_tables` reads.
"""

from __future__ import annotations

from typing import Literal, TypeAlias

from msgspec import Struct, field

from rise_engine.expression import Expression
from rise_engine.expression.environment import Json
from rise_engine.scenario.source_location import SourceLocation

PropertyKind: TypeAlias = Literal["always", "reachable", "eventually"]
"""always: it holds in every situation; reachable: every situation can still lead to it; eventually: it happens by
itself."""
ExploredKeys: TypeAlias = Literal["rules", "all"]


class ExploreSettings(Struct, frozen=True):
    """How far exploring goes."""

    end: str = ""
    """The rule whose end is the end of the study; empty: the rule of the first key that starts one."""
    faults: int = 1
    """The most things that go wrong on one path."""
    line: int = 1
    """The most acts that wait at once."""
    beside: int = 2
    """The most acts of calling type None that run at once."""
    pace: tuple[float, float] | None = (0.5, 3.0)
    """The shortest and longest duration of acts, as a multiple of the expected one; null: any duration."""
    tries: dict[str, tuple[Json, ...]] = field(default_factory=dict)
    """Values that somebody may type or a node may write, by memory key."""
    keys: ExploredKeys = "rules"
    """all: also the keys that start acts by hand."""


class StudyProperty(Struct, frozen=True):
    """A property that the author claims for all situations of a study."""

    kind: PropertyKind
    name: str
    condition: Expression
    """For `eventually`: what happens by itself (`then`)."""
    after: Expression | None = None
    """Only for `eventually`: where waiting for it starts; null: everywhere."""
    unless: Expression | None = None
    """Only for `eventually`: what makes it unnecessary."""
    location: SourceLocation = field(default=SourceLocation(""), name="place")
