"""Random edits of random studies in all spellings: nothing but what is said changes, and what is said does."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.edit.documents import read_document
from rise_engine.edit.edits import (
    AddAct,
    AddAction,
    AddRule,
    AddState,
    AddStatement,
    AddTransition,
    AddVariant,
    AnyEdit,
    CallForm,
    CopyAct,
    CopyRule,
    MoveStatement,
    MoveTransition,
    RemoveAct,
    RemoveAction,
    RemoveRule,
    RemoveState,
    RemoveStatement,
    RemoveTransition,
    RemoveVariant,
    SetActionFailure,
    SetActionType,
    SetCall,
    SetInitial,
    SetParameter,
    SetPriority,
    SetTransition,
    SetUseParameter,
    SetWaits,
    StatementAddress,
    TransitionForm,
)
from rise_engine.edit.guard import check_guard, model_of
from rise_engine.edit.outline import WrittenRule, WrittenStatement
from rise_engine.edit.plan import EditRefused, Files, Plan, apply_plan
from rise_engine.edit.planning import StudyState, plan
from rise_engine.edit.transitions import same_form
from rise_engine.edit.writing import one_line
from tests.edit.samples import NAMES, SPELLINGS, changed_lines, state_of, study_state

TEXTS = st.text(
    st.one_of(st.sampled_from("abc <>&\"']. {ß😀"), st.characters(exclude_categories=("Cs", "Cc", "Cn"))),
    min_size=1,
    max_size=20,
).filter(lambda text: bool(text.strip()) and text.strip().isprintable())
WORDS = st.sampled_from(["Grün", "x", "After <all> & more", "it's", 'say "hi"', "a" * 40])
CONDITIONS = st.sampled_from(["person_near", "1 < 2 && 3 > 2", 'name = "x"', "a = 'b' and\tc"])
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_LINE_ENDS = re.compile(rb"\r\n|\r|\n")

Draw = Callable[[st.SearchStrategy[object]], object]


class Maker:
    """Makes edits of what is there in a study."""

    def __init__(self, data: st.DataObject, study: StudyState) -> None:
        self.draw = data.draw
        self.study = study

    def act(self) -> AnyEdit:
        """Any edit of acts."""
        act = self.draw(st.sampled_from([act for act in self.study.outline.acts if act.actions]))
        action = self.draw(st.sampled_from(act.actions))
        ids = [each.id for each in act.actions]
        variant = self.draw(st.integers(0, len(action.calls) - 1))
        parameters = list(action.calls[variant].parameters) or ["duration"]
        some = st.lists(st.sampled_from(ids), max_size=3, unique=True).map(tuple)
        text = self.draw(TEXTS)
        makers: list[Callable[[], AnyEdit]] = [
            lambda: SetParameter(act.name, action.id, self.draw(st.sampled_from(parameters)), text, variant),
            lambda: SetParameter(act.name, action.id, "duration", self.draw(st.sampled_from(["100", None]))),
            lambda: SetWaits(act.name, action.id, self.draw(some)),
            lambda: SetActionFailure(act.name, action.id, self.draw(st.booleans())),
            lambda: SetActionType(act.name, action.id, self.draw(st.sampled_from(["Speech", "Wait", "LookAt"]))),
            lambda: AddAction(
                act.name, "Speech", {"message": text}, self.draw(some), after=self.draw(st.sampled_from(["", *ids]))
            ),
            lambda: RemoveAction(act.name, action.id),
            lambda: AddVariant(act.name, action.id, {"message": text}),
            lambda: RemoveVariant(act.name, action.id, variant),
            lambda: AddAct(self.draw(WORDS), text, after=self.draw(st.sampled_from(["", act.name]))),
            lambda: CopyAct(act.name, self.draw(WORDS)),
            lambda: RemoveAct(act.name),
        ]
        return self.draw(st.sampled_from(makers))()

    def rule(self) -> AnyEdit:
        """Any edit of rules and their states."""
        rule = self.draw(st.sampled_from(self.study.outline.rules))
        state = self.draw(st.sampled_from(rule.states))
        names = [each.id for each in rule.states]
        way = TransitionForm(
            event="hey" if self.draw(st.booleans()) else None,
            condition=self.draw(CONDITIONS),
            target=self.draw(st.sampled_from([None, *names])),
        )
        makers: list[Callable[[], AnyEdit]] = [
            lambda: AddState(rule.name, self.draw(WORDS), self.draw(st.sampled_from(["", state.id]))),
            lambda: RemoveState(rule.name, state.id),
            lambda: SetInitial(rule.name, state.id),
            lambda: SetPriority(rule.name, self.draw(st.sampled_from([None, "3"]))),
            lambda: AddTransition(rule.name, state.id, way, self.draw(st.sampled_from([None, 0, 1]))),
            lambda: AddRule(self.draw(WORDS), self.draw(WORDS), after=self.draw(st.sampled_from(["", rule.name]))),
            lambda: CopyRule(rule.name, self.draw(WORDS)),
            lambda: RemoveRule(rule.name),
        ]
        if state.transitions:
            index = self.draw(st.integers(0, len(state.transitions) - 1))
            was = state.transitions[index].form
            makers += [
                lambda: SetTransition(rule.name, state.id, index, was, way),
                lambda: RemoveTransition(rule.name, state.id, index, was),
                lambda: MoveTransition(rule.name, state.id, index, was, self.draw(st.integers(0, 3))),
            ]
        return self.draw(st.sampled_from(makers))()

    def statement(self) -> AnyEdit:
        """Any edit of statements."""
        rule = self.draw(st.sampled_from(self.study.outline.rules))
        places = [*_statements(rule)] or [StatementAddress(rule.name, rule.states[0].id, "onEntry", 0, (0,))]
        at = self.draw(st.sampled_from(places))
        call = self.draw(
            st.sampled_from(
                [
                    CallForm("assignValue", "x = 'a < b & c'"),
                    CallForm("raiseEventTopic", "hey", keep="2s"),
                    CallForm("startInteractionRule", rule.name, state=rule.states[0].id, enter=False),
                ]
            )
        )
        makers: list[Callable[[], AnyEdit]] = [
            lambda: AddStatement(at, call),
            lambda: SetCall(at, call),
            lambda: RemoveStatement(at),
            lambda: MoveStatement(at, self.draw(st.integers(0, 3))),
        ]
        return self.draw(st.sampled_from(makers))()

    def use(self) -> AnyEdit:
        """Another value for a parameter of a `<use>`."""
        use = self.draw(st.sampled_from([use for use in self.study.outline.uses if use.parameters]))
        parameter = self.draw(st.sampled_from(list(use.parameters)))
        return SetUseParameter(use.file, use.line, use.template, parameter, self.draw(TEXTS))


def _statements(rule: WrittenRule) -> list[StatementAddress]:
    found: list[StatementAddress] = []

    def walk(statements: tuple[WrittenStatement, ...], base: StatementAddress, path: tuple[int, ...]) -> None:
        for number, each in enumerate(statements):
            found.append(msgspec.structs.replace(base, path=(*path, number)))
            for branch_number, branch in enumerate(each.branches):
                walk(branch.statements, base, (*path, number, branch_number))
            walk(each.choices, base, (*path, number))

    for state in rule.states:
        walk(state.on_entry, StatementAddress(rule.name, state.id, "onEntry"), ())
        walk(state.on_exit, StatementAddress(rule.name, state.id, "onExit"), ())
        for index, way in enumerate(state.transitions):
            walk(way.statements, StatementAddress(rule.name, state.id, "transition", index), ())
    return found


@settings(max_examples=250)
@given(st.data(), st.sampled_from(NAMES), st.sampled_from(sorted(SPELLINGS)), st.integers(0, 7))
def test_an_edit_does_what_it_says_and_nothing_else(data: st.DataObject, name: str, spelling: str, kind: int) -> None:
    study = study_state(name, spelling)
    maker = Maker(data, study)
    kinds = [maker.act, maker.act, maker.act, maker.rule, maker.rule, maker.statement, maker.statement, maker.use]
    edit = kinds[kind]()
    assert msgspec.json.decode(msgspec.json.encode(edit), type=AnyEdit) == edit
    try:
        planned = plan(edit, study)
    except EditRefused as refused:
        assert len(str(refused)) > 10
        return
    files = apply_plan(study.files, planned)
    following = state_of(files, name)
    try:
        check_guard([edit], study, following)
    except EditRefused:
        # what a parameter of a <use> is named for, but also stands elsewhere in the template
        assert isinstance(edit, SetParameter)
        assert planned.splices[0].file in {use.file for use in study.outline.uses}
        return
    assert following.outline.unreadable == {}
    assert_form_of_the_files(study.files, files, edit, planned)
    assert_done(edit, study, following)
    assert plan_again_is_empty(edit, following)


def assert_form_of_the_files(before: Files, after: Files, edit: AnyEdit, planned: Plan) -> None:
    """Line ends are of the kind that they were; no comment is lost but with what holds it; lines are few."""
    assert bool(planned.says) == (before != after)
    for file in {*before, *after} - planned.written.keys():
        old, new = before[file], after[file]
        if old == new:
            continue
        assert set(_LINE_ENDS.findall(new)) <= set(_LINE_ENDS.findall(old)) or not _LINE_ENDS.search(old), edit
        assert new.startswith(b"\xef\xbb\xbf") == old.startswith(b"\xef\xbb\xbf")
        if not type(edit).__name__.startswith("Remove"):
            assert not Counter(_COMMENT.findall(old)) - Counter(_COMMENT.findall(new)), edit
        assert old.startswith(b"<?xml") == new.startswith(b"<?xml")
        read_document(new)
    added, removed = changed_lines(before, after)
    if (
        isinstance(edit, SetParameter)
        and edit.value is not None
        or isinstance(edit, SetUseParameter | SetPriority | SetInitial)
    ):
        assert added <= 2
    if isinstance(edit, AddTransition | AddState | AddAction | AddAct | CopyAct | AddRule | CopyRule):
        assert removed <= 2  # <State id="A"/> is opened; a file in one line


def assert_done(edit: AnyEdit, before: StudyState, after: StudyState) -> None:
    """The outline says what the edit said."""
    match edit:
        case SetParameter(act=act, action=action, parameter=parameter, value=value, variant=variant):
            found = after.outline.act(act)
            assert found is not None
            call = next(each for each in found.actions if each.id == action).calls[variant]
            text = None if parameter not in call.parameters else call.parameters[parameter].text
            assert text == (None if value is None else one_line(value))
        case SetWaits(act=act, action=action, wait_for=wait_for):
            found = after.outline.act(act)
            assert found is not None
            assert next(each for each in found.actions if each.id == action).wait_for == wait_for
        case AddTransition(rule=rule, state=state, transition=form, at=at):
            old, new = _ways(rule, state, before), _ways(rule, state, after)
            index = next(
                number
                for number, way in enumerate(new)
                if same_form(way, form) and [*new[:number], *new[number + 1 :]] == old
            )
            own = len(old) if at is None else at
            assert index <= own
        case SetTransition(rule=rule, state=state, index=index, transition=form):
            old, new = _ways(rule, state, before), _ways(rule, state, after)
            assert same_form(new[index], form)
            assert [*new[:index], *new[index + 1 :]] == [*old[:index], *old[index + 1 :]]
        case RemoveTransition(rule=rule, state=state, index=index):
            old, new = _ways(rule, state, before), _ways(rule, state, after)
            assert new == [*old[:index], *old[index + 1 :]]
        case MoveTransition(rule=rule, state=state, index=index, to=to):
            old, new = _ways(rule, state, before), _ways(rule, state, after)
            old.insert(min(to, len(old) - 1), old.pop(index))
            assert new == old
        case AddAct(name=name) | CopyAct(name=name):
            assert after.outline.act(name) is not None
        case RemoveAct(act=name):
            assert after.outline.act(name) is None
        case AddState(rule=rule, state=state):
            old, new = _states(rule, before), _states(rule, after)
            assert [each for each in new if each != state.strip()] == old
            assert edit.after == "" or new.index(state.strip()) > new.index(edit.after)
        case MoveStatement() | AddStatement() | RemoveStatement():
            assert (model_of(before) == model_of(after)) == (before.files == after.files) or isinstance(
                edit, MoveStatement
            )


def _ways(rule: str, state: str, study: StudyState) -> list[TransitionForm]:
    found = study.outline.rule(rule)
    assert found is not None
    return [way.form for way in next(each for each in found.states if each.id == state).transitions]


def _states(rule: str, study: StudyState) -> list[str]:
    found = study.outline.rule(rule)
    assert found is not None
    return [state.id for state in found.states]


def plan_again_is_empty(edit: AnyEdit, after: StudyState) -> bool:
    """What sets something to a value has nothing to do a second time."""
    if isinstance(
        edit, SetParameter | SetWaits | SetActionFailure | SetInitial | SetPriority | SetCall | SetUseParameter
    ):
        again = plan(edit, after)
        return again.splices == () and again.written == {}
    return True


@settings(max_examples=25)
@given(st.data(), st.sampled_from(["lf", "crlf", "comments", "one_line", "bom_tabs"]))
def test_a_series_of_edits_leaves_a_study_that_can_be_read(data: st.DataObject, spelling: str) -> None:
    study = study_state("greeting", spelling)
    for _ in range(6):
        maker = Maker(data, study)
        if not study.outline.rules or not any(act.actions for act in study.outline.acts):
            return
        edit = data.draw(st.sampled_from([maker.act, maker.rule, maker.statement]))()
        try:
            following = state_of(apply_plan(study.files, plan(edit, study)), "greeting")
            check_guard([edit], study, following)
        except EditRefused:
            continue
        assert following.outline.unreadable == {}, edit
        assert "unexpected-text" not in {each.code for each in following.checked.diagnostics}, edit
        study = following


def test_every_edit_is_planned_somewhere() -> None:
    assert json.loads(msgspec.json.encode(AddState("R", "S"))) == {
        "edit": "add_state",
        "rule": "R",
        "state": "S",
        "after": "",
    }
