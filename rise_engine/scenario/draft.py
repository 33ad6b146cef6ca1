"""What the files of a scenario say about each other, collected while they are read and compared afterwards."""

from __future__ import annotations

from collections.abc import Callable

from msgspec import Struct

from rise_engine.expression import Assignment, Expression
from rise_engine.expression.nodes import Part
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


class ScenarioDraft:
    """A scenario in the making."""

    def __init__(self) -> None:
        self.acts: dict[str, Act] = {}
        self.rules: dict[str, Rule] = {}
        self.memory: dict[str, Json] = {}
        self.memory_key_locations: dict[str, SourceLocation] = {}
        """Where the memory's keys, the tables and their columns stand that there may be a warning about."""
        self.tables: dict[str, Table] = {}
        self.unreadable_parts: set[str] = set()
        """Of acts, rules, memory and tables, what could not be read whole: then nothing can be said to be missing
        there."""
        self.act_mentions: list[Mention] = []
        self.rule_mentions: list[Mention] = []
        self.state_mentions: list[StateMention] = []
        self.awaited_topics: list[Mention] = []
        """Topics without their slash."""
        self.raised_topics: list[Mention] = []
        self.key_reads: list[Mention] = []
        """Memory keys that conditions and templates read and that have no fallback."""
        self.optional_key_reads: list[Mention] = []
        """Memory keys that need not be there: conditions ask `defined(key)`, texts have `{", "key}`."""
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
        self.expressions: dict[str, Expression] = {}
        """By text: rules repeat themselves, and what has been read once need not be read again."""
        self.assignments: dict[str, Assignment] = {}
        self.spoken_languages: set[str] = set()
        """Languages that single actions name, by BCP 47."""
        self.has_languages_from_memory = False
        """Whether the memory says at run time which language an action speaks."""
        self.unsent_ssml: list[SourceLocation] = []
        """Where messages stand that are SSML, of which this robot gets the words alone."""
