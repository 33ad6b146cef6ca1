"""The forms of a rule: what is typed becomes what is written, and nothing else."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

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
from rise_tui.editor.model.call_form import CallDraft, CallRuleForm, ConditionRuleForm
from rise_tui.editor.model.name_forms import EventKeyForm, NameForm, TemplateValueForm
from rise_tui.editor.model.transition_form import TransitionDraft, TransitionRuleForm, Trigger, why_not_editable
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


def transition(
    draft: TransitionDraft, was: TransitionForm | None = None, index: int | None = None
) -> TransitionRuleForm:
    """A form of the first state."""
    return TransitionRuleForm(NAMES, COURSE, "Start", draft, index, was)


@given(FORMS)
def test_a_way_that_is_opened_and_left_as_it_was_is_written_as_it_was(form: TransitionForm) -> None:
    draft = TransitionDraft.of(form)
    assert draft.form() == form
    assert transition(draft, form, 0).edits() == ()


@given(FORMS, st.sampled_from(["event", "ended", "condition", "after"]))
def test_another_trigger_and_back_loses_nothing(form: TransitionForm, trigger: Trigger) -> None:
    draft = TransitionDraft.of(form)
    there = draft._replace(trigger=trigger)
    assert not why_not_editable(there.form())
    assert there._replace(trigger=draft.trigger).form() == form


def test_a_changed_way_says_what_stood_there() -> None:
    was = START.transitions[1].form
    draft = TransitionDraft.of(was)._replace(condition="step < 2")
    (edit,) = transition(draft, was, 1).edits()
    assert edit == SetTransition(
        "Course", "Start", 1, was, TransitionForm(event="/skip", condition="step < 2", target="End")
    )


def test_a_way_to_a_new_state_makes_the_state() -> None:
    draft = TransitionDraft(event="later", target="Break")
    edits = transition(draft).edits()
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
    ("draft", "field", "level", "says"),
    [
        (TransitionDraft(event="/skip"), "event", "warning", "nothing in this study raises it"),
        (TransitionDraft(event="/nxt"), "event", "warning", "did you mean `next`?"),
        (TransitionDraft(event="next"), "event", "info", "raised by key n"),
        (TransitionDraft(event="/cheer"), "event", "info", "raised by rule Course"),
        (TransitionDraft(event="/R_Bye_failed"), "event", "info", "raised automatically when R_Bye fails"),
        (TransitionDraft(event="/Other_Two"), "event", "info", "when the rule Other ends in Two"),
        (TransitionDraft("after", time="1s", held="happy"), "held", "info", "happy is false at the start: false"),
        (TransitionDraft("condition", condition="step <"), "condition", "error", "something is missing"),
        (TransitionDraft(event="/next"), "target", "warning", "it does nothing yet"),
        (TransitionDraft(event="/next", target="Start"), "target", "info", "enters it again"),
        (TransitionDraft(event="/next", target="Ende"), "target", "info", "a new state"),
        (CallDraft("startInteractionRule", rule="Other", enter="no"), "enter", "info", "without doing"),
        (CallDraft("raiseEventTopic", event="skip"), "event", "info", "a rule waits for it"),
        (CallDraft("raiseEventTopic", event="skip", keep="5s"), "keep", "info", "kept for 5 s"),
        (CallDraft("assignValue", key="step", value="step + 1"), "value", "info", "step becomes 1"),
        (CallDraft("assignValue", key="step", value="step"), "key", "info", "0 at the start"),
    ],
)  # fmt: skip
def test_remarks_about_a_field(draft: TransitionDraft | CallDraft, field: str, level: str, says: str) -> None:
    form = transition(draft) if isinstance(draft, TransitionDraft) else CallRuleForm(NAMES, draft, ENTRY)
    found = form.notes(field)
    assert any(note.level == level and says in note.text for note in found), found


def test_the_form_of_a_way_asks_trigger_first() -> None:
    form = TransitionRuleForm(NAMES, COURSE, "Start", TransitionDraft())
    assert [field.id for field in form.fields] == ["trigger", "event", "condition", "target"]
    form = form.with_value("trigger", "after")
    assert [field.label for field in form.fields] == ["as soon as", "time", "while", "but only if", "go to"]
    assert form.missing()
    assert form.with_value("time", "2s").edits() == (AddTransition("Course", "Start", TransitionForm(after="2s")),)
    ended = form.with_value("trigger", "ended").with_value("act", "R_Hello").with_value("outcomes", "failed stopped")
    assert ended.edits() == (
        AddTransition("Course", "Start", TransitionForm(ended="R_Hello", outcomes=("failed", "stopped"))),
    )
    assert [choice.value for choice in ended.choices("act")] == ["R_Hello", "R_Bye"]
    assert ended.choices("act")[0].help == "started by this rule"


def test_names_are_completed_and_offered() -> None:
    form = TransitionRuleForm(NAMES, COURSE, "Start", TransitionDraft())
    assert form.ending("event", "/sk") == "ip"
    assert form.ending("target", "wa") == "it"
    assert form.ending("condition", "step < 4 and hap") == "py"
    events = {choice.value: choice.help for choice in form.choices("event")}
    assert events["/skip"] == "nothing in this study raises it"
    assert events["/R_Hello_end"] == "raised automatically when R_Hello ends"
    assert events["/cue"] == "the participant's cue"
    assert {choice.value for choice in form.choices("condition")} >= {"step", "happy", "mood", "words"}


def test_an_event_that_nobody_raises_gets_a_key() -> None:
    form = TransitionRuleForm(NAMES, COURSE, "Start", TransitionDraft(event="/skip"))
    assert form.event_without_key == "skip"
    assert not form.with_value("event", "/next").event_without_key
    key = EventKeyForm(NAMES, "skip")
    assert key.missing() == "which key?"
    assert key.with_value("key", "n").missing() == "the key n does something else already"
    assert "console" in key.with_value("key", "?").missing()
    done = key.with_value("key", "k").with_value("label", "skip it")
    assert not done.missing()
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
    draft = CallDraft.of(call)
    assert draft.form() == call
    assert CallRuleForm(NAMES, draft, ENTRY, call).edits() == ()


def test_a_function_is_put_into_a_condition() -> None:
    call = CallForm("startCommunicationRobotAct", "R_Hello")
    form = ConditionRuleForm(NAMES, ENTRY, "wrap", call=call)
    assert form.missing()
    assert form.with_value("condition", "happy").edits() == (
        RemoveStatement(ENTRY),
        AddStatement(ENTRY, IfForm((BranchForm("happy", (call,)),))),
    )


def test_an_arm_is_added_and_a_condition_changed() -> None:
    form = ConditionRuleForm(NAMES, ENTRY, "otherwise")
    assert form.edits() == (AddBranch(ENTRY, None),)
    assert form.with_value("condition", "happy").edits() == (AddBranch(ENTRY, "happy"),)
    changed = ConditionRuleForm(NAMES, ENTRY, "change", "step < 4", "step < 4")
    assert changed.edits() == ()
    assert changed.with_value("condition", "step < 5").edits() == (SetBranchCondition(ENTRY, "step < 5"),)


def test_names_of_states() -> None:
    form = NameForm(COURSE, "rename state", "Start", "Start")
    assert form.edits() == ()
    assert form.with_value("name", " ").missing() == "it needs a name"
    assert form.with_value("name", "Begin").edits() == (Rename("state", "Course/Start", "Begin"),)
    assert NameForm(COURSE, "new state", "New", "Start").edits() == (AddState("Course", "New", after="Start"),)


def test_what_is_given_to_a_template() -> None:
    (use,) = NAMES.outline.uses
    form = TemplateValueForm(use, "then", "End")
    assert form.edits() == ()
    assert form.with_value("value", "Start").edits() == (
        SetUseParameter("rules/course.xml", use.line, "Wait", "then", "Start"),
    )
    assert TemplateValueForm(use, "pause", "").edits() == ()
