"""The small forms of a rule: names, what is given to a template, a key of the keyboard for an event. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from rise_engine.author.edit.edits import (
    AddState,
    AnyEdit,
    Rename,
    SetInitial,
    SetSetting,
    SetUseParameter,
)
from rise_engine.author.edit.outline import WrittenRule, WrittenUse
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.keys import KeyRefusedError, bindable_key_name
from rise_tui.editor.model.condition_reading import FieldNote
from rise_tui.editor.model.form import RuleField, RuleForm
from rise_tui.editor.model.study_names import StudyNames


@dataclass(frozen=True)
class TemplateValueForm(RuleForm):
    """A parameter of a `<use>`, by which the states of a template differ."""

    use: WrittenUse
    parameter: str
    value: str

    @property
    def title(self) -> str:  # type: ignore[override]
        return f"the template {self.use.template}, used in line {self.use.line}"

    @property
    def fields(self) -> tuple[RuleField, ...]:
        default = self.use.parameters.get(self.parameter)
        placeholder = f"as the template says: {default}" if default else ""
        return (RuleField("value", self.parameter, self.value, placeholder=placeholder, notes=2),)

    def with_value(self, field: str, value: str) -> TemplateValueForm:
        return replace(self, value=value)

    def notes(self) -> dict[str, list[FieldNote]]:
        if not self.value.strip() and self.use.parameters.get(self.parameter) is None:
            return {"value": [FieldNote("error", "this parameter must be given")]}
        return {"value": [FieldNote("info", "everything that this use of the template brings changes with it")]}

    def edits(self) -> tuple[AnyEdit, ...]:
        given = self.use.values.get(self.parameter)
        value = self.value if self.value.strip() else None
        if value == (given.text if given is not None else None):
            return ()
        return (SetUseParameter(self.use.file, self.use.line, self.use.template, self.parameter, value),)


NamePurpose: TypeAlias = Literal["new state", "rename state", "rename rule"]


@dataclass(frozen=True)
class NameForm(RuleForm):
    """A new name: of a state that is made, of a state or a rule that is called otherwise everywhere."""

    names: StudyNames
    rule: WrittenRule
    purpose: NamePurpose
    name: str
    state: str = ""
    """The state that is renamed, or behind which the new one stands."""

    @property
    def title(self) -> str:  # type: ignore[override]
        words = {"new state": "a new state", "rename state": f"{self.state}: another name", "rename rule": ""}
        return words[self.purpose] or f"the rule {self.rule.name}: another name"

    @property
    def fields(self) -> tuple[RuleField, ...]:
        return (RuleField("name", "name", self.name),)

    def with_value(self, field: str, value: str) -> NameForm:
        return replace(self, name=value)

    @property
    def _taken(self) -> list[str]:
        if self.purpose == "rename rule":
            return [name for name in self.names.rules if name != self.rule.name]
        return [state.id for state in self.rule.states if self.purpose == "new state" or state.id != self.state]

    def notes(self) -> dict[str, list[FieldNote]]:
        name = self.name.strip()
        if name in self._taken:
            return {"name": [FieldNote("error", "there is one of this name already")]}
        if self.purpose == "new state":
            near = did_you_mean(name, self._taken, limit=0) if name else ""
            return {"name": [FieldNote("info", f"no way leads to it yet{near}")] if name else []}
        return {"name": [FieldNote("info", "every place that names it changes with it")]}

    def edits(self) -> tuple[AnyEdit, ...]:
        name = self.name.strip()
        match self.purpose:
            case "new state":
                return (AddState(self.rule.name, name, after=self.state),)
            case "rename state":
                return () if name == self.state else (Rename("state", f"{self.rule.name}/{self.state}", name),)
            case "rename rule":
                return () if name == self.rule.name else (Rename("rule", self.rule.name, name),)

    def missing(self) -> str:
        if not self.name.strip():
            return "it needs a name"
        return "there is one of this name already" if self.name.strip() in self._taken else ""


@dataclass(frozen=True)
class EventKeyForm(RuleForm):
    """A key of the keyboard for an event that nobody raises."""

    names: StudyNames
    event: str
    key: str = ""
    label: str = ""

    @property
    def title(self) -> str:  # type: ignore[override]
        return f"a key that raises /{self.event}"

    @property
    def fields(self) -> tuple[RuleField, ...]:
        return (
            RuleField("key", "key", self.key, placeholder="a letter, a digit, F5"),
            RuleField("label", "means", self.label, placeholder="what the wizard reads beside it; may stay empty"),
        )

    def with_value(self, field: str, value: str) -> EventKeyForm:
        return replace(self, key=value) if field == "key" else replace(self, label=value)

    def _problem(self) -> str:
        key = self.key.strip()
        if not key:
            return "which key?"
        try:
            name = bindable_key_name(key)
        except KeyRefusedError as error:
            return str(error)
        for other in self.names.keyboard:
            try:
                if bindable_key_name(other) == name:
                    return f"the key {other} does something else already"
            except KeyRefusedError:
                continue
        return ""

    def notes(self) -> dict[str, list[FieldNote]]:
        problem = self._problem()
        return {"key": [FieldNote("error", problem)] if problem else [FieldNote("info", "it is free")]}

    def edits(self) -> tuple[AnyEdit, ...]:
        binding = {"event": f"/{self.event}"} | ({"label": self.label.strip()} if self.label.strip() else {})
        return (SetSetting(("keys", self.key.strip()), binding),)

    def missing(self) -> str:
        return self._problem()


def make_first(rule: WrittenRule, state: str) -> tuple[AnyEdit, ...]:
    """The rule begins in this state."""
    return () if rule.initial == state else (SetInitial(rule.name, state),)
