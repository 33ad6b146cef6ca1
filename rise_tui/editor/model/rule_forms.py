"""The forms of what a rule waits for and does: ways out, functions, conditions. Pure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, TypeAlias

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
    TransitionForm,
)
from rise_engine.author.edit.outline import WrittenRule
from rise_engine.author.edit.rule_words import FUNCTION_WORDS
from rise_engine.scenario.blocks import FUNCTIONS
from rise_engine.scenario.model import normal_topic
from rise_tui.editor.model.call_draft import CallDraft, call_notes, choices_for, is_changed
from rise_tui.editor.model.condition_reading import FieldNote, read_condition, reading_notes, suggest_ending
from rise_tui.editor.model.form import RuleField, RuleForm, complete_name
from rise_tui.editor.model.study_names import NameChoice, StudyNames, acts_started_by
from rise_tui.editor.model.transition_draft import (
    OUTCOMES,
    TRIGGER_WORDS,
    TRIGGERS,
    TransitionDraft,
    edits_for,
    transition_notes,
)


@dataclass(frozen=True)
class TransitionRuleForm(RuleForm):
    """A way out of a state."""

    names: StudyNames
    rule: WrittenRule
    state: str
    draft: TransitionDraft
    index: int | None = None
    """Its number; None: a new one."""
    was: TransitionForm | None = None
    has_functions: bool = False
    ways: int = 0
    """How many the state has."""

    @property
    def is_new(self) -> bool:
        return self.was is None

    @property
    def title(self) -> str:  # type: ignore[override]
        which = f"way {self.index + 1} of {self.ways}" if self.index is not None else "a new way out"
        return f"{self.state}: {which}"

    @property
    def fields(self) -> tuple[RuleField, ...]:
        draft = self.draft
        triggers = tuple((each, TRIGGER_WORDS[each]) for each in TRIGGERS)
        guard = "" if draft.trigger == "condition" else "at that moment"
        empty = "step = 2, or a memory key that is true" if draft.trigger == "condition" else "–"
        condition = "this is true" if draft.trigger == "condition" else "but only if"
        every = {
            "trigger": RuleField("trigger", "as soon as", draft.trigger, "choice", triggers),
            "event": RuleField(
                "event", "event", draft.event, placeholder="its name; F2 lists them", has_list=True, new="a new event"
            ),
            "act": RuleField("act", "act", draft.act, placeholder="one that this rule has started", has_list=True),
            "outcomes": RuleField(
                "outcomes",
                "has",
                " ".join(draft.outcomes),
                "ticks",
                tuple((each, each) for each in OUTCOMES),
                "" if draft.outcomes else "none ticked: however it ends",
            ),
            "time": RuleField("time", "time", draft.time, placeholder="500ms, 2s, 1.5min", has_list=False),
            "held": RuleField(
                "held", "while", draft.held, behind="true all that time", placeholder="–", notes=3, has_list=True
            ),
            "condition": RuleField(
                "condition", condition, draft.condition, behind=guard, placeholder=empty, notes=3, has_list=True
            ),
            "target": RuleField(
                "target", "go to", draft.target, placeholder="stays in this state", has_list=True, new="a new state"
            ),
        }
        return tuple(every[field] for field in draft.fields)

    def with_value(self, field: str, value: str) -> TransitionRuleForm:
        values: dict[str, Any] = {field: tuple(value.split()) if field == "outcomes" else value}
        return replace(self, draft=self.draft._replace(**values))

    def notes(self) -> dict[str, list[FieldNote]]:
        found = transition_notes(self.draft, self.names, self.rule, self.state, acts=self.has_functions)
        return {str(field): notes for field, notes in found.items()}

    def edits(self) -> tuple[AnyEdit, ...]:
        return edits_for(self.draft, self.names, self.rule.name, self.state, index=self.index, was=self.was)

    def choices(self, field: str) -> list[NameChoice]:
        match field:
            case "event":
                return self.names.event_choices()
            case "act":
                return self.names.act_choices(acts_started_by(self.rule))
            case "condition" | "held":
                return self.names.key_choices()
            case "target":
                return self.names.target_choices(self.rule.name)
            case _:
                return []

    def ending(self, field: str, text: str) -> str:
        if field in ("condition", "held"):
            return suggest_ending(text, self.names)
        if field == "event" and text and not text.startswith("/"):
            return complete_name(f"/{text}", self.choices(field))
        return super().ending(field, text)

    def missing(self) -> str:
        draft = self.draft
        empty = {"event": draft.event, "ended": draft.act, "after": draft.time, "condition": draft.condition}
        if not empty[draft.trigger].strip():
            return "it waits for nothing yet: fill in the field below “as soon as”, or leave with esc"
        return ""

    @property
    def event_without_key(self) -> str:
        """The event that it waits for and that nobody raises, so that a key could; empty: there is none."""
        topic = normal_topic(self.draft.event) if self.draft.trigger == "event" else ""
        return topic if topic and not self.names.event_note(topic) else ""


@dataclass(frozen=True)
class CallRuleForm(RuleForm):
    """A function, changed or new."""

    names: StudyNames
    draft: CallDraft
    at: StatementAddress
    """Of the function; of a new one, the statement before which it stands."""
    was: CallForm | None = None

    @property
    def title(self) -> str:  # type: ignore[override]
        return f"{self.at.state}: {'a function' if self.was is not None else 'something more to do'}"

    @property
    def fields(self) -> tuple[RuleField, ...]:
        draft = self.draft
        words = tuple((name, FUNCTION_WORDS[name]) for name in FUNCTIONS)
        every = {
            "function": RuleField("function", "do", draft.function, "choice", words),
            "act": RuleField("act", "act", draft.act, has_list=True),
            "rule": RuleField("rule", "rule", draft.rule, has_list=True),
            "state": RuleField("state", "in state", draft.state, placeholder="its first state", has_list=True),
            "enter": RuleField(
                "enter",
                "on entry",
                "yes" if draft.enter else "no",
                "choice",
                (("yes", "is done"), ("no", "is left out")),
            ),
            "event": RuleField("event", "event", draft.event, has_list=True, new="a new event"),
            "keep": RuleField("keep", "kept for", draft.keep, placeholder="not at all; or 500ms, 2s, 3min"),
            "key": RuleField("key", "key", draft.key, has_list=True, new="a new memory key"),
            "value": RuleField(
                "value", "becomes", draft.value, placeholder="2, true, 'a text', step + 1", notes=2, has_list=True
            ),
        }
        return tuple(every[field] for field in draft.fields)

    def with_value(self, field: str, value: str) -> CallRuleForm:
        values: dict[str, Any] = {field: value == "yes" if field == "enter" else value}
        return replace(self, draft=self.draft._replace(**values))

    def notes(self) -> dict[str, list[FieldNote]]:
        return {str(field): notes for field, notes in call_notes(self.draft, self.names).items()}

    def edits(self) -> tuple[AnyEdit, ...]:
        if self.was is None:
            return (AddStatement(self.at, self.draft.form()),)
        return (SetCall(self.at, self.draft.form()),) if is_changed(self.draft, self.was) else ()

    def choices(self, field: str) -> list[NameChoice]:
        if field == "value":
            return self.names.key_choices()
        return choices_for(field, self.draft, self.names)  # type: ignore[arg-type]

    def ending(self, field: str, text: str) -> str:
        return suggest_ending(text, self.names) if field == "value" else super().ending(field, text)

    def missing(self) -> str:
        return "" if self.draft.form().argument.strip("/ =") else "it does nothing yet: fill in the field, or esc"


ConditionUse: TypeAlias = Literal["wrap", "change", "otherwise"]


@dataclass(frozen=True)
class ConditionRuleForm(RuleForm):
    """The condition of an arm of an `if`: a function is put into a new one, it is changed, or an arm is added."""

    names: StudyNames
    at: StatementAddress
    """Of the function, of the arm, or of the new arm."""
    use: ConditionUse
    condition: str = ""
    was: str = ""
    call: CallForm | None = None
    """What is put into a new `if`."""
    can_be_else: bool = True

    @property
    def title(self) -> str:  # type: ignore[override]
        words = {"wrap": "do this only if", "change": "a condition", "otherwise": "what happens otherwise"}
        return f"{self.at.state}: {words[self.use]}"

    @property
    def fields(self) -> tuple[RuleField, ...]:
        is_arm = self.use == "otherwise"
        placeholder = "empty: in every other case" if is_arm and self.can_be_else else ""
        label = "but if" if is_arm else "only if"
        return (RuleField("condition", label, self.condition, placeholder=placeholder, notes=3, has_list=True),)

    def with_value(self, field: str, value: str) -> ConditionRuleForm:
        return replace(self, condition=value)

    def notes(self) -> dict[str, list[FieldNote]]:
        if not self.condition.strip():
            return {"condition": []}
        return {"condition": reading_notes(read_condition(self.condition, self.names))}

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

    def choices(self, field: str) -> list[NameChoice]:
        return self.names.key_choices()

    def ending(self, field: str, text: str) -> str:
        return suggest_ending(text, self.names)

    def missing(self) -> str:
        if self.condition.strip() or (self.use == "otherwise" and self.can_be_else):
            return ""
        return "say what must be true, or leave with esc"
