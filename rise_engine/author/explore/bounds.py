"""The bounds of exploring."""

from __future__ import annotations

from typing import Any, Literal

from msgspec import Struct, field

from rise_engine.author.explore.act_traits import Pace


class Bounds(Struct, frozen=True):
    """What exploring includes and what it leaves out."""

    keys: Literal["rules", "all"] = "rules"
    """all: also the keys that start acts by hand."""
    line: int = 1
    """How many acts can wait; nothing is explored after one more."""
    beside: int = 2
    """How many acts that run beside others run at once."""
    asked: int = 1
    """How many failed acts can wait for an answer at once."""
    kept: int = 1
    """How many events are kept at once for rules that will wait for them."""
    faults: int = 1
    """How many things go wrong on one path: an act fails, the robot is lost, everything is stopped."""
    stop: bool = True
    """Whether everything can be stopped at any moment."""
    lost: bool = True
    """Whether the robot can be lost at any moment, and whether it or somebody else can end acts."""
    pace: Pace | None = (0.5, 3.0)
    """The minimum and maximum duration of acts as multiples of the expected one; None: any time."""
    tries: dict[str, tuple[Any, ...]] = field(default_factory=dict)
    """Values that somebody may give memory keys."""
    situations: int = 1_000_000
    """Maximum number of situations."""
    values: int = 15
    """Maximum number of values followed for each memory key."""
    merges_alike: bool = True
    """Whether only the first of several interchangeable acts that no rule mentions is started."""
    follows_voice: bool = False
    """Whether it matters when the robot speaks within an act: something reads `session.speaking`."""
