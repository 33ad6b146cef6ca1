"""The names of a study that forms offer and check against: acts, rules, states, events, memory keys. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from rise_engine.author.drawing.rule_text import ENDING_VERBS
from rise_engine.author.edit.edits import CallForm
from rise_engine.author.edit.outline import Outline, WrittenRule, WrittenStatement
from rise_engine.author.edit.plan import Files
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.file_names import SCENARIO_FILE
from rise_engine.scenario.model import CUE_TOPICS, Json, normal_topic, result_topics
from rise_tui.editor.model.draft import toml_values
from rise_tui.editor.model.fields import FieldChoice


class StudyNames(NamedTuple):
    """Everything that exists in a study, right or wrong."""

    outline: Outline
    memory: Mapping[str, Json]
    """The start values, with the tables."""
    set_keys: frozenset[str]
    """Memory keys that rules, keys of the keyboard or conditions set."""
    tables: frozenset[str]
    raised: Mapping[str, str]
    """Events (without slash) that are raised, each with a note: `raised by rule Next, key n`."""
    own_events: Sequence[str]
    """Events that the study raises or waits for, without the engine's."""
    awaited: frozenset[str]
    keyboard: Mapping[str, Any]
    """`[keys]` of scenario.toml, as written."""

    @property
    def acts(self) -> list[str]:
        return list(dict.fromkeys(act.name for act in self.outline.acts if act.name))

    @property
    def rules(self) -> list[str]:
        return list(dict.fromkeys(rule.name for rule in self.outline.rules if rule.name))

    def states_of(self, rule: str) -> list[str]:
        """The states of a rule, in the file's order; empty for an unknown rule."""
        found = self.outline.rule(rule)
        return [state.id for state in found.states] if found is not None else []

    def event_note(self, event: str) -> str:
        """What raises an event, in words; empty: nothing in this study."""
        return self.raised.get(normal_topic(event), "")

    def event_choices(self) -> list[FieldChoice]:
        """Every event that a rule can wait for: the study's first, then the engine's."""
        return [
            FieldChoice(f"/{event}", f"/{event}", self.event_note(event) or "nothing in this study raises it")
            for event in dict.fromkeys((*self.own_events, *self.raised))
        ]

    def own_event_choices(self) -> list[FieldChoice]:
        """The events of the study that can be raised."""
        notes = {True: "a rule waits for it", False: "no rule waits for it"}
        return [FieldChoice(f"/{event}", f"/{event}", notes[event in self.awaited]) for event in self.own_events]

    def key_choices(self) -> list[FieldChoice]:
        """Every memory key that a condition can use, with its start value."""
        names = dict.fromkeys((*self.memory, *sorted(self.set_keys)))
        return [FieldChoice(name, name, self.start_note(name)) for name in names]

    def start_note(self, key: str) -> str:
        """The start value of a memory key, in words."""
        if key in self.tables:
            return f"a table of {len(self.memory[key])} rows"
        return f"{short_value(self.memory[key])} at the start" if key in self.memory else "not there at the start"

    def target_choices(self, rule: str) -> list[FieldChoice]:
        """The states of a rule that a transition can lead to."""
        found = self.outline.rule(rule)
        states = found.states if found is not None else ()
        return [FieldChoice(state.id, state.id, "" if state.transitions else "ends the rule") for state in states]

    def act_choices(self, first: tuple[str, ...] = ()) -> list[FieldChoice]:
        """The acts, those of `first` in front."""
        mine = [name for name in dict.fromkeys(first) if name in self.acts]
        names = (*mine, *(name for name in self.acts if name not in mine))
        return [FieldChoice(name, name, "started by this rule" if name in mine else "") for name in names]

    def rule_choices(self) -> list[FieldChoice]:
        return [FieldChoice(name, name, f"{len(self.states_of(name))} states") for name in self.rules]


def engine_notes(draft: ScenarioDraft) -> dict[str, str]:
    """The events that the engine raises itself, each with the moment."""
    notes = {CUE_TOPICS[0]: "the participant's cue", CUE_TOPICS[1]: "raised when the cue is taken back"}
    for act in draft.acts:
        notes |= {act + suffix: f"raised automatically when {act} {when}" for suffix, when in ENDING_VERBS.items()}
    for name, rule in draft.rules.items():
        notes[f"{name}_end"] = f"raised automatically when {name} ends"
        for state, topic in result_topics(rule):
            notes[topic] = f"raised automatically when the rule {name} ends in {state}"
    return notes


def study_names(outline: Outline, draft: ScenarioDraft, files: Files) -> StudyNames:
    """The names in a study, from everything that could be read of it."""
    raised: dict[str, dict[str, None]] = {normal_topic(mention.name): {} for mention in draft.raised_topics}
    for rule in outline.rules:
        for call in calls_of_rule(rule):
            if call.function == "raiseEventTopic":
                raised.setdefault(normal_topic(call.argument), {})[f"rule {rule.name}"] = None
    keyboard = toml_values(files.get(SCENARIO_FILE, b"")).get("keys", {})
    keyboard = keyboard if isinstance(keyboard, dict) else {}
    for key, binding in keyboard.items():
        if isinstance(binding, dict) and isinstance(binding.get("event"), str):
            raised.setdefault(normal_topic(binding["event"]), {})[f"key {key}"] = None
    notes = {event: f"raised by {', '.join(by)}" if by else "raised in this study" for event, by in raised.items()}
    awaited = frozenset(normal_topic(mention.name) for mention in draft.awaited_topics) - {""}
    tables = {name: table.records for name, table in draft.tables.items()}
    set_keys = {mention.name for mention in (*draft.key_writes, *draft.part_writes, *draft.condition_values)}
    return StudyNames(
        outline,
        {**draft.memory, **tables},
        frozenset(set_keys),
        frozenset(tables),
        {**notes, **engine_notes(draft)},
        sorted({*raised, *awaited} - {""}, key=str.casefold),
        awaited,
        keyboard,
    )


def calls_of_rule(rule: WrittenRule) -> Iterator[CallForm]:
    """Every function in a rule."""
    for state in rule.states:
        for block in (state.on_entry, state.on_exit, *(transition.statements for transition in state.transitions)):
            yield from _calls_in(block)


def _calls_in(statements: tuple[WrittenStatement, ...]) -> Iterator[CallForm]:
    for statement in statements:
        if statement.call is not None:
            yield statement.call
        yield from _calls_in((*statement.choices, *statement.brings))
        for branch in statement.branches:
            yield from _calls_in(branch.statements)


def acts_started_by(rule: WrittenRule) -> tuple[str, ...]:
    """The acts that a rule starts, in the file's order."""
    calls = calls_of_rule(rule)
    return tuple(dict.fromkeys(call.argument for call in calls if call.function == "startCommunicationRobotAct"))


def short_value(value: Json) -> str:
    """A value in a short form; for a list or an object, its size."""
    match value:
        case bool():
            return "true" if value else "false"
        case None:
            return "null"
        case str():
            return f"“{value}”" if len(value) <= 30 else f"“{value[:29]}…”"
        case list():
            return f"a list of {len(value)}"
        case dict():
            return f"an object of {len(value)}"
        case _:
            return str(value)
