"""Edits of rules: states, ways out, functions, branches; what comes of the files, line by line."""

from __future__ import annotations

import pytest

from rise_engine.author.edit.edits import (
    AddBranch,
    AddRule,
    AddState,
    AddStatement,
    AddTransition,
    AnyEdit,
    BranchForm,
    CallForm,
    CopyRule,
    IfForm,
    MoveStatement,
    MoveTransition,
    OneOfForm,
    RemoveRule,
    RemoveState,
    RemoveStatement,
    RemoveTransition,
    ReplaceFile,
    SetBranchCondition,
    SetCall,
    SetInitial,
    SetPriority,
    SetTransition,
    SetUseParameter,
    StatementAddress,
    StatementPlace,
    TransitionForm,
)
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.planning import StudyState, plan
from tests.author.edit.samples import after, changed_lines, state_of, study_files, study_state

FILE = "rules/greeting.xml"
EVENT = TransitionForm(event="x", target="Closed")
ASSIGN = CallForm("assignValue", "person_greeted = true")


def with_rule(states: str) -> StudyState:
    """The greeting with another rule."""
    rule = f'<InteractionRule name="R" initial="A">\n{states}\n</InteractionRule>\n'
    return state_of({**study_files("greeting"), FILE: rule.encode()}, "greeting")


def rule_after(states: str, *edits: AnyEdit) -> str:
    """The states of a rule after edits."""
    text = after(with_rule(states), *edits).files[FILE].decode()
    return text.split("\n", 1)[1].rsplit("\n</InteractionRule>", 1)[0]


def refusal(study: StudyState, edit: AnyEdit) -> str:
    """Why an edit cannot be made."""
    with pytest.raises(EditRefused) as caught:
        plan(edit, study)
    return str(caught.value)


def at(path: tuple[int, ...], place: StatementPlace = "onEntry", transition: int = 0) -> StatementAddress:
    """A statement of the state A of the rule R."""
    return StatementAddress("R", "A", place, transition, path)


# --- states and rules ---------------------------------------------------------------------------------------------


def test_one_state_and_one_way_are_one_line_each() -> None:
    study = study_state("greeting", "crlf")
    state = after(study, AddState("Greeting", "Waiting", after="Nobody"))
    assert changed_lines(study.files, state.files) == (1, 0)
    way = after(
        study, AddTransition("Greeting", "Nobody", TransitionForm(event="x", condition="1 < 2", target="Closed"))
    )
    assert changed_lines(study.files, way.files) == (1, 0)
    line = b'    <transition eventTopic="/x" cond="1 &lt; 2" target="Closed"/>\r\n'
    assert b'target="Closed"/>\r\n' + line + b"  </State>" in way.files[FILE]
    assert (
        after(
            way,
            RemoveTransition("Greeting", "Nobody", 2, EVENT.__class__(event="/x", condition="1 < 2", target="Closed")),
        ).files
        == study.files
    )


def test_a_state_without_anything_is_opened_and_closed() -> None:
    added = rule_after('\t<State id="A"/>', AddTransition("R", "A", EVENT))
    assert added == '\t<State id="A">\n\t\t<transition eventTopic="/x" target="Closed"/>\n\t</State>'
    assert rule_after(added, RemoveTransition("R", "A", 0, EVENT)) == '\t<State id="A"/>'
    one_line = rule_after('<State id="A"/><State id="B"/>', AddTransition("R", "A", EVENT))
    assert one_line == '<State id="A"><transition eventTopic="/x" target="Closed"/></State><State id="B"/>'


def test_a_new_way_stands_behind_the_comment_of_the_last_one() -> None:
    states = '  <State id="A">\n    <transition cond="true" target="A"/> <!-- so -->\n    <!-- end -->\n  </State>'
    last = rule_after(states, AddTransition("R", "A", EVENT))
    assert '<!-- so -->\n    <transition eventTopic="/x" target="Closed"/>\n    <!-- end -->' in last
    first = rule_after(
        states.replace("<transition cond", "<!-- why -->\n    <transition cond"), AddTransition("R", "A", EVENT, 0)
    )
    assert '<State id="A">\n    <transition eventTopic="/x" target="Closed"/>\n    <!-- why -->' in first


def test_a_way_is_found_again_when_its_number_has_changed() -> None:
    study = study_state("greeting")
    was = TransitionForm(event="W_close", target="Closed")
    there = after(study, SetTransition("Greeting", "Nobody", 5, was, TransitionForm(after="2s", target="Closed")))
    assert changed_lines(study.files, there.files) == (1, 1)
    assert b'    <transition after="2s" target="Closed"/>\n' in there.files[FILE]
    gone = TransitionForm(event="nothing")
    assert "as soon as /nothing happens" in refusal(study, RemoveTransition("Greeting", "Nobody", 0, gone))


def test_of_a_way_only_what_is_meant_otherwise_is_written() -> None:
    way = "<transition   eventTopic = 'x'\n                  cond=\"a  =  1\" target='A'/>"
    states = f"  <State id='A'>\n    {way}\n  </State>"
    was = TransitionForm(event="/x", condition="a  =  1", target="A")
    same = SetTransition("R", "A", 0, was, TransitionForm(event="x", condition="a  =  1", target="A"))
    assert plan(same, with_rule(states)).splices == ()
    now = SetTransition("R", "A", 0, was, TransitionForm(event="x", condition="a  =  2", target="A"))
    assert rule_after(states, now) == states.replace("=  1", "=  2")
    ended = SetTransition("R", "A", 0, was, TransitionForm(ended="R_Nod", outcomes=("failed", "stopped"), target="A"))
    there = rule_after(states, ended)
    assert there == states.replace("eventTopic = 'x'", 'ended="R_Nod"').replace(
        'cond="a  =  1"', 'outcome="failed | stopped"'
    )
    held = SetTransition("R", "A", 0, was, TransitionForm(after="2s", held='b = "c"'))
    there = rule_after(states, held)
    assert "<transition   while='b = \"c\"'\n" in there
    assert ' after="2s"/>\n' in there


@pytest.mark.parametrize(
    ("form", "why"),
    [
        (TransitionForm(event="x", after="2s"), "event and after"),
        (TransitionForm(target="A"), "waits for something"),
        (TransitionForm(event="x", outcomes=("failed",)), "name the act"),
        (TransitionForm(event="x", held="a"), "needs that time"),
    ],
)
def test_a_way_that_cannot_be_is_refused(form: TransitionForm, why: str) -> None:
    assert why in refusal(study_state("greeting"), AddTransition("Greeting", "Nobody", form))


def test_ways_move_with_their_comments() -> None:
    study = study_state("greeting")
    ways = ("person_near", "W_close")
    there = after(
        study, MoveTransition("Greeting", "Nobody", 0, TransitionForm(condition=ways[0], target="Visitor comes"), 1)
    )
    rule = there.outline.rule("Greeting")
    assert rule is not None
    assert [way.form.condition or way.form.event for way in rule.states[1].transitions] == ["/W_close", "person_near"]
    greets = TransitionForm(event="H_greets")
    moved = after(study, MoveTransition("Greeting", "Visitor is here", 1, greets, 2))
    assert b'Visitor has left"/>\n    <!-- Greeted already' in moved.files[FILE]
    back = after(moved, MoveTransition("Greeting", "Visitor is here", 2, greets, 1))
    assert back.files == study.files
    shared = TransitionForm(condition="not person_near", target="Visitor has left")
    assert "cannot move past this place" in refusal(study, MoveTransition("Greeting", "Greet", 2, shared, 0))


def test_shared_ways_change_for_all_states_that_have_them() -> None:
    states = (
        '  <State id="A"/>\n  <State id="B"/>\n  <transitions in="A | B">\n    <transition cond="true" target="A"/>\n'
        "  </transitions>"
    )
    was = TransitionForm(condition="true", target="A")
    edit = SetTransition("R", "B", 0, was, TransitionForm(condition="true", target="B"))
    assert plan(edit, with_rule(states)).says[0].startswith("B (and A):")
    assert '<transition cond="true" target="B"/>' in rule_after(states, edit)
    assert rule_after(states, RemoveTransition("R", "A", 0, was)) == '  <State id="A"/>\n  <State id="B"/>'
    own = rule_after(states, AddTransition("R", "A", EVENT))
    assert own.index("/x") < own.index("<transitions")
    alone = rule_after(states, RemoveState("R", "B"))
    assert '<transitions in="A">' in alone


def test_a_state_goes_when_nothing_leads_to_it() -> None:
    study = study_state("greeting")
    assert refusal(study, RemoveState("Greeting", "Closed")) == (
        "transitions lead to Closed: from Nobody (line 16); let them lead elsewhere first"
    )
    assert "begins in Start" in refusal(study, RemoveState("Greeting", "Start"))
    there = after(study, AddState("Greeting", "Waiting"))
    assert after(there, RemoveState("Greeting", "Waiting")).files == study.files
    assert "together with others" in refusal(study_state("lablinking"), RemoveState("Table setting", "Task 1, step 2"))
    assert refusal(study, AddState("Greeting", "Nobody")) == (
        "there is a state `Nobody` in Greeting already (line 14); choose another name"
    )


def test_what_a_rule_says_of_itself() -> None:
    study = study_state("greeting", "quotes")
    there = after(study, SetInitial("Greeting", "Nobody"), SetPriority("Greeting", None))
    assert changed_lines(study.files, there.files) == (1, 1)
    assert b"<InteractionRule name = 'Greeting' initial = 'Nobody'>" in there.files[FILE]
    assert after(there, SetPriority("Greeting", "2")).outline.rule("Greeting") is not None
    assert "did you mean `Nobody`?" in refusal(study, SetInitial("Greeting", "Nobdy"))


def test_rules_are_made_copied_and_removed() -> None:
    study = study_state("greeting")
    there = after(study, AddRule("My Rule", "First"), CopyRule("Listening", "Listening 2"))
    new = '<InteractionRule name="My Rule" initial="First">\n  <State id="First"/>\n</InteractionRule>\n'
    assert there.files["rules/my_rule.xml"].decode() == new
    text = there.files["rules/listening.xml"].decode()
    assert text.startswith("<InteractionRules>\n<!-- Spotting")
    assert text.endswith("</InteractionRule>\n</InteractionRules>\n")
    assert [rule.name for rule in there.outline.rules] == ["Gaze", "Greeting", "Listening", "Listening 2", "My Rule"]
    gone = after(there, RemoveRule("My Rule"))
    assert "rules/my_rule.xml" not in gone.files


# --- statements ---------------------------------------------------------------------------------------------------


def test_functions_are_added_moved_and_removed() -> None:
    added = rule_after('  <State id="A"/>', AddStatement(at((0,)), ASSIGN))
    function = '      <function assignValue="person_greeted = true"/>\n'
    assert added == f'  <State id="A">\n    <onEntry>\n{function}    </onEntry>\n  </State>'
    assert rule_after(added, RemoveStatement(at((0,)))) == '  <State id="A"/>'
    event = CallForm("raiseEventTopic", "hey", keep="2s")
    two = rule_after(added, AddStatement(at((0,)), event))
    assert '    <onEntry>\n      <function raiseEventTopic="/hey" keep="2s"/>\n      <function assignValue' in two
    assert rule_after(two, MoveStatement(at((0,)), 1), MoveStatement(at((1,)), 0)) == two
    exits = rule_after(added, AddStatement(at((0,), "onExit"), event))
    assert exits.index("</onEntry>") < exits.index("<onExit>")
    starts = CallForm("startInteractionRule", "Gaze", state="Pausing", enter=False)
    changed = rule_after(added, SetCall(at((0,)), starts))
    assert '<function startInteractionRule="Gaze" state="Pausing" enter="no"/>' in changed


def test_an_if_is_made_with_its_branches() -> None:
    form = IfForm(
        (BranchForm("person_near", (ASSIGN,)), BranchForm("1 < 2"), BranchForm(None, (OneOfForm((ASSIGN, ASSIGN)),)))
    )
    text = rule_after('  <State id="A"/>', AddStatement(at((0,), "onExit"), form))
    function = '<function assignValue="person_greeted = true"/>'
    assert (
        text
        == f"""  <State id="A">
    <onExit>
      <if cond="person_near">
        {function}
        <elseif cond="1 &lt; 2"/>
        <else>
          <oneOf>
            {function}
            {function}
          </oneOf>
        </else>
      </if>
    </onExit>
  </State>"""
    )


INSIDE = """  <State id="A">
    <onEntry>
      <if cond="person_near">
        <function assignValue="person_greeted = true"/>
      <else>
        <function assignValue="person_greeted = false"/>
      </else>
      </if>
    </onEntry>
  </State>"""
BEHIND = """  <State id="A">
    <onEntry>
      <if cond="person_near">
        <function assignValue="person_greeted = true"/>
      </if>
      <!-- otherwise -->
      <else>
        <function assignValue="person_greeted = false"/>
      </else>
    </onEntry>
  </State>"""


def conditions(text: str) -> list[str | None]:
    """The conditions of the first statement's branches, and how many statements there are in each."""
    (statement, *_) = with_rule(text).outline.rules[1].states[0].on_entry
    return [branch.condition for branch in statement.branches]


@pytest.mark.parametrize("text", [INSIDE, BEHIND])
def test_branches_keep_standing_where_they_stand(text: str) -> None:
    more = rule_after(text, AddBranch(at((0, 1)), "person_greeted"))
    assert conditions(more) == ["person_near", "person_greeted", None]
    assert len(more.splitlines()) == len(text.splitlines()) + 1
    assert rule_after(more, RemoveStatement(at((0, 1)))) == text
    changed = rule_after(text, SetBranchCondition(at((0, 0)), "not person_near"))
    assert changed == text.replace('cond="person_near"', 'cond="not person_near"')
    filled = rule_after(text, AddStatement(at((0, 0, 1)), CallForm("raiseEventTopic", "near")))
    assert 'true"/>\n        <function raiseEventTopic="/near"/>\n' in filled
    without = rule_after(text, RemoveStatement(at((0, 1))))
    assert conditions(without) == ["person_near"]


@pytest.mark.parametrize("text", [INSIDE, BEHIND])
def test_an_if_goes_and_moves_with_its_else(text: str) -> None:
    more = rule_after(text, AddStatement(at((1,)), CallForm("raiseEventTopic", "near")))
    assert more.index("</else>") < more.index("/near")
    moved = rule_after(more, MoveStatement(at((0,)), 1))
    assert moved.index("/near") < moved.index("person_near")
    gone = rule_after(moved, RemoveStatement(at((1,))))
    assert "if" not in gone
    assert "else" not in gone


def test_what_branches_cannot_do() -> None:
    study = with_rule(INSIDE)
    assert "has an `else` already" in refusal(study, AddBranch(at((0, 2)), None))
    assert "the first branch is the `if` itself" in refusal(study, AddBranch(at((0, 0)), "a"))
    assert "an `else` has no condition" in refusal(study, SetBranchCondition(at((0, 1)), "a"))
    assert "the first branch holds the others" in refusal(study, RemoveStatement(at((0, 0))))
    assert "keep their order" in refusal(study, MoveStatement(at((0, 0)), 1))
    assert "no statement number 7" in refusal(study, AddStatement(at((7, 0, 0)), ASSIGN))
    assert "needs to know what" in refusal(study, AddStatement(at((0,)), CallForm("raiseEventTopic", "/")))
    assert "goes with startInteractionRule" in refusal(
        study, AddStatement(at((0,)), CallForm("assignValue", "a = 1", "S"))
    )


def test_what_a_template_brings_is_left_alone() -> None:
    study = study_state("greeting")
    way = study.outline.rule("Greeting")
    assert way is not None
    reason = "it comes from the template `SayThen`, used here (rules/greeting.xml, line 47)"
    address = StatementAddress("Greeting", "Greet", "onEntry", 0, (0,))
    assert refusal(study, SetCall(address, ASSIGN)).endswith(reason)
    assert refusal(study, AddTransition("Greeting", "Greet", EVENT)).endswith(reason)
    there = after(study, SetUseParameter(FILE, 1, "SayThen", "act", "R_Smile"))
    assert changed_lines(study.files, there.files) == (1, 1)
    assert "did you mean `act`?" in refusal(study, SetUseParameter(FILE, 1, "SayThen", "atc", "R_Smile"))
    assert "it has no default" in refusal(study, SetUseParameter(FILE, 1, "SayThen", "act", None))


def test_a_file_is_written_whole() -> None:
    study = study_state("greeting", "bom_tabs")
    text = study.files[FILE].decode("utf-8-sig")
    assert plan(ReplaceFile(FILE, text), study).written == {}
    there = after(study, ReplaceFile(FILE, text + "<!-- end -->"))
    assert there.files[FILE].startswith(b"\xef\xbb\xbf<")
    assert "leads out of the study's folder" in refusal(study, ReplaceFile("../x.xml", "<a/>"))
