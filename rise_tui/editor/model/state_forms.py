"""The forms of a state: its name, its transitions, a key of the keyboard for an awaited event. Pure.

A transition has its trigger first, then its guard, then its target. Non-programmers understand the words correctly: "as
soon as" for events, "this is true" for lasting states, "but only if" for a guard at that moment (Huang and Cakmak,
UbiComp 2015).
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from rise_engine.author.edit.edits import (
    AddState,
    AddTransition,
    AnyEdit,
    Rename,
    SetSetting,
    SetTransition,
    TransitionForm,
)
from rise_engine.author.edit.outline import WrittenRule, WrittenState, WrittenTransition
from rise_engine.author.edit.plan import EditRefused
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.scenario.keys import KeyRefusedError, bindable_key_name
from rise_engine.scenario.model import normal_topic
from rise_tui.editor.model.fields import NOT_GIVEN, EditField, FieldNote, Form, info
from rise_tui.editor.model.study_names import StudyNames, acts_started_by, condition_field

TRIGGER_WORDS = {
    "event": "this happens",
    "condition": "this is true",
    "after": "this much time has passed",
    "ended": "this act has ended",
}
"""The choices after "as soon as"."""
FIELDS: dict[str, tuple[str, ...]] = {
    "event": ("trigger", "event", "condition", "target"),
    "condition": ("trigger", "condition", "target"),
    "after": ("trigger", "time", "held", "condition", "target"),
    "ended": ("trigger", "act", "outcomes", "condition", "target"),
}
"""The fields of a transition in order, by the trigger. The second one is required."""
OUTCOMES = {each: each for each in ("succeeded", "failed", "stopped")}


@dataclass(frozen=True)
class NameForm(Form):
    """The name of a new state, or a new name for a state."""

    rule: str
    state: str
    """The state to rename, or the one before the new state."""
    is_new: bool = False

    @property
    def title(self) -> str:
        return "a new state" if self.is_new else f"{self.state}: another name"

    @property
    def fields(self) -> Sequence[EditField]:
        note = "no transition leads to it yet" if self.is_new else "it is renamed everywhere"
        return (self.text("name", "name", "", remarks=info(note)),)

    def edits(self) -> tuple[AnyEdit, ...]:
        name = self.value("name")
        if not name:
            raise EditRefused("it needs a name")
        if self.is_new:
            return (AddState(self.rule, name, after=self.state),)
        return () if name == self.state else (Rename("state", f"{self.rule}/{self.state}", name),)


@dataclass(frozen=True)
class EventKeyForm(Form):
    """A key of the keyboard for an event that nothing raises."""

    names: StudyNames
    event: str

    @property
    def title(self) -> str:
        return f"a key that raises /{self.event}"

    @property
    def fields(self) -> Sequence[EditField]:
        return (
            self.text("key", "key", "a letter, a digit, F5"),
            self.text("label", "means", "the wizard reads it beside the key; may stay empty"),
        )

    def edits(self) -> tuple[AnyEdit, ...]:
        """:raises EditRefused: also for a key that has another function, because setting it would replace that."""
        key, label = self.value("key"), self.value("label")
        if not key:
            raise EditRefused("which key?")
        try:
            name = bindable_key_name(key)
        except KeyRefusedError as error:
            raise EditRefused(str(error)) from None
        if name in self._used_keys():
            raise EditRefused(f"the key {key} does something else already")
        binding = {"event": f"/{self.event}"} | ({"label": label} if label else {})
        return (SetSetting(("keys", key), binding),)

    def _used_keys(self) -> set[str]:
        """The names of keys of the keyboard that have a function."""
        found: set[str] = set()
        for key in self.names.keyboard:
            with contextlib.suppress(KeyRefusedError):
                found.add(bindable_key_name(key))
        return found


def transition_values(form: TransitionForm) -> dict[str, str]:
    """The values of the form for a transition."""
    given = {"event": form.event, "ended": form.ended, "after": form.after, "condition": ""}
    return {
        "trigger": next(trigger for trigger, value in given.items() if value is not None),
        "event": form.event or "",
        "act": form.ended or "",
        "outcomes": ",".join(form.outcomes),
        "time": form.after or "",
        "held": form.held or "",
        "condition": form.condition or "",
        "target": form.target or "",
    }


def transition_of(values: Mapping[str, str]) -> TransitionForm:
    """The transition that the shown fields describe, ready to be written."""
    given = {field: values.get(field, "").strip() for field in FIELDS[values["trigger"]]}
    topic = normal_topic(given.get("event", ""))
    return TransitionForm(
        event=(f"/{topic}" if topic else "") if "event" in given else None,
        ended=given.get("act"),
        outcomes=tuple(filter(None, given.get("outcomes", "").split(","))),
        after=given.get("time"),
        held=given.get("held") or None,
        condition=given["condition"] or None,
        target=given["target"] or None,
    )


def likely_transition(state: WrittenState) -> dict[str, str]:
    """The first values of a new transition: the end of the state's act, unless another one waits for it."""
    ends = {
        transition.form.ended
        for transition in state.transitions
        if not transition.form.outcomes and transition.form.condition is None
    }
    for statement in reversed(state.on_entry):
        call = statement.call
        if call is not None and call.function == "startCommunicationRobotAct" and call.argument not in ends:
            return {"trigger": "ended", "act": call.argument}
    return {"trigger": "event"}


def why_not_editable(form: TransitionForm) -> str:
    """The part of a transition for which the form has no field; empty: none."""
    triggers = [form.event, form.ended, form.after]
    if sum(each is not None for each in triggers) > 1:
        return "it waits for two things at once"
    if form.held is not None and form.after is None:
        return "it has a `while` without a time"
    if form.outcomes and form.ended is None:
        return "it names an outcome without an act"
    return ""


@dataclass(frozen=True)
class TransitionRuleForm(Form):
    """A transition of a state, changed or new."""

    names: StudyNames
    rule: WrittenRule
    state: WrittenState
    index: int | None = None
    """Its number; None: it is new."""

    @property
    def was(self) -> WrittenTransition | None:
        """The transition as written; None: it is new."""
        return self.state.transitions[self.index] if self.index is not None else None

    @property
    def title(self) -> str:
        count = len(self.state.transitions)
        which = f"transition {self.index + 1} of {count}" if self.index is not None else "a new transition"
        return f"{self.state.id}: {which}"

    @property
    def fields(self) -> Sequence[EditField]:
        names, trigger = self.names, self.values["trigger"]
        label, empty, note = "but only if", NOT_GIVEN, "at that moment"
        if trigger == "condition":
            label, empty, note = "this is true", "step = 2, or a memory key that is true", ""
        outcomes = self.options("outcomes", "has", OUTCOMES, "ticks")
        every = (
            self.options("trigger", "as soon as", TRIGGER_WORDS),
            self.text("event", "event", "its name; F2 lists them", new="a new event",
                      choices=names.event_choices(), remarks=self._event_remarks()),
            self.text("act", "act", "one that this rule has started",
                      choices=names.act_choices(acts_started_by(self.rule))),
            outcomes._replace(note="" if outcomes.text else "none ticked: however it ends"),
            self.text("time", "time", "500ms, 2s, 1.5min"),
            condition_field(self, names, "held", "while", note="true all that time"),
            condition_field(self, names, "condition", label, empty, note=note),
            self.text("target", "go to", "stays in this state", new="a new state",
                      choices=names.target_choices(self.rule.name), remarks=self._target_remarks()),
        )  # fmt: skip
        return [each for each in every if each.id in FIELDS[trigger]]

    def _event_remarks(self) -> list[FieldNote]:
        topic = normal_topic(self.value("event"))
        return info(self.names.event_note(topic) or ("F5 gives it a key" if topic else ""))

    def _target_remarks(self) -> list[FieldNote]:
        target, known = self.value("target"), self.names.states_of(self.rule.name)
        if not target:
            if self.was is not None and self.was.statements:
                return info("the rule stays in this state, and does what is listed below the transition")
            return [FieldNote("warning", "it does nothing yet: choose a state (F2), or add functions afterwards")]
        if target == self.state.id:
            return info("the rule leaves the state and enters it again")
        if target in known:
            return []
        return info(f"a new state: this transition makes it{did_you_mean(target, known, limit=0)}")

    def edits(self) -> tuple[AnyEdit, ...]:
        if not self.value(FIELDS[self.values["trigger"]][1]):
            raise EditRefused("it waits for nothing yet: fill in the field below “as soon as”, or leave with esc")
        was = self.was.form if self.was is not None else None
        form, rule, state = transition_of(self.values), self.rule.name, self.state.id
        if was is not None and self.values == transition_values(was):
            return ()
        edits = list[AnyEdit]()
        if form.target is not None and form.target not in self.names.states_of(rule):
            edits.append(AddState(rule, form.target, after=state))
        if was is None:
            edits.append(AddTransition(rule, state, form))
        elif form != was:
            edits.append(SetTransition(rule, state, self.index or 0, was, form))
        return tuple(edits)

    def following(self) -> Form | None:
        """A key for the event that the transition waits for, if nothing raises it yet."""
        topic = normal_topic(self.value("event")) if self.values["trigger"] == "event" else ""
        return EventKeyForm({}, self.names, topic) if topic and not self.names.event_note(topic) else None
