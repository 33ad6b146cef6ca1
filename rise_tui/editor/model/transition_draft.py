"""A way out of a state in its form: trigger first, then what else must hold, then where it leads. Pure.

The words of the triggers are those that non-programmers read rightly: "as soon as" for what happens in a moment,
"this is true" for what lasts, and "but only if" for what is asked at that moment (Huang and Cakmak, UbiComp 2015).
"""

from __future__ import annotations

import re
from collections.abc import Callable
from typing import Literal, NamedTuple, TypeAlias

from rise_engine.author.edit.edits import AddState, AddTransition, AnyEdit, SetTransition, TransitionForm
from rise_engine.author.edit.outline import WrittenRule, WrittenState
from rise_engine.base.nearest_name import did_you_mean
from rise_engine.expression import EvaluationError, Expression, ExpressionError
from rise_engine.scenario.durations import MAX_SECONDS, UNITS, parse_time, seconds_from
from rise_engine.scenario.element_reader import MIN_SECONDS
from rise_engine.scenario.model import normal_topic
from rise_tui.editor.model.condition_reading import (
    FieldNote,
    read_condition,
    reading_notes,
    unknown_key_notes,
    values_text,
)
from rise_tui.editor.model.study_names import StudyNames, acts_started_by

Trigger: TypeAlias = Literal["event", "ended", "condition", "after"]
TransitionField: TypeAlias = Literal["trigger", "event", "act", "outcomes", "time", "held", "condition", "target"]

TRIGGERS: tuple[Trigger, ...] = ("event", "condition", "after", "ended")
TRIGGER_WORDS: dict[Trigger, str] = {
    "event": "this happens",
    "condition": "this is true",
    "after": "this much time has passed",
    "ended": "this act has ended",
}
"""What stands behind "as soon as"."""
FIELDS: dict[Trigger, tuple[TransitionField, ...]] = {
    "event": ("trigger", "event", "condition", "target"),
    "condition": ("trigger", "condition", "target"),
    "after": ("trigger", "time", "held", "condition", "target"),
    "ended": ("trigger", "act", "outcomes", "condition", "target"),
}
"""The fields of the form, in their order, by what is chosen first."""
OUTCOMES = ("succeeded", "failed", "stopped")
_COMPUTED = re.compile(r"\s*\{(.*)\}\s*(ms|s|min)?\s*\Z", re.DOTALL)


class TransitionDraft(NamedTuple):
    """The form as it is filled in. What belongs to another trigger than the chosen one is kept until it is left."""

    trigger: Trigger = "event"
    event: str = ""
    act: str = ""
    outcomes: tuple[str, ...] = ()
    """None of them: however it has ended."""
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

    @property
    def fields(self) -> tuple[TransitionField, ...]:
        return FIELDS[self.trigger]

    def form(self) -> TransitionForm:
        """What is to be written."""
        trigger = self.trigger
        return TransitionForm(
            event=_slashed(self.event) if trigger == "event" else None,
            ended=self.act.strip() if trigger == "ended" else None,
            outcomes=self.outcomes if trigger == "ended" else (),
            after=self.time.strip() if trigger == "after" else None,
            held=self.held.strip() or None if trigger == "after" else None,
            condition=self.condition.strip() or None,
            target=self.target.strip() or None,
        )


def likely_way(state: WrittenState) -> TransitionDraft:
    """With what a new way out begins: the end of the act that the state starts, while no way waits for it anyhow."""
    ends = {way.form.ended for way in state.transitions if not way.form.outcomes and way.form.condition is None}
    for statement in reversed(state.on_entry):
        call = statement.call
        if call is not None and call.function == "startCommunicationRobotAct" and call.argument not in ends:
            return TransitionDraft("ended", act=call.argument)
    return TransitionDraft()


def why_not_editable(form: TransitionForm) -> str:
    """What of a way a form has no place for; empty: it can be changed in one."""
    triggers = [form.event, form.ended, form.after]
    if sum(each is not None for each in triggers) > 1:
        return "it waits for two things at once"
    if form.held is not None and form.after is None:
        return "it has a `while` without a time"
    if form.outcomes and form.ended is None:
        return "it names an outcome without an act"
    return ""


def edits_for(
    draft: TransitionDraft, names: StudyNames, rule: str, state: str, *, index: int | None, was: TransitionForm | None
) -> tuple[AnyEdit, ...]:
    """What is to be done for the form to be true; nothing when nothing was changed.

    :param index: the way's number in its state; None: it is a new one.
    :param was: what stands there; None: it is a new one.
    """
    if was is not None and draft == TransitionDraft.of(was):
        return ()
    form, edits = draft.form(), list[AnyEdit]()
    if form.target is not None and form.target not in names.states_of(rule):
        edits.append(AddState(rule, form.target, after=state))
    if was is None:
        edits.append(AddTransition(rule, state, form, at=index))
    elif form != was:
        edits.append(SetTransition(rule, state, index or 0, was, form))
    return tuple(edits)


def transition_notes(
    draft: TransitionDraft, names: StudyNames, rule: WrittenRule, state: str, *, acts: bool
) -> dict[TransitionField, list[FieldNote]]:
    """What is to be said about each field.

    :param acts: whether the way has functions.
    """
    checks: dict[TransitionField, Callable[[], list[FieldNote]]] = {
        "event": lambda: _event_notes(draft.event, names),
        "act": lambda: _act_notes(draft.act, names, rule),
        "time": lambda: _time_notes(draft.time, names),
        "held": lambda: _condition_notes(draft.held, names),
        "condition": lambda: (
            _condition_notes(draft.condition, names)
            if draft.condition.strip() or draft.trigger != "condition"
            else [FieldNote("error", "say what must be true: a memory key, or `step = 2`")]
        ),
        "target": lambda: _target_notes(draft, names, rule, state, acts=acts),
    }
    return {field: checks[field]() for field in draft.fields if field in checks}


def _event_notes(event: str, names: StudyNames) -> list[FieldNote]:
    topic = normal_topic(event)
    if not topic:
        return [FieldNote("error", "which event? F2 lists them")]
    if note := names.event_note(topic):
        return [FieldNote("info", note)]
    if topic in names.acts:
        return [FieldNote("warning", f"{topic} is an act: choose “{TRIGGER_WORDS['ended']}” above (shift+tab, ←)")]
    near = did_you_mean(topic, names.raised, limit=0)
    return [FieldNote("warning", f"nothing in this study raises it{near or '; a key could (F5)'}")]


def _act_notes(act: str, names: StudyNames, rule: WrittenRule) -> list[FieldNote]:
    act = act.strip()
    if not act:
        return [FieldNote("error", "which act? F2 lists them")]
    if act not in names.acts:
        return [FieldNote("error", f"there is no act `{act}`{did_you_mean(act, names.acts, limit=0)}")]
    if act not in acts_started_by(rule):
        return [FieldNote("warning", f"this rule does not start it; for somebody else's wait for the event /{act}_end")]
    return []


def _time_notes(time: str, names: StudyNames) -> list[FieldNote]:
    """A time, or braces with what gives it."""
    text = time.strip()
    if not text:
        return [FieldNote("error", "how long? write 500ms, 2s, 1.5min, or {pause_ms}ms for a memory key")]
    if (computed := _COMPUTED.match(text)) is not None:
        return _computed_time_notes(computed, names)
    seconds = parse_time(text)
    if seconds is None:
        number = text.replace(".", "", 1).isdecimal()
        remedy = f"write {text}ms or {text}s" if number else "write 500ms, 2s, 1.5s or 3min"
        return [FieldNote("error", f"`{text}` is not a time; {remedy}")]
    if not MIN_SECONDS <= seconds <= MAX_SECONDS:
        return [FieldNote("error", "a time is from 1ms to 24 hours (1440min)")]
    return []


def _computed_time_notes(computed: re.Match[str], names: StudyNames) -> list[FieldNote]:
    try:
        expression = Expression.parse(computed[1])
    except ExpressionError as error:
        return [FieldNote("error", f"{error.message}; {error.hint}" if error.hint else error.message)]
    notes = [FieldNote("warning", each) for each in unknown_key_notes(expression, names)]
    values = values_text(expression, names.memory)
    if expression.draws:
        return [*notes, FieldNote("info", "chance decides how long, each time anew")]
    try:
        seconds = seconds_from(expression.value(names.memory), UNITS[computed[2]] if computed[2] else None)
    except EvaluationError as error:
        return [*notes, FieldNote("warning", str(error))]
    if seconds is None or not MIN_SECONDS <= seconds <= MAX_SECONDS:
        return [*notes, FieldNote("warning", f"{values} at the start: that is no time")]
    return [*notes, FieldNote("info", f"{values} at the start: {seconds:g} s")]


def _condition_notes(text: str, names: StudyNames) -> list[FieldNote]:
    return reading_notes(read_condition(text, names)) if text.strip() else []


def _target_notes(
    draft: TransitionDraft, names: StudyNames, rule: WrittenRule, state: str, *, acts: bool
) -> list[FieldNote]:
    target = draft.target.strip()
    if not target:
        if acts:
            return [FieldNote("info", "the rule stays in this state, and does what stands below the way")]
        return [FieldNote("warning", "it leads nowhere and does nothing: choose a state (F2), or give it functions")]
    if target == state:
        return [FieldNote("info", "the state is left and entered anew: on exit and on entry are done")]
    known = [each.id for each in rule.states]
    if target not in known:
        near = did_you_mean(target, known, limit=0)
        return [FieldNote("info", f"a new state: it is made with this way{near}")]
    return []


def _slashed(event: str) -> str:
    topic = normal_topic(event)
    return f"/{topic}" if topic else ""
