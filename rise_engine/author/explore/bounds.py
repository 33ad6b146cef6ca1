"""How far exploring goes."""

from __future__ import annotations

from typing import Any, Literal

from msgspec import Struct, field

from rise_engine.author.explore.act_traits import Pace


class Bounds(Struct, frozen=True):
    """What is looked at, and what is not."""

    keys: Literal["rules", "all"] = "rules"
    """all: also the keys that start acts by hand."""
    line: int = 1
    """How many acts can wait; what would follow if one more waited is not looked at."""
    beside: int = 2
    """How many acts run at once that run beside others."""
    asked: int = 1
    """About how many failed acts somebody can be asked at once."""
    kept: int = 1
    """How many events are kept at once for rules that will wait for them."""
    faults: int = 1
    """How many things go wrong on one way: an act fails, the robot is lost, everything is stopped."""
    stop: bool = True
    """Whether everything can be stopped at any moment."""
    lost: bool = True
    """Whether the robot can be lost at any moment, and acts be ended by it or by somebody else."""
    pace: Pace | None = (0.5, 3.0)
    """How many times what is expected acts take; null: any time."""
    tries: dict[str, tuple[Any, ...]] = field(default_factory=dict)
    """Values that somebody may give memory keys."""
    situations: int = 1_000_000
    """At most so many situations are looked at."""
    values: int = 15
    """Of each memory key at most so many values are followed."""
    merges_alike: bool = True
    """Whether of acts that no rule speaks of, and that nothing tells apart, only the first is started."""
    follows_voice: bool = False
    """Whether it matters when the robot speaks within an act: something reads `session.speaking`."""
