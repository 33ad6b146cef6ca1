"""The forms of a rule's function, of the condition around it, and of a template's arguments. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from rise_engine.author.drawing.rule_text import truth_of
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
    SetUseParameter,
    StatementAddress,
)
from rise_engine.author.edit.outline import FUNCTION_WORDS, WrittenUse
from rise_engine.author.edit.plan import EditRefused
from rise_engine.expression import Assignment, Environment, EvaluationError, ExpressionError, lookup
from rise_engine.scenario.durations import parse_time
from rise_engine.scenario.model import FunctionName, normal_topic
from rise_tui.editor.model.fields import EditField, FieldChoice, FieldNote, Form, info
from rise_tui.editor.model.study_names import StudyNames, condition_field, short_value

CALL_FIELDS: dict[FunctionName, tuple[str, ...]] = {
    "startCommunicationRobotAct": ("function", "act"),
    "stopCommunicationRobotAct": ("function", "act"),
    "startInteractionRule": ("function", "rule", "state", "enter"),
    "stopInteractionRule": ("function", "rule"),
    "raiseEventTopic": ("function", "event", "keep"),
    "assignValue": ("function", "key", "value"),
}
"""The fields of a function in order. The second one has its argument, or the start of it."""
WITHOUT_ENTRY = "it waits there without doing what it does on entry"
_ASSIGNED = re.compile(r"\s*((?:[^=\"'\[\]]|\[[^\]]*\])+?)\s*=(?!=)\s*(.*)\Z", re.DOTALL)


def call_values(call: CallForm) -> dict[str, str]:
    """The values of the form for a function."""
    _, argument, *_ = CALL_FIELDS[call.function]
    enter = "yes" if call.enter else "no"
    values = {"function": call.function, "state": call.state or "", "enter": enter, "keep": call.keep or ""}
    if call.function != "assignValue":
        return {**values, argument: call.argument}
    assigned = _ASSIGNED.match(call.argument)
    if assigned is None:  # an object, or unfinished input
        return {**values, "value": call.argument}
    return {**values, "key": assigned[1], "value": assigned[2]}


def call_of(values: Mapping[str, str]) -> CallForm:
    """The function that the shown fields describe, ready to be written."""
    function = next(each for each in CALL_FIELDS if each == values["function"])
    given = {field: values.get(field, "").strip() for field in CALL_FIELDS[function]}
    argument = given[CALL_FIELDS[function][1]]
    if function == "raiseEventTopic":
        topic = normal_topic(argument)
        argument = f"/{topic}" if topic else ""
    elif function == "assignValue":
        argument = f"{argument} = {given['value']}" if argument else given["value"]
    state, keep = given.get("state") or None, given.get("keep") or None
    return CallForm(function, argument, state=state, enter=given.get("enter") != "no", keep=keep)


@dataclass(frozen=True)
class CallRuleForm(Form):
    """A function, changed or new."""

    names: StudyNames
    at: StatementAddress
    """The function's address; for a new one, the address of the statement after it."""
    was: CallForm | None = None

    @property
    def title(self) -> str:
        return f"{self.at.state}: {'a function' if self.was is not None else 'a new function'}"

    @property
    def fields(self) -> Sequence[EditField]:
        names, function = self.names, call_of(self.values).function
        states = [FieldChoice(state, state) for state in names.states_of(self.value("rule"))]
        keys, key = names.key_choices(), self.value("key")
        plain_keys = [each for each in keys if each.value not in names.tables]
        waits = "a rule waits for it" if normal_topic(self.value("event")) in names.awaited else ""
        start = names.start_note(key) if key in {*names.memory, *names.set_keys} else ""
        enter = self.options("enter", "on entry", {"yes": "is done", "no": "is left out"})
        value = self.text("value", "becomes", "2, true, 'a text', step + 1", choices=keys)
        every = (
            self.options("function", "do", {name: FUNCTION_WORDS[name] for name in CALL_FIELDS}),
            self.text("act", "act", choices=names.act_choices()),
            self.text("rule", "rule", choices=names.rule_choices()),
            self.text("state", "in state", "its first state", choices=states),
            enter._replace(remarks=info(WITHOUT_ENTRY if enter.text == "no" else "")),
            self.text("event", "event", new="a new event", choices=names.own_event_choices(), remarks=info(waits)),
            self.text("keep", "kept for", "not at all; or 500ms, 2s, 3min", remarks=self._keep_remarks()),
            self.text("key", "key", new="a new memory key", choices=plain_keys, remarks=info(start)),
            value._replace(remarks=self._value_remarks(), is_expression=True),
        )
        return [each for each in every if each.id in CALL_FIELDS[function]]

    def _keep_remarks(self) -> list[FieldNote]:
        seconds = parse_time(self.value("keep"))
        kept = f"it is kept for {seconds:g} s" if seconds is not None else "it is lost"
        return info(f"if no rule waits at that moment, {kept}")

    def _value_remarks(self) -> list[FieldNote]:
        """The value that the key would get at the start."""
        memory = self.names.memory
        try:
            assignment = Assignment.parse(call_of({**self.values, "function": "assignValue"}).argument)
            expression = assignment.expression
            if expression is None or assignment.target is not None:
                return []
            if expression.draws:
                return info("chance decides each time")
            key, value = assignment.entry(Environment(memory), self.names.set_keys)
        except (ExpressionError, EvaluationError):
            return []
        found, value = lookup({key: value}, assignment.key)
        values = truth_of(expression, memory, short_value).values
        becomes = f"{values} at the start: {assignment.key} becomes {short_value(value)}"
        return info(becomes if found and values else "")

    def edits(self) -> tuple[AnyEdit, ...]:
        call = call_of(self.values)
        if not call.argument.strip("/ ="):
            raise EditRefused("it does nothing yet: fill in the field, or esc")
        if self.was is None:
            return (AddStatement(self.at, call),)
        return (SetCall(self.at, call),) if self.values != call_values(self.was) else ()


ConditionUse: TypeAlias = Literal["wrap", "change", "otherwise"]
CONDITION_TITLES: dict[ConditionUse, str] = {
    "wrap": "do this only if",
    "change": "a condition",
    "otherwise": "otherwise",
}


@dataclass(frozen=True)
class ConditionRuleForm(Form):
    """The condition of a branch: for a function in a new `if`, a changed condition, or a new branch."""

    names: StudyNames
    at: StatementAddress
    """The address of the function, of the branch, or of the new branch."""
    use: ConditionUse
    was: str = ""
    call: CallForm | None = None
    """The function for a new `if`."""
    can_be_else: bool = False
    """Whether a new branch may have no condition."""

    @property
    def title(self) -> str:
        return f"{self.at.state}: {CONDITION_TITLES[self.use]}"

    @property
    def fields(self) -> Sequence[EditField]:
        empty = "empty: in every other case" if self.can_be_else else ""
        label = "but if" if self.use == "otherwise" else "only if"
        return (condition_field(self, self.names, "condition", label, empty),)

    def edits(self) -> tuple[AnyEdit, ...]:
        condition = self.value("condition")
        if not condition and not self.can_be_else:
            raise EditRefused("say what must be true, or leave with esc")
        match self.use:
            case "wrap":
                block = (self.call,) if self.call is not None else ()
                return (RemoveStatement(self.at), AddStatement(self.at, IfForm((BranchForm(condition, block),))))
            case "otherwise":
                return (AddBranch(self.at, condition or None),)
            case "change":
                return (SetBranchCondition(self.at, condition),) if condition != self.was.strip() else ()


@dataclass(frozen=True)
class TemplateValueForm(Form):
    """A parameter of a `<use>`, in which a template's states differ."""

    use: WrittenUse
    parameter: str

    @property
    def title(self) -> str:
        return f"the template {self.use.template}, used in line {self.use.line}"

    @property
    def fields(self) -> Sequence[EditField]:
        default = self.use.parameters.get(self.parameter)
        empty = f"as the template says: {default}" if default else ""
        remarks = info("everything from this use of the template changes with it")
        return (self.text("value", self.parameter, empty, remarks=remarks),)

    def edits(self) -> tuple[AnyEdit, ...]:
        use, given = self.use, self.use.values.get(self.parameter)
        value = self.values["value"] if self.value("value") else None
        if value == (given.text if given is not None else None):
            return ()
        return (SetUseParameter(use.file, use.line, use.template, self.parameter, value),)
