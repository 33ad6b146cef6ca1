"""The form of a transition: its trigger first, then its guard, then its target. Pure.

The words are those that non-programmers understand correctly: "as soon as" for events, "this is true" for lasting
states, "but only if" for a guard at that moment (Huang and Cakmak, UbiComp 2015).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple, TypeAlias

from rise_engine.author.edit.edits import AddState, AddTransition, AnyEdit, SetTransition, TransitionForm
from rise_engine.author.edit.outline import WrittenRule, WrittenState
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.model import normal_topic
from rise_tui.editor.model.condition_reading import condition_notes, suggest_ending
from rise_tui.editor.model.fields import EditField, FieldChoice, FieldNote, RuleForm, complete_name, text_field
from rise_tui.editor.model.study_names import StudyNames, acts_started_by

Trigger: TypeAlias = Literal["event", "ended", "condition", "after"]

TRIGGER_WORDS: dict[Trigger, str] = {
    "event": "this happens",
    "condition": "this is true",
    "after": "this much time has passed",
    "ended": "this act has ended",
}
"""The choices after "as soon as"."""
FIELDS: dict[Trigger, tuple[str, ...]] = {
    "event": ("trigger", "event", "condition", "target"),
    "condition": ("trigger", "condition", "target"),
    "after": ("trigger", "time", "held", "condition", "target"),
    "ended": ("trigger", "act", "outcomes", "condition", "target"),
}
"""The fields of the form in order, by the trigger."""
OUTCOMES = ("succeeded", "failed", "stopped")


class TransitionDraft(NamedTuple):
    """The values of the form. Values for other triggers than the chosen one stay until the form closes."""

    trigger: Trigger = "event"
    event: str = ""
    act: str = ""
    outcomes: tuple[str, ...] = ()
    """None of them: any ending."""
    time: str = ""
    held: str = ""
    condition: str = ""
    target: str = ""
    """Empty: the rule stays in the state."""

    @classmethod
    def of(cls, form: TransitionForm) -> TransitionDraft:
        trigger: Trigger = (
            "event" if form.event is not None
            else "ended" if form.ended is not None
            else "after" if form.after is not None
            else "condition"
        )  # fmt: skip
        return cls(
            trigger,
            form.event or "",
            form.ended or "",
            form.outcomes,
            form.after or "",
            form.held or "",
            form.condition or "",
            form.target or "",
        )

    def form(self) -> TransitionForm:
        """The transition, ready to be written."""
        trigger, topic = self.trigger, normal_topic(self.event)
        return TransitionForm(
            event=(f"/{topic}" if topic else "") if trigger == "event" else None,
            ended=self.act.strip() if trigger == "ended" else None,
            outcomes=self.outcomes if trigger == "ended" else (),
            after=self.time.strip() if trigger == "after" else None,
            held=self.held.strip() or None if trigger == "after" else None,
            condition=self.condition.strip() or None,
            target=self.target.strip() or None,
        )


def likely_transition(state: WrittenState) -> TransitionDraft:
    """The first values of a new transition: the end of the act that the state starts, unless another waits for it."""
    ends = {
        transition.form.ended
        for transition in state.transitions
        if not transition.form.outcomes and transition.form.condition is None
    }
    for statement in reversed(state.on_entry):
        call = statement.call
        if call is not None and call.function == "startCommunicationRobotAct" and call.argument not in ends:
            return TransitionDraft("ended", act=call.argument)
    return TransitionDraft()


def why_not_editable(form: TransitionForm) -> str:
    """The part of a transition for which the form has no field; empty: it has fields for everything."""
    triggers = [form.event, form.ended, form.after]
    if sum(each is not None for each in triggers) > 1:
        return "it waits for two things at once"
    if form.held is not None and form.after is None:
        return "it has a `while` without a time"
    if form.outcomes and form.ended is None:
        return "it names an outcome without an act"
    return ""


@dataclass(frozen=True)
class TransitionRuleForm(RuleForm):
    """A transition of a state, changed or new."""

    names: StudyNames
    rule: WrittenRule
    state: str
    draft: TransitionDraft
    index: int | None = None
    """Its number; None: it is new."""
    was: TransitionForm | None = None
    has_functions: bool = False
    count: int = 0
    """How many the state has."""

    @property
    def title(self) -> str:  # type: ignore[override]
        which = f"transition {self.index + 1} of {self.count}" if self.index is not None else "a new transition"
        return f"{self.state}: {which}"

    @property
    def fields(self) -> tuple[EditField, ...]:
        draft, is_condition = self.draft, self.draft.trigger == "condition"
        triggers = [FieldChoice(each, words) for each, words in TRIGGER_WORDS.items()]
        outcomes = [FieldChoice(each, each) for each in OUTCOMES]
        guard = "" if is_condition else "at that moment"
        every = (
            EditField("trigger", "as soon as", "option", draft.trigger, choices=triggers),
            text_field("event", "event", draft.event, "its name; F2 lists them", new="a new event"),
            text_field("act", "act", draft.act, "one that this rule has started"),
            EditField("outcomes", "has", "ticks", " ".join(draft.outcomes), choices=outcomes,
                      note="" if draft.outcomes else "none ticked: however it ends"),
            text_field("time", "time", draft.time, "500ms, 2s, 1.5min"),
            text_field("held", "while", draft.held, note="true all that time"),
            text_field("condition", "this is true" if is_condition else "but only if", draft.condition,
                  "step = 2, or a memory key that is true" if is_condition else "–", note=guard),
            text_field("target", "go to", draft.target, "stays in this state", new="a new state"),
        )  # fmt: skip
        return tuple(each for each in every if each.id in FIELDS[draft.trigger])

    def with_value(self, field: str, value: str) -> TransitionRuleForm:
        values: dict[str, Any] = {field: tuple(value.split()) if field == "outcomes" else value}
        return replace(self, draft=self.draft._replace(**values))

    def notes(self, field: str) -> list[FieldNote]:
        match field:
            case "event":
                return self._event_notes()
            case "held":
                return condition_notes(self.draft.held, self.names)
            case "condition":
                return condition_notes(self.draft.condition, self.names)
            case "target":
                return self._target_notes()
            case _:
                return []

    def _event_notes(self) -> list[FieldNote]:
        topic = normal_topic(self.draft.event)
        if not topic:
            return []
        if note := self.names.event_note(topic):
            return [FieldNote("info", note)]
        near = did_you_mean(topic, self.names.raised, limit=0)
        return [FieldNote("warning", f"nothing in this study raises it{near or '; a key could (F5)'}")]

    def _target_notes(self) -> list[FieldNote]:
        target, known = self.draft.target.strip(), self.names.states_of(self.rule.name)
        if not target:
            if self.has_functions:
                stays = "the rule stays in this state, and does what is listed below the transition"
                return [FieldNote("info", stays)]
            return [FieldNote("warning", "it does nothing yet: choose a state (F2), or add functions afterwards")]
        if target == self.state:
            return [FieldNote("info", "the rule leaves the state and enters it again")]
        if target in known:
            return []
        return [FieldNote("info", f"a new state: this transition makes it{did_you_mean(target, known, limit=0)}")]

    def edits(self) -> tuple[AnyEdit, ...]:
        if self.was is not None and self.draft == TransitionDraft.of(self.was):
            return ()
        form, edits = self.draft.form(), list[AnyEdit]()
        if form.target is not None and form.target not in self.names.states_of(self.rule.name):
            edits.append(AddState(self.rule.name, form.target, after=self.state))
        if self.was is None:
            edits.append(AddTransition(self.rule.name, self.state, form, at=self.index))
        elif form != self.was:
            edits.append(SetTransition(self.rule.name, self.state, self.index or 0, self.was, form))
        return tuple(edits)

    def choices(self, field: str) -> list[FieldChoice]:
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
        """The event that the transition waits for, if nothing raises it yet, so a key could; otherwise empty."""
        topic = normal_topic(self.draft.event) if self.draft.trigger == "event" else ""
        return topic if topic and not self.names.event_note(topic) else ""
