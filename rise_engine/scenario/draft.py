"""What the files of a scenario say about each other, collected while they are read and compared afterwards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msgspec import Struct

from rise_engine.expression import Assignment, Expression
from rise_engine.expression.nodes import Part
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import Act, Json, Rule, SourceLocation, Table


class Mention(Struct, frozen=True):
    """A name and where it stands."""

    name: str
    locate: Callable[[], SourceLocation]
    """Works out the location, when a finding needs it."""


class BareKey(Mention, frozen=True):
    """A parameter value that can only be meant as a memory key."""

    problem: str
    """What is wrong with it if there is no such key."""


class ConditionValue(Mention, frozen=True):
    """A memory key that a condition sets, and where it stands."""

    condition: str
    value: Json


class StateMention(Mention, frozen=True):
    """The name of a state in which a rule is started, and where it stands."""

    rule: str


class PartMention(Struct, frozen=True):
    """A part of a value that is read, `items[i].text`, and where it stands."""

    part: Part
    locate: Callable[[], SourceLocation]
    spoken: bool = False
    """It stands in a text."""


class Definition(Struct, frozen=True):
    """An act or a rule that was read, and where its name stands."""

    part: Act | Rule
    locate: Callable[[], SourceLocation]


class ForeignEnd(Struct, frozen=True):
    """A transition that waits for the end of an act which its own rule never starts."""

    act: str
    location: SourceLocation


class ScenarioDraft:
    """A scenario in the making, or a part of one: what one file says."""

    def __init__(
        self, expressions: dict[str, Expression] | None = None, assignments: dict[str, Assignment] | None = None
    ) -> None:
        """With what other parts have read already, by its text: rules repeat themselves."""
        self.act_definitions: list[Definition] = []
        """All that were read; `acts` and `rules` have what counts of them."""
        self.rule_definitions: list[Definition] = []
        self.acts: dict[str, Act] = {}
        self.rules: dict[str, Rule] = {}
        self.memory: dict[str, Json] = {}
        self.memory_key_locations: dict[str, SourceLocation] = {}
        """Where the memory's keys, the tables and their columns stand that there may be a warning about."""
        self.tables: dict[str, Table] = {}
        self.unreadable_parts: set[str] = set()
        """Of acts, rules, memory, tables and settings (scenario.toml), what could not be read whole: then nothing can
        be said to be missing there."""
        self.act_mentions: list[Mention] = []
        self.rule_mentions: list[Mention] = []
        self.state_mentions: list[StateMention] = []
        self.asked_states: list[StateMention] = []
        """States that properties of the study ask for; no rule begins there because of it."""
        self.trial_states: list[Mention] = []
        """States that begin a trial, as `[trials]` writes them."""
        self.awaited_topics: list[Mention] = []
        """Topics without their slash."""
        self.raised_topics: list[Mention] = []
        self.foreign_ends: list[ForeignEnd] = []
        self.key_reads: list[Mention] = []
        """Memory keys that conditions and templates read and that have no fallback."""
        self.optional_key_reads: list[Mention] = []
        """Memory keys that need not be there: conditions ask `defined(key)`, texts have `{", "key}`."""
        self.property_reads: list[Mention] = []
        """Memory keys that properties of the study read; the robot does nothing otherwise because of them."""
        self.tried_keys: list[Mention] = []
        """Memory keys that exploring gives other values."""
        self.key_writes: list[Mention] = []
        """Memory keys that rules and key bindings set."""
        self.part_writes: list[Mention] = []
        """Memory keys of which rules and key bindings set parts, `items` in `items[i].done = true`."""
        self.condition_values: list[ConditionValue] = []
        """What the conditions set."""
        self.private_keys: list[Mention] = []
        """Memory keys that `private` names."""
        self.part_reads: list[PartMention] = []
        """Parts of values that conditions, assignments and templates read and that have no fallback."""
        self.spoken_keys: list[Mention] = []
        """Memory keys that stand in texts, with or without fallback."""
        self.settable_keys: set[str] = set()
        """Memory keys that start values, conditions, rules and key bindings set."""
        self.session_keys: dict[str, Json] = {}
        """An example of what the engine keeps under `session`; empty when nothing in the scenario asks for it."""
        self.bare_keys: list[BareKey] = []
        self.bare_words: list[Mention] = []
        """Right sides of assignments that are one word: a key, or a text without quotation marks."""
        self.expressions: dict[str, Expression] = expressions if expressions is not None else {}
        self.assignments: dict[str, Assignment] = assignments if assignments is not None else {}
        self.spoken_languages: set[str] = set()
        """Languages that single actions name, by BCP 47."""
        self.has_languages_from_memory = False
        """Whether the memory says at run time which language an action speaks."""
        self.unsent_ssml: list[SourceLocation] = []
        """Where messages stand that are SSML, of which this robot gets the words alone."""

    def add(self, part: ScenarioDraft) -> None:
        """Take over what a part says."""
        for name, value in vars(part).items():
            match value:
                case list():
                    getattr(self, name).extend(value)
                case bool():
                    setattr(self, name, value or getattr(self, name))
                case dict() | set() if name not in _SHARED:
                    getattr(self, name).update(value)

    def define(self, diagnostics: Diagnostics) -> None:
        """The acts and rules of the definitions: of two with one name, the first, and a finding for the other."""
        self._define("act", self.act_definitions, self.acts, diagnostics)
        self._define("rule", self.rule_definitions, self.rules, diagnostics)

    def _define(
        self, kind: str, definitions: list[Definition], known: dict[str, Any], diagnostics: Diagnostics
    ) -> None:
        for definition in definitions:
            name = definition.part.name
            if name in known:
                first = known[name].location
                message = f"there is another {kind} `{name}` in {first.file}, line {first.line}"
                diagnostics.error("duplicate-name", definition.locate(), message)
            else:
                known[name] = definition.part


_SHARED = ("expressions", "assignments")
"""What all parts of one scenario have together."""
