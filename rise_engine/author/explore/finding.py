"""What exploring has to say: one sentence each, for who runs the study, with the way that leads there."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal, TypeAlias

from msgspec import Struct

from rise_engine.author.explore.paths import Path
from rise_engine.scenario.model import SourceLocation

FindingLevel: TypeAlias = Literal["problem", "warning", "remark"]
"""problem: a session can go wrong; warning: it should be looked at; remark: good to know."""


_NAMED = 4
"""So many states are named in a sentence."""


class ExploreFinding(Struct, frozen=True, kw_only=True):
    """Something that exploring has found."""

    kind: str
    """A word for programs: `dead-end`, `no-end`, `never-taken`, ... (docs/reference/explore.md)."""
    level: FindingLevel
    text: str
    """The sentence."""
    location: SourceLocation | None = None
    """Where in the study's files it is about."""
    rule: str = ""
    state: str = ""
    act: str = ""
    key: str = ""
    path: Path | None = None
    """How a session comes there, shortest first; null: there is no single way to show."""


def some_states(states: Iterable[str]) -> str:
    """The first few of these states, and how many more there are."""
    names = list(states)
    more = len(names) - _NAMED
    return " or ".join(names) if more <= 0 else f"{', '.join(names[:_NAMED])} or {more} other states"
