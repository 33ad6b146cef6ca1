"""Edits of acts: what comes of the files, line by line."""

from __future__ import annotations

import pytest

from rise_engine.author.edit.edits import (
    AddAct,
    AddAction,
    AddVariant,
    AnyEdit,
    CopyAct,
    RemoveAct,
    RemoveAction,
    RemoveVariant,
    SetActionFailure,
    SetActionType,
    SetParameter,
    SetWaits,
)
from rise_engine.author.edit.plan import EditRefused, apply_plan
from rise_engine.author.edit.planning import StudyState, plan
from tests.author.edit.samples import after, changed_lines, state_of, study_files, study_state


def with_acts(text: str, name: str = "acts/signals.xml") -> StudyState:
    """The greeting with another file of acts."""
    return state_of({**study_files("greeting"), name: text.encode()}, "greeting")


def acts_after(text: str, *edits: AnyEdit) -> str:
    """A file of acts after edits."""
    return after(with_acts(text), *edits).files["acts/signals.xml"].decode()


def refusal(study: StudyState, edit: AnyEdit) -> str:
    """Why an edit cannot be made."""
    with pytest.raises(EditRefused) as caught:
        plan(edit, study)
    return str(caught.value)


def test_one_message_is_one_line() -> None:
    study = study_state("lablinking")
    edit = SetParameter("R_Yes", "2", "message", "Yes, that's <it>.", variant=1)
    there = after(study, edit)
    assert changed_lines(study.files, there.files) == (1, 1)
    assert b"<Speech><message>Yes, that's &lt;it>.</message></Speech>" in there.files["acts/feedback.xml"]
    assert plan(edit, study).says == ("R_Yes 2/2 says “Yes, that's <it>.” (was “Yes, that is right.”)",)
    assert plan(edit, there).splices == ()


def test_of_a_text_only_what_differs_is_replaced() -> None:
    message = "<message>\n  Gr&#252;n &amp;\r\n  naive.\n</message>"
    text = f"<Dialog name='A'><Speech><actionID>1</actionID>{message}</Speech></Dialog>"
    (splice,) = plan(SetParameter("A", "1", "message", "Grün & naïve."), with_acts(text)).splices
    assert (text[splice.start : splice.end], splice.text) == ("i", "ï")


def test_a_text_in_cdata_stays_in_cdata() -> None:
    text = "<Dialog name='A'><Speech><actionID>1</actionID><message><![CDATA[ A < B ]]></message></Speech></Dialog>"
    assert "<![CDATA[ A < C & D ]]>" in acts_after(text, SetParameter("A", "1", "message", "A < C & D"))
    assert "<message>]]&gt;</message>" in acts_after(text, SetParameter("A", "1", "message", "]]>"))


def test_markup_becomes_other_markup_or_words() -> None:
    text = "<Dialog name='A'><Speech><actionID>1</actionID><message><speak>Hi</speak></message></Speech></Dialog>"
    changed = acts_after(text, SetParameter("A", "1", "message", "<speak>Hi<break/></speak>"))
    assert "<message><speak>Hi<break/></speak></message>" in changed
    assert "<message>a &lt; b</message>" in acts_after(text, SetParameter("A", "1", "message", "a < b"))
    broken = SetParameter("A", "1", "message", "<speak>Hi")
    assert "not well-formed" in refusal(with_acts(text), broken)


def test_a_parameter_is_added_in_its_order_and_taken_out() -> None:
    text = """<Dialog name="A">
  <LookAt>
    <actionID>1</actionID> <!-- far -->
    <pointx>0</pointx> <pointz>1</pointz>
  </LookAt>
</Dialog>
"""
    added = acts_after(text, SetParameter("A", "1", "pointy", "0.5"), SetParameter("A", "1", "duration", "300"))
    assert "    <pointx>0</pointx> <pointy>0.5</pointy> <pointz>1</pointz> <duration>300</duration>\n" in added
    gone = acts_after(text, SetParameter("A", "1", "pointx", None))
    assert "    <pointz>1</pointz>\n" in gone


def test_an_empty_element_is_opened() -> None:
    text = "<Dialog name='A'><Speech><actionID>1</actionID><message/></Speech></Dialog>"
    assert "<message>Hi</message>" in acts_after(text, SetParameter("A", "1", "message", "Hi"))


def test_what_cannot_be_changed_is_refused_with_the_reason() -> None:
    text = "<Dialog name='A'><Speech><actionID>1</actionID><message>a <!-- b --> c</message></Speech></Dialog>"
    study = with_acts(text)
    assert refusal(study, SetParameter("A", "1", "message", "x")) == (
        "message of A 1 cannot be changed: a comment is in it (acts/signals.xml, line 1)"
    )
    assert "did you mean `message`?" in refusal(study, SetParameter("A", "1", "mesage", "x"))
    assert "did you mean `R_Greeting`?" in refusal(study, SetParameter("R_Greting", "1", "message", "x"))
    assert "there is no action `7`" in refusal(study, SetParameter("A", "7", "message", "x"))
    assert "A 1 has 1 wording, and no number 2" in refusal(study, SetParameter("A", "1", "message", "x", variant=1))
    plain = with_acts(text.replace("<!-- b -->", ""))
    assert "U+0001" in refusal(plain, SetParameter("A", "1", "message", "\x01"))
    broken = with_acts("<Dialogs>")
    assert "acts/signals.xml cannot be read now" in refusal(broken, SetParameter("R_Smile", "1", "value", "sad"))


def test_the_text_of_a_template_is_changed_at_its_use() -> None:
    study = study_state("lablinking")
    there = after(study, SetParameter("R_Task1_Step1", "2", "message", "Take the small plate."))
    assert changed_lines(study.files, there.files) == (1, 1)
    assert b'     first="Take the small plate."\n' in there.files["acts/task_1.xml"]
    assert refusal(study, SetParameter("R_Task1_Step1", "6", "pointz", "1")) == (
        "R_Task1_Step1 6 cannot be changed: it comes from the template `Instruction`, used here "
        "(acts/task_1.xml, line 8)"
    )
    with pytest.raises(EditRefused, match="template `Instruction` has `x` in other places, too; change its `<use>`"):
        after(study, SetParameter("R_Task1_Step1", "6", "pointx", "1"))


def test_a_new_action_stands_as_the_others_do() -> None:
    study = study_state("lablinking", "crlf")
    edit = AddAction("R_Praise", "Speech", {"message": "Hm"}, wait_for=("4",), after="3")
    there = after(study, edit)
    parts = "    <actionID>5</actionID>\n    <waitForActions>4</waitForActions>\n    <message>Hm</message>\n"
    new = f"\n  <Speech>\n{parts}  </Speech>\n"
    assert f"</Animation>\n{new}\n  <Emotion>".replace("\n", "\r\n").encode() in there.files["acts/feedback.xml"]
    assert changed_lines(study.files, there.files) == (6, 0)


def test_a_new_action_in_one_line() -> None:
    text = "<Dialog name='A'><Wait><actionID>1</actionID><duration>1</duration></Wait></Dialog>"
    added = acts_after(text, AddAction("A", "Speech", {"message": "Hm"}))
    assert added == text.replace("</Dialog>", "<Speech><actionID>2</actionID><message>Hm</message></Speech></Dialog>")


def test_an_action_that_goes_hands_on_what_it_waited_for() -> None:
    study = study_state("greeting")
    there = after(
        study,
        AddAction("R_Notice", "Wait", {"duration": "5"}, wait_for=("2",)),
        SetWaits("R_Notice", "3", ("2", "1")),
        RemoveAction("R_Notice", "2"),
    )
    act = there.outline.act("R_Notice")
    assert act is not None
    assert [(action.id, action.wait_for) for action in act.actions] == [("1", ()), ("3", ("1",))]


def test_waits_and_failures_come_and_go_without_a_trace() -> None:
    study = study_state("greeting", "bom_tabs")
    there = after(study, SetWaits("R_Smile", "1", ()), SetActionFailure("R_Smile", "1", continues=True))
    assert b"\r" not in there.files["acts/signals.xml"]
    assert b"\t\t<onFailure>continue</onFailure>\n" in there.files["acts/signals.xml"]
    assert after(there, SetActionFailure("R_Smile", "1", continues=False)).files == study.files
    waits = after(study, SetWaits("R_Notice", "2", ()))
    assert after(waits, SetWaits("R_Notice", "2", ("1",))).files == study.files


def test_another_action_keeps_what_both_have() -> None:
    study = study_state("greeting")
    there = after(study, SetActionType("R_Smile", "1", "Wait"))
    assert (
        b"  <Wait>\n    <actionID>1</actionID>\n    <duration>2000</duration>\n  </Wait>"
        in there.files["acts/signals.xml"]
    )
    assert plan(SetActionType("R_Smile", "1", "Wait"), study).says == (
        "R_Smile 1 is Wait (was Emotion), without value",
    )
    assert "did you mean `Emotion`?" in refusal(study, SetActionType("R_Smile", "1", "Emotoin"))


@pytest.mark.parametrize("spelling", ["lf", "crlf", "cr", "one_line", "cdata", "bom_tabs"])
def test_a_second_wording_and_back_are_the_same_bytes(spelling: str) -> None:
    study = study_state("lablinking", spelling)
    there = after(study, AddVariant("R_Apology", "2", {"message": "Sorry."}))
    act = there.outline.act("R_Apology")
    assert act is not None
    assert [call.parameters["message"].text for call in act.actions[1].calls] == [
        "I am sorry, that was not very clear.",
        "Sorry.",
    ]
    assert after(there, RemoveVariant("R_Apology", "2", 1)).files == study.files


def test_the_wordings_of_an_action_are_one_line_each() -> None:
    study = study_state("lablinking")
    there = after(study, AddVariant("R_Yes", "2", {"message": "Yes!"}))
    assert changed_lines(study.files, there.files) == (1, 0)
    assert after(there, RemoveVariant("R_Yes", "2", 2)).files == study.files
    single = after(study, RemoveVariant("R_Yes", "2", 0))
    act = single.outline.act("R_Yes")
    assert act is not None
    assert not act.actions[1].is_variants
    assert act.actions[1].calls[0].parameters["message"].text == "Yes, that is right."


def test_a_comment_beside_wordings_is_not_lost() -> None:
    text = """<Dialog name="A">
  <Variants>
    <actionID>1</actionID>
    <!-- said most often -->
    <Speech><message>A</message></Speech>
    <Speech><message>B</message></Speech>
  </Variants>
</Dialog>"""
    there = acts_after(text, RemoveVariant("A", "1", 1))
    assert "said most often" in there
    assert "<Variants>" in there


def test_acts_are_made_where_they_are_wanted() -> None:
    study = study_state("greeting")
    there = after(study, AddAct("R_New", "Hello you.", after="R_Notice"), AddAct("R_Empty", file="acts/more.xml"))
    text = there.files["acts/signals.xml"].decode()
    speech = "  <Speech>\n    <actionID>1</actionID>\n    <message>Hello you.</message>\n  </Speech>\n"
    assert f'</Dialog>\n\n<Dialog name="R_New">\n{speech}</Dialog>\n\n<!-- Two answers' in text
    assert there.files["acts/more.xml"] == b'<Dialogs>\n  <Dialog name="R_Empty"/>\n</Dialogs>\n'
    assert refusal(study, AddAct("R_Smile")) == (
        "the act `R_Smile` is there already (acts/signals.xml, line 31); choose another name"
    )
    assert "would not be read" in refusal(study, AddAct("R_X", file="other/x.xml"))


def test_a_file_with_one_act_gets_a_wrapper_for_the_second() -> None:
    text = "<!-- One. -->\n<Dialog name='A'>\n  <Wait><actionID>1</actionID><duration>1</duration></Wait>\n</Dialog>\n"
    there = acts_after(text, AddAct("B", after="A"))
    assert there == f'<Dialogs>\n{text}\n<Dialog name="B"/>\n</Dialogs>\n'


def test_a_copy_is_the_act_with_another_name() -> None:
    study = study_state("lablinking", "comments")
    there = after(study, CopyAct("R_Yes", "R_Yes2"), CopyAct("R_Task1_Step1", "R_Task1_Again"))
    text = there.files["acts/feedback.xml"]
    old, new = text.index(b'<Dialog name="R_Yes"'), text.index(b'<Dialog name="R_Yes2"')
    length = text.index(b"</Dialog>", old) - old
    assert text[old : old + length].replace(b'"R_Yes"', b'"R_Yes2"') == text[new : new + length + 1]
    act = there.outline.act("R_Task1_Again")
    assert act is not None
    assert act.template == "Instruction"


def test_an_act_that_goes_takes_its_lines() -> None:
    study = study_state("greeting")
    there = after(study, CopyAct("R_Smile", "R_Smile2"))
    assert after(there, RemoveAct("R_Smile2")).files == study.files
    single = with_acts("<Dialog name='A'/>", "acts/single.xml")
    assert apply_plan(single.files, plan(RemoveAct("A"), single)) == study_files("greeting")


def test_translations_go_with_their_texts() -> None:
    study = study_state("lablinking")
    german = study.files["texts/de.toml"]
    there = after(study, RemoveVariant("R_Yes", "2", 0), AddVariant("R_Apology", "2", {"message": "Sorry."}))
    texts = there.checked.translations["de"]
    assert [each.code for each in there.checked.errors] == []
    assert there.files["texts/de.toml"] != german
    gone = after(there, RemoveAction("R_Apology", "2"), RemoveAct("R_TakeYourTime"))
    assert "unknown-text" not in {each.code for each in gone.checked.errors}
    assert texts is not None


def test_what_is_still_named_is_said() -> None:
    study = study_state("greeting")
    noticed = plan(RemoveAct("R_Nod"), study).noticed
    assert noticed[0].startswith("`R_Nod` is still named in rule Greeting, state Visitor is here")
    assert "key n (scenario.toml, line 23)" in noticed[0]
    assert noticed[1] == "the comment above it in acts/signals.xml stays"
