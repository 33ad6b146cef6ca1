"""Random edits of random studies in all spellings: nothing but what is said changes, and what is said does."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Callable
from typing import Any

import msgspec
from hypothesis import given, settings
from hypothesis import strategies as st

from rise_engine.author.edit.edits import (
    AddAct,
    AddAction,
    AddBranch,
    AddRule,
    AddState,
    AddStatement,
    AddTransition,
    AddVariant,
    AnyEdit,
    BranchForm,
    CallForm,
    CopyAct,
    CopyRule,
    IfForm,
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
    SetBranchCondition,
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
from rise_engine.author.edit.outline import WrittenRule, WrittenStatement
from rise_engine.author.edit.plan import EditRefused, Files, Plan, Splice, apply_plan
from rise_engine.author.edit.planning import StudyState, plan
from rise_engine.author.edit.states import same_form
from rise_engine.syntax.xml import XmlTree
from rise_engine.syntax.xml_writing import one_line
from tests.author.edit.guard import changed_paths, check_guard, differences, model_of
from tests.author.edit.samples import NAMES, SPELLINGS, changed_lines, state_of, study_state
from tests.chance import examples

TEXTS = st.builds(
    lambda first, more: (first + more).strip(),
    st.sampled_from(["a", "Grün & ", "<b>", "it's ", 'say "', "]]>", "{x|", "😀", "&amp;"]),
    st.text(st.characters(categories=("L", "N", "P", "S", "Zs"), exclude_characters="\u00a0"), max_size=12),
)
WORDS = st.sampled_from(["Grün", "x", "After <all> & more", "it's", 'say "hi"', "a" * 40])
CONDITIONS = st.sampled_from(["person_near", "1 < 2 && 3 > 2", 'name = "x"', "a = 'b' and\tc"])
_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_LINE_ENDS = re.compile(rb"\r\n|\r|\n")


class Maker:
    """Makes edits of what is there in a study."""

    def __init__(self, data: st.DataObject, study: StudyState) -> None:
        self.draw = data.draw
        self.study = study

    def act(self) -> AnyEdit:
        """Any edit of acts."""
        acts = [act for act in self.study.outline.acts if act.actions]
        act = self.draw(st.sampled_from([act for act in acts if not act.reason] or acts))
        action = self.draw(st.sampled_from([each for each in act.actions if not each.reason] or act.actions))
        ids = [each.id for each in act.actions]
        variant = self.draw(st.integers(0, len(action.calls) - 1))
        parameters = list(action.calls[variant].parameters) or ["duration"]
        some = st.lists(st.sampled_from(ids), max_size=3, unique=True).map(tuple)
        behind = st.sampled_from(["", *ids])
        text = self.draw(TEXTS)
        makers: list[Callable[[], AnyEdit]] = [
            lambda: SetParameter(act.name, action.id, self.draw(st.sampled_from(parameters)), text, variant),
            lambda: SetParameter(act.name, action.id, "duration", self.draw(st.sampled_from(["100", None]))),
            lambda: SetWaits(act.name, action.id, self.draw(some)),
            lambda: SetActionFailure(act.name, action.id, self.draw(st.booleans())),
            lambda: SetActionType(act.name, action.id, self.draw(st.sampled_from(["Speech", "Wait", "LookAt"]))),
            lambda: AddAction(act.name, "Speech", {"message": text}, self.draw(some), "", self.draw(behind)),
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
        state = self.draw(st.sampled_from([state for state in rule.states if not state.reason] or rule.states))
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
        branches = IfForm((BranchForm("1 < 2", (CallForm("assignValue", "x = 1"),)), BranchForm(None)))
        makers: list[Callable[[], AnyEdit]] = [
            lambda: AddStatement(at, call),
            lambda: AddStatement(at, branches),
            lambda: SetCall(at, call),
            lambda: RemoveStatement(at),
            lambda: MoveStatement(at, self.draw(st.integers(0, 3))),
            lambda: AddBranch(_longer(at, self.draw(st.integers(0, 2))), self.draw(st.sampled_from([None, "1 < 2"]))),
            lambda: SetBranchCondition(_longer(at, self.draw(st.integers(0, 2))), self.draw(CONDITIONS)),
            lambda: RemoveStatement(_longer(at, self.draw(st.integers(0, 2)))),
        ]
        return self.draw(st.sampled_from(makers))()

    def use(self) -> AnyEdit:
        """Another value for a parameter of a `<use>`."""
        use = self.draw(st.sampled_from([use for use in self.study.outline.uses if use.parameters]))
        parameter = self.draw(st.sampled_from(list(use.parameters)))
        return SetUseParameter(use.file, use.line, use.template, parameter, self.draw(TEXTS))


def _longer(at: StatementAddress, number: int) -> StatementAddress:
    return msgspec.structs.replace(at, path=(*at.path, number))


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


@settings(max_examples=examples(200))
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
    check_guard([edit], study, following)
    assert following.outline.unreadable == {}
    assert_form_of_the_files(study.files, files, edit, planned)
    assert_done(edit, study, following)
    assert is_done_once(edit, following)


def assert_form_of_the_files(before: Files, after: Files, edit: AnyEdit, planned: Plan) -> None:
    """Line ends are of the kind that they were; no comment is lost but with what holds it; lines are few."""
    assert bool(planned.says) == (before != after)
    for file in {*before, *after} - planned.written.keys():
        old, new = before[file], after[file]
        if old == new or not file.endswith(".xml"):
            continue
        assert set(_LINE_ENDS.findall(new)) <= set(_LINE_ENDS.findall(old)) or not _LINE_ENDS.search(old), edit
        assert new.startswith(b"\xef\xbb\xbf") == old.startswith(b"\xef\xbb\xbf")
        lost = Counter(_COMMENT.findall(old)) - Counter(_COMMENT.findall(new))
        if type(edit).__name__.startswith("Remove"):
            assert lost <= Counter(comments_within(old, [each for each in planned.splices if each.file == file])), edit
        else:
            assert not lost or isinstance(edit, SetActionType | SetParameter | SetWaits | SetActionFailure), edit
        assert old.startswith(b"<?xml") == new.startswith(b"<?xml")
        XmlTree(new.decode("utf-8-sig"))
    added, removed = changed_lines(before, after)
    if isinstance(edit, SetUseParameter | SetPriority | SetInitial | SetBranchCondition):
        assert added <= 2, edit  # a new attribute has a line of its own if the others have
        assert removed <= 2, edit  # a condition over two lines
    if isinstance(edit, SetParameter):
        assert added <= 1, edit
    if isinstance(edit, AddTransition | AddState | AddAction | AddAct | CopyAct | AddRule | CopyRule):
        assert removed <= 2  # <State id="A"/> is opened; a file in one line


def comments_within(data: bytes, splices: list[Splice]) -> list[bytes]:
    """The comments that stand in elements that go whole."""
    found: list[bytes] = []
    outermost_until = 0
    for node in XmlTree(data.decode("utf-8-sig")).root.walk():
        if node.start >= outermost_until and any(each.start <= node.start and node.end <= each.end for each in splices):
            outermost_until = node.end
            found += _COMMENT.findall(node.written.encode())
    return found


def assert_done(edit: AnyEdit, before: StudyState, after: StudyState) -> None:
    """The outline says what the edit said."""
    old: Any
    new: Any
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
        case RemoveAction(act=act, action=action):
            old, new = _waits(act, before), _waits(act, after)
            its = old.pop(action)
            for id, waits in old.items():
                expected = {*waits, *its} - {action, id} if action in waits else {*waits}
                assert set(new[id]) == expected, (id, waits)
        case AddVariant(act=act, action=action, parameters=parameters):
            old, new = _wordings(act, action, before), _wordings(act, action, after)
            assert new == [*old, {name: one_line(value) for name, value in parameters.items()}]
        case RemoveVariant(act=act, action=action, variant=variant):
            old, new = _wordings(act, action, before), _wordings(act, action, after)
            assert new == [*old[:variant], *old[variant + 1 :]]
        case CopyAct(act=act, name=name):
            assert _waits(name, after) == _waits(act, before)
            assert not [*differences(model_of(after)["acts"][name], model_of(before)["acts"][act])]
        case CopyRule(rule=rule, name=name):
            assert [*differences(model_of(after)["rules"][name], model_of(before)["rules"][rule])] == [("name",)]
        case AddAct(name=name):
            assert after.outline.act(name) is not None
        case RemoveAct(act=name):
            assert after.outline.act(name) is None
        case AddState(rule=rule, state=state):
            old, new = _states(rule, before), _states(rule, after)
            assert [each for each in new if each != state.strip()] == old
            assert edit.after == "" or new.index(state.strip()) > new.index(edit.after)
        case AddStatement() | RemoveStatement() | SetBranchCondition() | AddBranch():
            assert any(True for _ in changed_paths(before, after))


def _waits(act: str, study: StudyState) -> dict[str, tuple[str, ...]]:
    found = study.outline.act(act)
    assert found is not None
    return {action.id: action.wait_for for action in found.actions}


def _wordings(act: str, action: str, study: StudyState) -> list[dict[str, str]]:
    found = study.outline.act(act)
    assert found is not None
    calls = next(each for each in found.actions if each.id == action).calls
    return [{name: value.text for name, value in call.parameters.items()} for call in calls]


def _ways(rule: str, state: str, study: StudyState) -> list[TransitionForm]:
    found = study.outline.rule(rule)
    assert found is not None
    return [way.form for way in next(each for each in found.states if each.id == state).transitions]


def _states(rule: str, study: StudyState) -> list[str]:
    found = study.outline.rule(rule)
    assert found is not None
    return [state.id for state in found.states]


def is_done_once(edit: AnyEdit, after: StudyState) -> bool:
    """Whether what sets something to a value has nothing to do a second time."""
    if isinstance(
        edit, SetParameter | SetWaits | SetActionFailure | SetInitial | SetPriority | SetCall | SetUseParameter
    ):
        again = plan(edit, after)
        return again.splices == () and again.written == {}
    return True


@settings(max_examples=examples(25))
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
        except EditRefused:
            continue
        check_guard([edit], study, following)
        assert following.outline.unreadable == {}, edit
        assert "unexpected-text" not in {each.code for each in following.checked.diagnostics}, edit
        study = following


def test_edits_are_json_both_ways() -> None:
    data = {"edit": "add_state", "rule": "R", "state": "S", "after": ""}
    assert json.loads(msgspec.json.encode(AddState("R", "S"))) == data
    assert msgspec.json.decode(json.dumps(data), type=AnyEdit) == AddState("R", "S")
