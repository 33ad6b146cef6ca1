"""The settings of `rise-engine explore`, the properties of a study and its trials, as plain values.

`explore_tables` reads them from `[explore]`, `[always]`, `[reachable]`, `[eventually]` and `[trials]` in scenario.toml.
"""

from __future__ import annotations

import re
from typing import Literal, TypeAlias

from msgspec import Struct, field

from rise_engine.expression import Expression
from rise_engine.expression.environment import Json
from rise_engine.scenario.source_location import SourceLocation

PropertyKind: TypeAlias = Literal["always", "reachable", "eventually"]
"""always: it holds in every situation; reachable: every situation can lead to it; eventually: it happens by itself."""
ExploredKeys: TypeAlias = Literal["rules", "all"]


class ExploreSettings(Struct, frozen=True):
    """The limits of exploring."""

    end: str = ""
    """The rule whose end ends the study; empty: the rule of the first key that starts one."""
    faults: int = 1
    """Maximum number of faults on one path."""
    line: int = 1
    """Maximum number of acts that wait at once."""
    beside: int = 2
    """Maximum number of acts of calling type None that run at once."""
    pace: tuple[float, float] | None = (0.5, 3.0)
    """The minimum and maximum duration of acts, as multiples of the expected one; null: any duration."""
    tries: dict[str, tuple[Json, ...]] = field(default_factory=dict)
    """Values that a person may type or a node may write, by memory key."""
    keys: ExploredKeys = "rules"
    """all: also the keys that start acts by hand."""


class StudyProperty(Struct, frozen=True):
    """A property that the author claims for all situations of a study."""

    kind: PropertyKind
    name: str
    condition: Expression
    """For `eventually`: what happens by itself (`then`)."""
    after: Expression | None = None
    """Only for `eventually`: where the wait for it starts; null: everywhere."""
    unless: Expression | None = None
    """Only for `eventually`: what makes it unnecessary."""
    location: SourceLocation = field(default=SourceLocation(""), name="place")


# --- trials -----------------------------------------------------------------------------------------------------------


PARTICIPANT = "participant_s"
SPEECH = "speech_s"
MEASURES = (PARTICIPANT, SPEECH, "key_s", "wizard_s", "duration_s", "prompts", "repairs", "failures")
"""Columns of every trial that can be the dependent variable, like the declared columns."""


class TrialSettings(Struct, frozen=True):
    """The settings in `[trials]`: either `state` or `key` is set."""

    state: str = ""
    """`STATE` or `RULE/STATE`, with `*` for any text."""
    key: Expression | None = None
    columns: tuple[Expression, ...] = ()
    """Each is a memory key or a part of a value; its text is the column's name."""
    measure: str = PARTICIPANT
    speech: str = ""
    """The topic, without slash, of the event at which the participant begins to speak. Empty: none."""

    def begins_at(self, rule: str, state: str) -> bool:
        """Whether entering a state begins a trial."""
        return bool(self.state) and fits_state(self.state, rule, state)


def fits_state(written: str, rule: str, state: str) -> bool:
    """Whether `STATE` or `RULE/STATE`, with `*` for any text, names a state of a rule.

    >>> fits_state("Ask", "Quiz", "Ask"), fits_state("Quiz/Task *", "Quiz", "Task 2"), fits_state("Ask", "Quiz", "Asks")
    (True, True, False)
    """
    pattern = ".*".join(map(re.escape, written.split("*")))
    return any(re.fullmatch(pattern, name, re.DOTALL) for name in (state, f"{rule}/{state}"))
