"""Who names what in a scenario: acts, rules, states, events, memory keys, actions; where, and for what."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Literal, TypeAlias

from msgspec import UNSET, Struct

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
    """Characters of the file that the name takes there, entities counted as they are written; 0: it is put together
    of several pieces, and stands nowhere as a whole."""
    defines: bool
    """Whether this is what is called so (a start value of a key counts), and not only names it."""
    where: str
    """For a list, without the name: "rule Table setting, state Start, on entry", "key 2", "act R_Yes, action 3"."""
    of: str = ""
    """The act or rule in which it stands, as a name alone; empty: elsewhere."""
    in_template: bool = False
    """Whether the name stands in the template (`place`), and not in the `<use>`."""

    may_be_text: bool = False
    """It is one word on the right side of an assignment: a key, because the scenario has one of that name."""

    @property
    def place(self) -> SourceLocation:
        """Where the name itself stands: in the file of its template, if it was not the `<use>` that gave it."""
        template = self.location.template
        place = template if self.in_template and template is not UNSET else self.location
        return SourceLocation(place.file, place.line, place.column)


class Uses:
    """All uses of a scenario, by kind and name. They are looked for when they are first asked for."""

    def __init__(self, uses: Iterable[Use]) -> None:
        self._uses = uses

    def of(self, kind: UsedKind, name: str) -> list[Use]:
        """Where a name stands, in reading order; what defines it first."""
        return self._by_name.get((kind, name), [])

    def names(self, kind: UsedKind) -> list[str]:
        """All names of a kind that are defined or named, sorted."""
        return sorted(name for known, name in self._by_name if known == kind)

    def at(self, file: str, line: int, column: int) -> Use | None:
        """What stands at a character of a file, or ends before it, for "go to the definition"."""
        for use in self._by_line.get((file, line), []):
            if 0 <= column - use.place.column <= use.length:
                return use
        return None

    @cached_property
    def _by_name(self) -> dict[tuple[UsedKind, str], list[Use]]:
        found: dict[tuple[UsedKind, str], list[Use]] = {}
        for use in sorted(self._uses, key=_order):
            found.setdefault((use.kind, use.name), []).append(use)
        return found

    @cached_property
    def _by_line(self) -> dict[tuple[str, int], list[Use]]:
        found: dict[tuple[str, int], list[Use]] = {}
        for uses in self._by_name.values():
            for use in uses:
                if use.length:
                    found.setdefault((use.place.file, use.place.line), []).append(use)
        return found


def _order(use: Use) -> tuple[bool, str, int, int]:
    return not use.defines, use.location.file, use.location.line, use.location.column
