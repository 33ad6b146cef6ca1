"""The forms of a rule's function, and of the condition around it. Pure."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, TypeAlias

from rise_engine.author.edit.edits import (
    AddBranch,
    AddStatement,
    AnyEdit,
    BranchForm,
    CallForm,
    IfForm,
    RemoveStatement,
    SetBranchCondition,
    SetCall,
    StatementAddress,
)
from rise_engine.author.edit.rule_words import FUNCTION_WORDS
from rise_engine.expression import Assignment, Environment, EvaluationError, ExpressionError, lookup
from rise_engine.scenario.durations import parse_time
from rise_engine.scenario.grammar import FUNCTIONS
from rise_engine.scenario.model import FunctionName, normal_topic
from rise_tui.editor.model.condition_reading import condition_notes, suggest_ending, values_text
from rise_tui.editor.model.fields import EditField, FieldChoice, FieldNote, RuleForm, text_field
from rise_tui.editor.model.study_names import StudyNames, short_value

CALL_FIELDS: dict[FunctionName, tuple[str, ...]] = {
    "startCommunicationRobotAct": ("function", "act"),
    "stopCommunicationRobotAct": ("function", "act"),
    "startInteractionRule": ("function", "rule", "state", "enter"),
    "stopInteractionRule": ("function", "rule"),
    "raiseEventTopic": ("function", "event", "keep"),
    "assignValue": ("function", "key", "value"),
}
_ASSIGNED = re.compile(r"\s*((?:[^=\"'\[\]]|\[[^\]]*\])+?)\s*=(?!=)\s*(.*)\Z", re.DOTALL)


class CallDraft(NamedTuple):
    """The values of the form. Values for other functions than the chosen one stay until the form closes."""

    function: FunctionName = "startCommunicationRobotAct"
    act: str = ""
    rule: str = ""
    state: str = ""
    enter: str = "yes"
    event: str = ""
    keep: str = ""
    key: str = ""
    value: str = ""

    @classmethod
    def of(cls, call: CallForm) -> CallDraft:
        enter = "yes" if call.enter else "no"
        draft = cls(call.function, state=call.state or "", enter=enter, keep=call.keep or "")
        match call.function:
            case "startCommunicationRobotAct" | "stopCommunicationRobotAct":
                return draft._replace(act=call.argument)
            case "startInteractionRule" | "stopInteractionRule":
                return draft._replace(rule=call.argument)
            case "raiseEventTopic":
                return draft._replace(event=call.argument)
            case "assignValue":
                assigned = _ASSIGNED.match(call.argument)
                if assigned is None:  # an object, or unfinished input
                    return draft._replace(value=call.argument)
                return draft._replace(key=assigned[1], value=assigned[2])

    def form(self) -> CallForm:
        """The function, ready to be written."""
        function = self.function
        match function:
            case "startCommunicationRobotAct" | "stopCommunicationRobotAct":
                return CallForm(function, self.act.strip())
            case "startInteractionRule":
                return CallForm(
                    function, self.rule.strip(), state=self.state.strip() or None, enter=self.enter == "yes"
                )
            case "stopInteractionRule":
                return CallForm(function, self.rule.strip())
            case "raiseEventTopic":
                topic = normal_topic(self.event)
                return CallForm(function, f"/{topic}" if topic else "", keep=self.keep.strip() or None)
            case "assignValue":
                key, value = self.key.strip(), self.value.strip()
                return CallForm(function, f"{key} = {value}" if key else value)


@dataclass(frozen=True)
class CallRuleForm(RuleForm):
    """A function, changed or new."""

    names: StudyNames
    draft: CallDraft
    at: StatementAddress
    """The function's address; for a new one, the address of the statement after it."""
    was: CallForm | None = None

    @property
    def title(self) -> str:  # type: ignore[override]
        return f"{self.at.state}: {'a function' if self.was is not None else 'a new function'}"

    @property
    def fields(self) -> tuple[EditField, ...]:
        draft = self.draft
        functions = [FieldChoice(name, FUNCTION_WORDS[name]) for name in FUNCTIONS]
        enters = [FieldChoice("yes", "is done"), FieldChoice("no", "is left out")]
        every = (
            EditField("function", "do", "option", draft.function, choices=functions),
            text_field("act", "act", draft.act),
            text_field("rule", "rule", draft.rule),
            text_field("state", "in state", draft.state, "its first state"),
            EditField("enter", "on entry", "option", draft.enter, choices=enters),
            text_field("event", "event", draft.event, new="a new event"),
            text_field("keep", "kept for", draft.keep, "not at all; or 500ms, 2s, 3min"),
            text_field("key", "key", draft.key, new="a new memory key"),
            text_field("value", "becomes", draft.value, "2, true, 'a text', step + 1"),
        )
        return tuple(each for each in every if each.id in CALL_FIELDS[draft.function])

    def with_value(self, field: str, value: str) -> CallRuleForm:
        values: dict[str, Any] = {field: value}
        return replace(self, draft=self.draft._replace(**values))

    def notes(self, field: str) -> list[FieldNote]:
        draft, names = self.draft, self.names
        match field:
            case "enter" if draft.enter == "no":
                return [FieldNote("info", "it waits there without doing what it does on entry")]
            case "event" if normal_topic(draft.event) in names.awaited:
                return [FieldNote("info", "a rule waits for it")]
            case "keep":
                seconds = parse_time(draft.keep)
                kept = f"it is kept for {seconds:g} s" if seconds is not None else "it is lost"
                return [FieldNote("info", f"if no rule waits at that moment, {kept}")]
            case "key" if draft.key.strip() and draft.key.strip() in {*names.memory, *names.set_keys}:
                return [FieldNote("info", names.start_note(draft.key.strip()))]
            case "value":
                return self._value_notes()
            case _:
                return []

    def _value_notes(self) -> list[FieldNote]:
        """The value that the key would get at the start."""
        try:
            assignment = Assignment.parse(self.draft.form().argument)
        except ExpressionError:
            return []
        expression = assignment.expression
        if expression is None or assignment.target is not None:
            return []
        if expression.draws:
            return [FieldNote("info", "chance decides each time")]
        try:
            key, value = assignment.entry(Environment(self.names.memory), self.names.set_keys)
        except EvaluationError:
            return []
        found, value = lookup({key: value}, assignment.key)
        values = values_text(expression, self.names.memory)
        if not found or not values:
            return []
        return [FieldNote("info", f"{values} at the start: {assignment.key} becomes {short_value(value)}")]

    def edits(self) -> tuple[AnyEdit, ...]:
        if self.was is None:
            return (AddStatement(self.at, self.draft.form()),)
        return (SetCall(self.at, self.draft.form()),) if self.draft != CallDraft.of(self.was) else ()

    def choices(self, field: str) -> list[FieldChoice]:
        names = self.names
        match field:
            case "act":
                return names.act_choices()
            case "rule":
                return names.rule_choices()
            case "state":
                return [FieldChoice(state, state) for state in names.states_of(self.draft.rule.strip())]
            case "event":
                return names.own_event_choices()
            case "key":
                return [choice for choice in names.key_choices() if choice.value not in names.tables]
            case "value":
                return names.key_choices()
            case _:
                return []

    def ending(self, field: str, text: str) -> str:
        return suggest_ending(text, self.names) if field == "value" else super().ending(field, text)

    def missing(self) -> str:
        return "" if self.draft.form().argument.strip("/ =") else "it does nothing yet: fill in the field, or esc"


ConditionUse: TypeAlias = Literal["wrap", "change", "otherwise"]


@dataclass(frozen=True)
class ConditionRuleForm(RuleForm):
    """The condition of a branch: for a function in a new `if`, a changed condition, or a new branch."""

    names: StudyNames
    at: StatementAddress
    """The address of the function, of the branch, or of the new branch."""
    use: ConditionUse
    condition: str = ""
    was: str = ""
    call: CallForm | None = None
    """The function for a new `if`."""
    can_be_else: bool = True

    @property
    def title(self) -> str:  # type: ignore[override]
        words = {"wrap": "do this only if", "change": "a condition", "otherwise": "otherwise"}
        return f"{self.at.state}: {words[self.use]}"

    @property
    def fields(self) -> tuple[EditField, ...]:
        is_arm = self.use == "otherwise"
        empty = "empty: in every other case" if is_arm and self.can_be_else else ""
        return (text_field("condition", "but if" if is_arm else "only if", self.condition, empty),)

    def with_value(self, field: str, value: str) -> ConditionRuleForm:
        return replace(self, condition=value)

    def notes(self, field: str) -> list[FieldNote]:
        return condition_notes(self.condition, self.names)

    def edits(self) -> tuple[AnyEdit, ...]:
        condition = self.condition.strip()
        match self.use:
            case "wrap":
                block = (self.call,) if self.call is not None else ()
                return (RemoveStatement(self.at), AddStatement(self.at, IfForm((BranchForm(condition, block),))))
            case "otherwise":
                return (AddBranch(self.at, condition or None),)
            case "change":
                return (SetBranchCondition(self.at, condition),) if condition != self.was.strip() else ()

    def choices(self, field: str) -> list[FieldChoice]:
        return self.names.key_choices()

    def ending(self, field: str, text: str) -> str:
        return suggest_ending(text, self.names)

    def missing(self) -> str:
        if self.condition.strip() or (self.use == "otherwise" and self.can_be_else):
            return ""
        return "say what must be true, or leave with esc"
