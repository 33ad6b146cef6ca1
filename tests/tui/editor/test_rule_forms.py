"""The forms of a rule: what is typed becomes what is written, and nothing else."""

from __future__ import annotations

import re
from collections.abc import Mapping

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec import structs

from rise_engine.author.edit.edits import (
    AddBranch,
    AddState,
    AddStatement,
    AddTransition,
    BranchForm,
    CallForm,
    IfForm,
    RemoveStatement,
    Rename,
    SetBranchCondition,
    SetSetting,
    SetTransition,
    SetUseParameter,
    StatementAddress,
    TransitionForm,
)
from rise_engine.author.edit.plan import EditRefused
from rise_tui.editor.model.fields import EditField, Form, complete_name
from rise_tui.editor.model.state_forms import (
    EventKeyForm,
    NameForm,
    TransitionRuleForm,
    transition_of,
    transition_values,
    why_not_editable,
)
from rise_tui.editor.model.statement_forms import (
    CallRuleForm,
    ConditionRuleForm,
    TemplateValueForm,
    call_of,
    call_values,
)
from rise_tui.editor.model.study_names import suggest_ending
from tests.tui.editor.small_study import small_study

NAMES = small_study()
COURSE = NAMES.outline.rules[0]
START = COURSE.states[0]
ENTRY = StatementAddress("Course", "Start", "onEntry", path=(0,))

WORDS = st.sampled_from(["skip", "step < 4", "R_Hello", "2s", "End"])
FORMS = st.one_of(
    st.builds(lambda e, c, t: TransitionForm(event=f"/{e}", condition=c, target=t), st.sampled_from(["a", "b"]),
              st.none() | WORDS, st.none() | WORDS),
    st.builds(lambda a, o, t: TransitionForm(ended=a, outcomes=o, target=t), WORDS,
              st.sampled_from([(), ("failed",), ("failed", "stopped")]), st.none() | WORDS),
    st.builds(lambda t, h, c: TransitionForm(after=t, held=h, condition=c),
              WORDS, st.none() | WORDS, st.none() | WORDS),
    st.builds(lambda c, t: TransitionForm(condition=c, target=t), WORDS, st.none() | WORDS),
)  # fmt: skip


def transition(values: Mapping[str, str], was: TransitionForm | None = None) -> TransitionRuleForm:
    """A form of the first state: for its second transition, if `was` is written there, else for a new one."""
    if was is None:
        return TransitionRuleForm(values, NAMES, COURSE, START)
    written = structs.replace(START.transitions[1], form=was)
    state = structs.replace(START, transitions=(START.transitions[0], written))
    return TransitionRuleForm(values, NAMES, COURSE, state, 1)


def event(name: str, **more: str) -> dict[str, str]:
    return {"trigger": "event", "event": name, **more}


def field(form: Form, id: str) -> EditField:
    return next(each for each in form.fields if each.id == id)


@given(FORMS)
def test_a_way_that_is_opened_and_left_as_it_was_is_written_as_it_was(form: TransitionForm) -> None:
    values = transition_values(form)
    assert transition_of(values) == form
    assert transition(values, form).edits() == ()


@given(FORMS, st.sampled_from(["event", "ended", "condition", "after"]))
def test_another_trigger_and_back_loses_nothing(form: TransitionForm, trigger: str) -> None:
    values = transition_values(form)
    there = transition(values).with_value("trigger", trigger)
    assert not why_not_editable(transition_of(there.values))
    assert transition_of(there.with_value("trigger", values["trigger"]).values) == form


def test_a_changed_way_says_what_stood_there() -> None:
    was = START.transitions[1].form
    values = {**transition_values(was), "condition": "step < 2"}
    (edit,) = transition(values, was).edits()
    assert edit == SetTransition(
        "Course", "Start", 1, was, TransitionForm(event="/skip", condition="step < 2", target="End")
    )


def test_a_way_to_a_new_state_makes_the_state() -> None:
    edits = transition(event("later", target="Break")).edits()
    assert edits == (
        AddState("Course", "Break", after="Start"),
        AddTransition("Course", "Start", TransitionForm(event="/later", target="Break")),
    )


def test_what_a_form_has_no_place_for() -> None:
    assert why_not_editable(TransitionForm(event="/a", after="2s")) == "it waits for two things at once"
    assert why_not_editable(TransitionForm(held="x", condition="y"))
    assert why_not_editable(TransitionForm(outcomes=("failed",), condition="y"))
    assert not why_not_editable(START.transitions[0].form)


@pytest.mark.parametrize(
    ("values", "id", "level", "says"),
    [
        (event("/skip"), "event", "info", "F5 gives it a key"),
        (event("next"), "event", "info", "raised by key n"),
        (event("/cheer"), "event", "info", "raised by rule Course"),
        (event("/R_Bye_failed"), "event", "info", "raised automatically when R_Bye fails"),
        (event("/Other_Two"), "event", "info", "when the rule Other ends in Two"),
        ({"trigger": "after", "time": "1s", "held": "happy"}, "held", "info", "happy is false at the start: false"),
        ({"trigger": "condition", "condition": "step <"}, "condition", "info", "so far read as step"),
        (event("/next"), "target", "warning", "it does nothing yet"),
        (event("/next", target="Start"), "target", "info", "enters it again"),
        (event("/next", target="Ende"), "target", "info", "a new state"),
        ({"function": "startInteractionRule", "rule": "Other", "enter": "no"}, "enter", "info", "without doing"),
        ({"function": "raiseEventTopic", "event": "skip"}, "event", "info", "a rule waits for it"),
        ({"function": "raiseEventTopic", "event": "skip", "keep": "5s"}, "keep", "info", "kept for 5 s"),
        ({"function": "assignValue", "key": "step", "value": "step + 1"}, "value", "info", "step becomes 1"),
        ({"function": "assignValue", "key": "step", "value": "step"}, "key", "info", "0 at the start"),
    ],
)  # fmt: skip
def test_remarks_about_a_field(values: dict[str, str], id: str, level: str, says: str) -> None:
    form = transition(values) if "trigger" in values else CallRuleForm(values, NAMES, ENTRY)
    found = field(form, id).remarks
    assert any(note.level == level and says in note.text for note in found), found


def test_the_form_of_a_way_asks_trigger_first() -> None:
    form = transition({"trigger": "event"})
    assert [field.id for field in form.fields] == ["trigger", "event", "condition", "target"]
    form = form.with_value("trigger", "after")
    assert [field.label for field in form.fields] == ["as soon as", "time", "while", "but only if", "go to"]
    with pytest.raises(EditRefused, match="it waits for nothing yet"):
        form.edits()
    assert form.with_value("time", "2s").edits() == (AddTransition("Course", "Start", TransitionForm(after="2s")),)
    ended = form.with_value("trigger", "ended").with_value("act", "R_Hello").with_value("outcomes", "failed,stopped")
    assert ended.edits() == (
        AddTransition("Course", "Start", TransitionForm(ended="R_Hello", outcomes=("failed", "stopped"))),
    )
    acts = field(ended, "act").choices
    assert [choice.value for choice in acts] == ["R_Hello", "R_Bye"]
    assert acts[0].help == "started by this rule"


def test_names_are_completed_and_offered() -> None:
    form = transition({"trigger": "event"})
    names = {each.id: [choice.value for choice in each.choices] for each in form.fields}
    assert complete_name("/sk", names["event"]) == complete_name("sk", names["event"]) == "ip"
    assert complete_name("wa", names["target"]) == "it"
    assert field(form, "condition").is_expression
    assert suggest_ending("step < 4 and hap", names["condition"]) == "py"
    events = {choice.value: choice.help for choice in field(form, "event").choices}
    assert events["/skip"] == "nothing in this study raises it"
    assert events["/R_Hello_end"] == "raised automatically when R_Hello ends"
    assert events["/cue"] == "the participant's cue"
    assert {*names["condition"]} >= {"step", "happy", "mood", "words"}


def test_an_event_that_nobody_raises_gets_a_key() -> None:
    form = transition(event("/skip"))
    key = form.following()
    assert isinstance(key, EventKeyForm) and key.event == "skip"
    assert form.with_value("event", "/next").following() is None
    for typed, why in (("", "which key?"), ("n", "the key n does something else already"), ("?", "console")):
        with pytest.raises(EditRefused, match=re.escape(why)):
            key.with_value("key", typed).edits()
    done = key.with_value("key", "k").with_value("label", "skip it")
    assert done.edits() == (SetSetting(("keys", "k"), {"event": "/skip", "label": "skip it"}),)


CALLS = st.one_of(
    st.builds(CallForm, st.sampled_from(["startCommunicationRobotAct", "stopCommunicationRobotAct"]), WORDS),
    st.builds(
        lambda r, s, e: CallForm("startInteractionRule", r, state=s, enter=e), WORDS, st.none() | WORDS, st.booleans()
    ),
    st.builds(lambda k: CallForm("raiseEventTopic", "/skip", keep=k), st.none() | st.just("5s")),
    st.builds(lambda a: CallForm("assignValue", a),
              st.sampled_from(["step = 1", "items[i].done = x = 2", '{"a": 1}', "a.b = 'x = y'", "l = shuffle(l)"])),
)  # fmt: skip


@given(CALLS)
def test_a_function_that_is_opened_is_written_as_it_was(call: CallForm) -> None:
    values = call_values(call)
    assert call_of(values) == call
    assert CallRuleForm(values, NAMES, ENTRY, call).edits() == ()


def test_a_function_is_put_into_a_condition() -> None:
    call = CallForm("startCommunicationRobotAct", "R_Hello")
    form = ConditionRuleForm({}, NAMES, ENTRY, "wrap", call=call)
    with pytest.raises(EditRefused, match="say what must be true"):
        form.edits()
    assert form.with_value("condition", "happy").edits() == (
        RemoveStatement(ENTRY),
        AddStatement(ENTRY, IfForm((BranchForm("happy", (call,)),))),
    )


def test_an_arm_is_added_and_a_condition_changed() -> None:
    form = ConditionRuleForm({}, NAMES, ENTRY, "otherwise", can_be_else=True)
    assert form.edits() == (AddBranch(ENTRY, None),)
    assert form.with_value("condition", "happy").edits() == (AddBranch(ENTRY, "happy"),)
    changed = ConditionRuleForm({"condition": "step < 4"}, NAMES, ENTRY, "change", "step < 4")
    assert changed.edits() == ()
    assert changed.with_value("condition", "step < 5").edits() == (SetBranchCondition(ENTRY, "step < 5"),)


def test_names_of_states() -> None:
    form = NameForm({"name": "Start"}, "Course", "Start")
    assert form.edits() == ()
    with pytest.raises(EditRefused, match="it needs a name"):
        form.with_value("name", " ").edits()
    assert form.with_value("name", "Begin").edits() == (Rename("state", "Course/Start", "Begin"),)
    new = NameForm({"name": "New"}, "Course", "Start", is_new=True)
    assert new.edits() == (AddState("Course", "New", after="Start"),)


def test_what_is_given_to_a_template() -> None:
    (use,) = NAMES.outline.uses
    form = TemplateValueForm({"value": "End"}, use, "then")
    assert form.edits() == ()
    assert form.with_value("value", "Start").edits() == (
        SetUseParameter("rules/course.xml", use.line, "Wait", "then", "Start"),
    )
    assert TemplateValueForm({"value": ""}, use, "pause").edits() == ()
