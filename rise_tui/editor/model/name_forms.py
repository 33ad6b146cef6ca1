"""The small forms of a rule: names, the parameters of a template, a key of the keyboard for an event. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, TypeAlias

from rise_engine.author.edit.edits import AddState, AnyEdit, Rename, SetSetting, SetUseParameter
from rise_engine.author.edit.outline import WrittenRule, WrittenUse
from rise_engine.scenario.keys import KeyRefusedError, bindable_key_name
from rise_tui.editor.model.fields import EditField, FieldNote, RuleForm, text_field
from rise_tui.editor.model.study_names import StudyNames


@dataclass(frozen=True)
class TemplateValueForm(RuleForm):
    """A parameter of a `<use>`, in which a template's states differ."""

    use: WrittenUse
    parameter: str
    value: str

    @property
    def title(self) -> str:  # type: ignore[override]
        return f"the template {self.use.template}, used in line {self.use.line}"

    @property
    def fields(self) -> tuple[EditField, ...]:
        default = self.use.parameters.get(self.parameter)
        empty = f"as the template says: {default}" if default else ""
        return (text_field("parameter", self.parameter, self.value, empty),)

    def with_value(self, field: str, value: str) -> TemplateValueForm:
        return replace(self, value=value)

    def notes(self, field: str) -> list[FieldNote]:
        return [FieldNote("info", "everything from this use of the template changes with it")]

    def edits(self) -> tuple[AnyEdit, ...]:
        given = self.use.values.get(self.parameter)
        value = self.value if self.value.strip() else None
        if value == (given.text if given is not None else None):
            return ()
        return (SetUseParameter(self.use.file, self.use.line, self.use.template, self.parameter, value),)


NamePurpose: TypeAlias = Literal["new state", "rename state"]


@dataclass(frozen=True)
class NameForm(RuleForm):
    """The name of a new state, or a new name for a state."""

    rule: WrittenRule
    purpose: NamePurpose
    name: str
    state: str = ""
    """The state to rename, or the one before the new state."""

    @property
    def title(self) -> str:  # type: ignore[override]
        return "a new state" if self.purpose == "new state" else f"{self.state}: another name"

    @property
    def fields(self) -> tuple[EditField, ...]:
        return (text_field("name", "name", self.name, ""),)

    def with_value(self, field: str, value: str) -> NameForm:
        return replace(self, name=value)

    def notes(self, field: str) -> list[FieldNote]:
        new = "no transition leads to it yet"
        return [FieldNote("info", new if self.purpose == "new state" else "it is renamed everywhere")]

    def edits(self) -> tuple[AnyEdit, ...]:
        name = self.name.strip()
        if self.purpose == "new state":
            return (AddState(self.rule.name, name, after=self.state),)
        return () if name == self.state else (Rename("state", f"{self.rule.name}/{self.state}", name),)

    def missing(self) -> str:
        return "" if self.name.strip() else "it needs a name"


@dataclass(frozen=True)
class EventKeyForm(RuleForm):
    """A key of the keyboard for an event that nothing raises."""

    names: StudyNames
    event: str
    key: str = ""
    label: str = ""

    @property
    def title(self) -> str:  # type: ignore[override]
        return f"a key that raises /{self.event}"

    @property
    def fields(self) -> tuple[EditField, ...]:
        return (
            text_field("key", "key", self.key, "a letter, a digit, F5"),
            text_field("label", "means", self.label, "the wizard reads it beside the key; may stay empty"),
        )

    def with_value(self, field: str, value: str) -> EventKeyForm:
        return replace(self, key=value) if field == "key" else replace(self, label=value)

    def edits(self) -> tuple[AnyEdit, ...]:
        binding = {"event": f"/{self.event}"} | ({"label": self.label.strip()} if self.label.strip() else {})
        return (SetSetting(("keys", self.key.strip()), binding),)

    def missing(self) -> str:
        """What is missing, or why this key cannot be used: setting it would replace what it does now."""
        key = self.key.strip()
        if not key:
            return "which key?"
        try:
            name = bindable_key_name(key)
        except KeyRefusedError as error:
            return str(error)
        return f"the key {key} does something else already" if name in self._taken() else ""

    def _taken(self) -> set[str]:
        """The names of keys of the keyboard that already do something."""
        found: set[str] = set()
        for key in self.names.keyboard:
            try:
                found.add(bindable_key_name(key))
            except KeyRefusedError:
                continue
        return found
