"""The names of a study that forms offer and check against, and a typed condition with them. Pure."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from rise_engine.author.drawing.rule_text import ENDING_VERBS, truth_of
from rise_engine.author.edit.edits import CallForm
from rise_engine.author.edit.outline import Outline, WrittenRule, WrittenStatement
from rise_engine.author.edit.plan import Files
from rise_engine.expression import Expression, ExpressionError, lookup
from rise_engine.expression.errors import MISSING_PART
from rise_engine.expression.functions import SIGNATURES
from rise_engine.scenario.draft import ScenarioDraft
from rise_engine.scenario.files.study_paths import SCENARIO_FILE
from rise_engine.scenario.model import CUE_TOPICS, SESSION, Json, normal_topic, result_topics
from rise_tui.editor.model.draft import toml_values
from rise_tui.editor.model.fields import NOT_GIVEN, EditField, FieldChoice, FieldNote, Form, info


class StudyNames(NamedTuple):
    """Everything that exists in a study, even with errors."""

    outline: Outline
    memory: Mapping[str, Json]
    """The start values, with the tables."""
    set_keys: frozenset[str]
    """Memory keys that rules, keys of the keyboard or conditions set."""
    tables: frozenset[str]
    raised: Mapping[str, str]
    """Raised events (without slash), each with a note: `raised by rule Next, key n`."""
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
        """The sources of an event, in words; empty: none in this study."""
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
        """The acts, with those of `first` in front."""
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
    """The names in a study, from all readable parts of it."""
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


MAX_CUTS = 60
"""Maximum number of words cut from the end of an unreadable text to find a readable beginning."""
_WORD = re.compile(r"""[\w.]+|"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|\S""")
_LAST_WORD = re.compile(r"[^\W\d][\w.]*\Z")
_TEXTS = re.compile(r""""(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'""")
WORDS = ("and", "or", "not", "true", "false", "contains", "starts with", "ends with")


def condition_notes(text: str, names: StudyNames) -> list[FieldNote]:
    """Explain a condition with the start values; of an unreadable one, its longest readable beginning.

    The check of the study reports why it is unreadable.
    """
    text = text.strip()
    try:
        expression = Expression.parse(text)
    except ExpressionError:
        beginning = _readable_beginning(text)
        if beginning is None:
            return []
        return info(f"so far read as {beginning.with_all_brackets}; {_truth_text(beginning, names.memory)}")
    explicit = expression.with_all_brackets
    differs = _without_blanks(explicit) != _without_blanks(text)
    return [*info(f"read as {explicit}" if differs else ""), *info(_truth_text(expression, names.memory))]


def condition_field(
    form: Form, names: StudyNames, id: str, label: str, empty: str = NOT_GIVEN, *, note: str = ""
) -> EditField:
    """The field of a condition in a form."""
    remarks = condition_notes(form.value(id), names)
    field = form.text(id, label, empty, note=note, choices=names.key_choices(), remarks=remarks)
    return field._replace(is_expression=True)


def suggest_ending(text: str, keys: Sequence[str]) -> str:
    """The rest of the unfinished word at the end of a text; empty if it is not certain.

    >>> suggest_ending("step < 4 and not und", ["step", "understood"])
    'erstood'
    """
    begun = _LAST_WORD.search(text)
    if begun is None or {*_TEXTS.sub("", text)} & {"'", '"'}:
        return ""
    word = begun.group()
    functions = (f"{signature.name}(" for signature in SIGNATURES)
    for known in (*keys, *WORDS, *functions):
        if known.startswith(word) and known != word:
            return known[len(word) :]
    return ""


def _truth_text(expression: Expression, memory: Mapping[str, Json]) -> str:
    """Whether the expression holds with these values, or why that is unknown."""
    if expression.draws:
        return "chance decides each time"
    for key in sorted(expression.keys - expression.keys_of_parts_only):
        if key.partition(".")[0] == SESSION and not lookup(memory, key)[0]:
            return f"`{key}` is known when a session runs"
    _, values, holds, error = truth_of(expression, memory, short_value)
    if error:
        return f"these values give no result: {error.removeprefix(f'{MISSING_PART}: ')}"
    truth = "true" if holds else "false"
    return f"{values} at the start: {truth}" if values else f"always {truth}"


def _readable_beginning(text: str) -> Expression | None:
    ends = [found.end() for found in _WORD.finditer(text)][:-1]
    for end in reversed(ends[-MAX_CUTS:]):
        try:
            return Expression.parse(text[:end])
        except ExpressionError:
            continue
    return None


def _without_blanks(text: str) -> str:
    """A text for comparison, without blanks; `=` and `==` are the same."""
    return re.sub(r"\s+", "", text.replace("==", "=").replace("'", '"'))
