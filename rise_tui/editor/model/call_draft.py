"""A function of a rule in its form: what to do first, then with what. Pure."""

from __future__ import annotations

import re
from typing import Literal, NamedTuple, TypeAlias

from rise_engine.author.edit.edits import CallForm
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.expression import Assignment, Environment, EvaluationError, ExpressionError, lookup
from rise_engine.scenario.durations import MAX_SECONDS, parse_time
from rise_engine.scenario.element_reader import MIN_SECONDS
from rise_engine.scenario.memory import is_writable_key
from rise_engine.scenario.model import FunctionName, normal_topic
from rise_tui.editor.model.condition_reading import FieldNote, unknown_key_notes, values_text
from rise_tui.editor.model.study_names import NameChoice, StudyNames, short_value

CallField: TypeAlias = Literal["function", "act", "rule", "state", "enter", "event", "keep", "key", "value"]

CALL_FIELDS: dict[FunctionName, tuple[CallField, ...]] = {
    "startCommunicationRobotAct": ("function", "act"),
    "stopCommunicationRobotAct": ("function", "act"),
    "startInteractionRule": ("function", "rule", "state", "enter"),
    "stopInteractionRule": ("function", "rule"),
    "raiseEventTopic": ("function", "event", "keep"),
    "assignValue": ("function", "key", "value"),
}
_ASSIGNED = re.compile(r"\s*((?:[^=\"'\[\]]|\[[^\]]*\])+?)\s*=(?!=)\s*(.*)\Z", re.DOTALL)


class CallDraft(NamedTuple):
    """The form as it is filled in. What belongs to another function than the chosen one is kept until it is left."""

    function: FunctionName = "startCommunicationRobotAct"
    act: str = ""
    rule: str = ""
    state: str = ""
    enter: bool = True
    event: str = ""
    keep: str = ""
    key: str = ""
    value: str = ""

    @classmethod
    def of(cls, call: CallForm) -> CallDraft:
        draft = cls(call.function, state=call.state or "", enter=call.enter, keep=call.keep or "")
        match call.function:
            case "startCommunicationRobotAct" | "stopCommunicationRobotAct":
                return draft._replace(act=call.argument)
            case "startInteractionRule" | "stopInteractionRule":
                return draft._replace(rule=call.argument)
            case "raiseEventTopic":
                return draft._replace(event=call.argument)
            case "assignValue":
                assigned = _ASSIGNED.match(call.argument)
                if assigned is None:  # an object, or something unfinished
                    return draft._replace(value=call.argument)
                return draft._replace(key=assigned[1], value=assigned[2])

    @property
    def fields(self) -> tuple[CallField, ...]:
        return CALL_FIELDS[self.function]

    def form(self) -> CallForm:
        """What is to be written."""
        function = self.function
        match function:
            case "startCommunicationRobotAct" | "stopCommunicationRobotAct":
                return CallForm(function, self.act.strip())
            case "startInteractionRule":
                return CallForm(function, self.rule.strip(), state=self.state.strip() or None, enter=self.enter)
            case "stopInteractionRule":
                return CallForm(function, self.rule.strip())
            case "raiseEventTopic":
                topic = normal_topic(self.event)
                return CallForm(function, f"/{topic}" if topic else "", keep=self.keep.strip() or None)
            case "assignValue":
                key, value = self.key.strip(), self.value.strip()
                return CallForm(function, f"{key} = {value}" if key else value)


def is_changed(draft: CallDraft, was: CallForm) -> bool:
    return draft != CallDraft.of(was)


def call_notes(draft: CallDraft, names: StudyNames) -> dict[CallField, list[FieldNote]]:
    """What is to be said about each field."""
    notes: dict[CallField, list[FieldNote]] = {}
    match draft.function:
        case "startCommunicationRobotAct" | "stopCommunicationRobotAct":
            notes["act"] = _name_notes(draft.act, names.acts, "act")
        case "stopInteractionRule":
            notes["rule"] = _name_notes(draft.rule, names.rules, "rule")
        case "startInteractionRule":
            notes["rule"] = _name_notes(draft.rule, names.rules, "rule")
            notes["state"] = _state_notes(draft, names)
            if not draft.enter:
                notes["enter"] = [FieldNote("info", "it waits there without doing what it does on entry")]
        case "raiseEventTopic":
            notes["event"] = _event_notes(draft.event, names)
            notes["keep"] = _keep_notes(draft.keep)
        case "assignValue":
            notes["key"], notes["value"] = _assignment_notes(draft, names)
    return notes


def choices_for(field: CallField, draft: CallDraft, names: StudyNames) -> list[NameChoice]:
    """What can be chosen for a field; empty: it is written."""
    match field:
        case "act":
            return names.act_choices()
        case "rule":
            return names.rule_choices()
        case "state":
            return [NameChoice(state) for state in names.states_of(draft.rule.strip())]
        case "event":
            own = sorted({*names.raised, *names.awaited}, key=str.casefold)
            return [NameChoice(f"/{event}", _awaited_note(event, names)) for event in own]
        case "key":
            return [choice for choice in names.key_choices() if choice.name not in names.tables]
        case _:
            return []


def _name_notes(name: str, known: list[str], kind: str) -> list[FieldNote]:
    name = name.strip()
    if not name:
        return [FieldNote("error", f"which {kind}? F2 lists them")]
    if name not in known:
        return [FieldNote("error", f"there is no {kind} `{name}`{did_you_mean(name, known, limit=0)}")]
    return []


def _state_notes(draft: CallDraft, names: StudyNames) -> list[FieldNote]:
    state, states = draft.state.strip(), names.states_of(draft.rule.strip())
    if not state:
        return [FieldNote("info", "where it begins: its first state")]
    if states and state not in states:
        return [FieldNote("error", f"the rule has no state `{state}`{did_you_mean(state, states, limit=0)}")]
    return []


def _awaited_note(event: str, names: StudyNames) -> str:
    return "a rule waits for it" if event in names.awaited else "no rule waits for it"


def _event_notes(event: str, names: StudyNames) -> list[FieldNote]:
    topic = normal_topic(event)
    if not topic:
        return [FieldNote("error", "which event? F2 lists them; a new name makes one")]
    if topic in names.awaited:
        return [FieldNote("info", "a rule waits for it")]
    return [FieldNote("warning", f"no rule waits for it{did_you_mean(topic, names.awaited, limit=0)}")]


def _keep_notes(keep: str) -> list[FieldNote]:
    if not keep.strip():
        return [FieldNote("info", "nobody waits at that moment: it is lost")]
    seconds = parse_time(keep)
    if seconds is None:
        return [FieldNote("error", f"`{keep.strip()}` is not a time; write 500ms, 2s or 3min")]
    if not MIN_SECONDS <= seconds <= MAX_SECONDS:
        return [FieldNote("error", "a time is from 1ms to 24 hours (1440min)")]
    return [FieldNote("info", f"nobody waits at that moment: it is kept for {seconds:g} s")]


def _assignment_notes(draft: CallDraft, names: StudyNames) -> tuple[list[FieldNote], list[FieldNote]]:
    """What is to be said about the key, and about the value."""
    key, text = draft.key.strip(), draft.form().argument
    if not key and not text.startswith("{"):
        return [FieldNote("error", "which memory key? F2 lists them; a new name makes one")], []
    try:
        assignment = Assignment.parse(text)
    except ExpressionError as error:
        problem = FieldNote("error", f"{error.message}; {error.hint}" if error.hint else error.message)
        behind = error.column > len(key) and bool(draft.value.strip() or key)
        return ([], [problem]) if behind else ([problem], [])
    return _key_notes(assignment, names), _value_notes(assignment, names)


def _key_notes(assignment: Assignment, names: StudyNames) -> list[FieldNote]:
    key = assignment.key
    if key.partition(".")[0] in names.tables:
        return [FieldNote("error", f"`{key}` is a table, which is only read")]
    if not is_writable_key(key):
        return [FieldNote("warning", "such a key cannot be asked for in a condition")]
    if key in names.memory or key in names.set_keys:
        return [FieldNote("info", names.start_note(key))]
    near = did_you_mean(key, (*names.memory, *names.set_keys), limit=0)
    return [FieldNote("info", f"a new memory key{near}")]


def _value_notes(assignment: Assignment, names: StudyNames) -> list[FieldNote]:
    expression = assignment.expression
    if expression is None:
        return []
    word = assignment.bare_word
    if word is not None and not names.memory_paths.is_known(word):
        return [FieldNote("warning", f"no memory key is called so: it is taken as the text “{word}”; write '{word}'")]
    notes = [FieldNote("warning", each) for each in unknown_key_notes(expression, names)]
    if expression.draws:
        return [*notes, FieldNote("info", "chance decides it, each time anew")]
    try:
        key, value = assignment.entry(Environment(names.memory), names.set_keys)
    except EvaluationError as error:
        return [*notes, FieldNote("warning", f"with the values of the start: {error}")]
    if assignment.target is not None:
        return notes
    found, value = lookup({key: value}, assignment.key)
    values = values_text(expression, names.memory)
    if not found or not values:
        return notes
    return [*notes, FieldNote("info", f"{values} at the start: {assignment.key} becomes {short_value(value)}")]
