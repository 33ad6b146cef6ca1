"""The names and references in the files of a scenario, collected while reading and compared afterwards."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from msgspec import Struct

from rise_engine.expression import Assignment, Expression
from rise_engine.expression.nodes import Part
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import Act, Json, Rule, SourceLocation, Table


class Mention(Struct, frozen=True):
    """A name and its place."""

    name: str
    locate: Callable[[], SourceLocation]
    """Computes the location, for a diagnostic."""


class BareKey(Mention, frozen=True):
    """A parameter value that is only valid as a memory key."""

    problem: str
    """The error of the value if there is no such key."""


class ConditionValue(Mention, frozen=True):
    """A memory key that a condition sets."""

    condition: str
    value: Json


class StateMention(Mention, frozen=True):
    """The name of a state that a rule is started in or that a property mentions."""

    rule: str


class PartMention(Struct, frozen=True):
    """A part of a value that is read, such as `items[i].text`."""

    part: Part
    locate: Callable[[], SourceLocation]
    spoken: bool = False
    """Whether it is in a text."""


class Definition(Struct, frozen=True):
    """An act or a rule that was read, and the place of its name."""

    part: Act | Rule
    locate: Callable[[], SourceLocation]


class ForeignEnd(Struct, frozen=True):
    """A transition that waits for the end of an act that its own rule never starts."""

    act: str
    location: SourceLocation


class ScenarioDraft:
    """A scenario while it is being read, or the content of one file."""

    def __init__(
        self, expressions: dict[str, Expression] | None = None, assignments: dict[str, Assignment] | None = None
    ) -> None:
        """Share the parsed expressions and assignments of other parts, because rules repeat them."""
        self.act_definitions: list[Definition] = []
        """All that were read. `acts` and `rules` have only one of each name."""
        self.rule_definitions: list[Definition] = []
        self.acts: dict[str, Act] = {}
        self.rules: dict[str, Rule] = {}
        self.memory: dict[str, Json] = {}
        self.memory_key_locations: dict[str, SourceLocation] = {}
        """The places of memory keys, tables and columns that warnings may be about."""
        self.tables: dict[str, Table] = {}
        self.unreadable_parts: set[str] = set()
        """The parts (acts, rules, memory, tables, settings) that could not be read completely, or have an unnamed
        element. Names in them are never reported as missing."""
        self.act_mentions: list[Mention] = []
        self.rule_mentions: list[Mention] = []
        self.state_mentions: list[StateMention] = []
        self.asked_states: list[StateMention] = []
        """States that properties of the study mention. No rule begins there because of them."""
        self.trial_states: list[Mention] = []
        """States that begin a trial (`[trials]`)."""
        self.awaited_topics: list[Mention] = []
        """Topics without their slash."""
        self.raised_topics: list[Mention] = []
        self.foreign_ends: list[ForeignEnd] = []
        self.key_reads: list[Mention] = []
        """Memory keys that conditions and templates read without a fallback."""
        self.optional_key_reads: list[Mention] = []
        """Memory keys that may be missing: conditions have `defined(key)`, texts have `{", "key}`."""
        self.property_reads: list[Mention] = []
        """Memory keys that only properties of the study read, so the robot's behaviour does not depend on them."""
        self.tried_keys: list[Mention] = []
        """Memory keys that exploring sets to other values."""
        self.key_writes: list[Mention] = []
        """Memory keys that rules and key bindings set."""
        self.part_writes: list[Mention] = []
        """Memory keys of which rules and key bindings set parts, such as `items` in `items[i].done = true`."""
        self.condition_values: list[ConditionValue] = []
        """The values that conditions set."""
        self.private_keys: list[Mention] = []
        """Memory keys in `private`."""
        self.part_reads: list[PartMention] = []
        """Parts of values that conditions, assignments and templates read without a fallback."""
        self.spoken_keys: list[Mention] = []
        """Memory keys in texts, with or without fallback."""
        self.settable_keys: set[str] = set()
        """Memory keys that start values, conditions, rules and key bindings set."""
        self.session_keys: dict[str, Json] = {}
        """An example of the engine's values under `session`; empty: the scenario does not read them."""
        self.bare_keys: list[BareKey] = []
        self.bare_words: list[Mention] = []
        """Right sides of assignments that are one word: a key, or a text without quotation marks."""
        self.expressions: dict[str, Expression] = expressions if expressions is not None else {}
        self.assignments: dict[str, Assignment] = assignments if assignments is not None else {}
        self.spoken_languages: set[str] = set()
        """BCP 47 tags of single actions' languages."""
        self.has_languages_from_memory = False
        """Whether the memory determines the language of an action."""
        self.unsent_ssml: list[SourceLocation] = []
        """The places of SSML messages of which this robot only gets the words."""

    def add(self, part: ScenarioDraft) -> None:
        """Add the content of a part."""
        for name, value in vars(part).items():
            match value:
                case list():
                    getattr(self, name).extend(value)
                case bool():
                    setattr(self, name, value or getattr(self, name))
                case dict() | set() if name not in _SHARED:
                    getattr(self, name).update(value)

    def define(self, diagnostics: Diagnostics) -> None:
        """Define the acts and rules. Of two with the same name, the first counts and the other gets a diagnostic."""
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
"""Attributes that all parts of one scenario share."""
