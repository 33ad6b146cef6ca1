"""Who names what in a scenario: acts, rules, states, events, memory keys, actions; where, and for what."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.scenario.model import SourceLocation

UsedKind: TypeAlias = Literal["act", "rule", "state", "event", "key", "action"]
"""A state is called `RULE/STATE` here, an action `ACT/ID`; an event has no slash; a key is a memory key."""


class Use(Struct, frozen=True):
    """A place at which a name stands."""

    kind: UsedKind
    name: str
    location: SourceLocation
    """Of the first character of the name; of what comes from a template, the `<use>`, and the template beside."""
    length: int
    """Characters of the file that the name takes there, entities counted as they are written."""
    defines: bool
    """Whether this is what is called so (a start value of a key counts), and not only names it."""
    where: str
    """For a list, without the name: "rule Table setting, state Start, on entry", "key 2", "act R_Yes, action 3"."""
    of: str = ""
    """The act or rule in which it stands, as a name alone; empty: elsewhere."""


class Uses:
    """All uses of a scenario, by kind and name."""

    def __init__(self, uses: Iterator[Use]) -> None:
        self._by_name: dict[tuple[UsedKind, str], list[Use]] = {}
        for use in uses:
            self._by_name.setdefault((use.kind, use.name), []).append(use)

    def of(self, kind: UsedKind, name: str) -> list[Use]:
        """Where a name stands, in reading order; what defines it first."""
        return self._by_name.get((kind, name), [])

    def names(self, kind: UsedKind) -> list[str]:
        """All names of a kind that are defined or named, sorted."""
        return sorted(name for known, name in self._by_name if known == kind)

    def at(self, file: str, line: int, column: int) -> Use | None:
        """What stands at a character of a file, for "go to the definition"."""
        for uses in self._by_name.values():
            for use in uses:
                place = use.location
                if place.file == file and place.line == line and 0 <= column - place.column <= use.length:
                    return use
        return None
