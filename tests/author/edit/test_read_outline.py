"""The outline of a study says what the reader of scenarios reads, in every spelling."""

from __future__ import annotations

from collections.abc import Iterable

import pytest

from rise_engine.author.edit.outline import Outline, WrittenStatement
from rise_engine.author.edit.read_outline import read_outline
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Block, Function, If
from tests.author.edit.samples import NAMES, SPELLINGS, state_of, study_files, study_state


def meant(block: Block) -> list[object]:
    """Statements as the model has them."""
    return [
        (each.name, each.argument, each.state, each.enter)
        if isinstance(each, Function)
        else [(branch.condition.text if branch.condition else None, meant(branch.block)) for branch in each.branches]
        if isinstance(each, If)
        else ("one of", meant(each.choices))
        for each in block
    ]


def written(statements: Iterable[WrittenStatement]) -> list[object]:
    """Statements as the outline has them, with what templates bring."""
    found: list[object] = []
    for each in statements:
        if each.call is not None:
            found.append((each.call.function, each.call.argument, each.call.state, each.call.enter))
        elif each.branches:
            found.append([(branch.condition, written(branch.statements)) for branch in each.branches])
        elif each.template:
            found += written(each.brings)
        else:
            found.append(("one of", written(each.choices)))
    return found


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("spelling", SPELLINGS)
def test_the_outline_is_the_model(name: str, spelling: str) -> None:
    study = study_state(name, spelling)
    scenario, outline = study.checked.scenario, study.outline
    assert scenario is not None, [str(each) for each in study.checked.diagnostics]
    assert outline.unreadable == {}
    assert [act.name for act in outline.acts] == list(scenario.acts)
    for act in outline.acts:
        for shown, action in zip(act.actions, scenario.acts[act.name].actions, strict=True):
            assert (shown.id, shown.wait_for, shown.continues) == (
                action.id,
                action.wait_for,
                action.continue_on_failure,
            )
            for call, model in zip(shown.calls, action.calls, strict=True):
                texts = {key: value.text for key, value in call.parameters.items()}
                assert (call.type, texts) == (model.type, {key: each.text for key, each in model.parameters.items()})
    assert [rule.name for rule in outline.rules] == list(scenario.rules)
    for rule in outline.rules:
        expected = scenario.rules[rule.name]
        assert rule.initial == expected.initial
        assert [state.id for state in rule.states] == list(expected.states)
        for state in rule.states:
            other = expected.states[state.id]
            assert written(state.on_entry) == meant(other.on_entry)
            assert written(state.on_exit) == meant(other.on_exit)
            for way, transition in zip(state.transitions, other.transitions, strict=True):
                assert (way.form.target, way.form.ended) == (transition.target, transition.ended)
                assert (way.form.event or "").removeprefix("/") == (transition.event or "")
                assert way.form.condition == (transition.condition.text.strip() if transition.condition else None)
                assert written(way.statements) == meant(transition.block)


@pytest.mark.parametrize("spelling", SPELLINGS)
def test_spans_and_lines_are_where_elements_stand(spelling: str) -> None:
    files = study_files("greeting", spelling)
    for act in study_state("greeting", spelling).outline.acts:
        text = files[act.file].decode("utf-8-sig")
        assert text[act.node.start : act.node.end].startswith("<Dialog ")
        assert text[: act.node.end].endswith("</Dialog>")
        before = text[: act.node.start]
        assert act.line == len(before.replace("\r\n", "\n").replace("\r", "\n").split("\n"))


def outline_of(files: dict[str, str]) -> Outline:
    return read_outline(load("/nowhere", held={name: text.encode() for name, text in files.items()}).parts)


def test_what_is_wrong_is_shown_as_it_stands() -> None:
    outline = outline_of(
        {
            "acts/a.xml": "<Dialogs><Dialog name='A'><Speach><message>Hi</message></Speach></Dialog></Dialogs>",
            "acts/b.xml": "<Dialogs><Dialog name='B'>",
            "acts/c.xml": "<!DOCTYPE x><Dialogs/>",
            "rules/r.xml": (
                "<InteractionRule name='R'><State><onEntry><function say='A'/></onEntry></State></InteractionRule>"
            ),
        }
    )
    assert [action.calls[0].type for action in outline.acts[0].actions] == ["Speach"]
    assert list(outline.unreadable) == ["acts/b.xml", "acts/c.xml"]
    assert "DOCTYPE" in outline.unreadable["acts/c.xml"]
    (state,) = outline.rules[0].states
    assert (state.id, state.on_entry[0].call, state.on_entry[0].reason) == (
        "",
        None,
        "it names no known function",
    )


def test_texts_that_a_form_cannot_change_say_why() -> None:
    texts = {
        "one": "Well <!-- very --> done!",
        "two": "<![CDATA[A & B]]>",
        "three": "A <![CDATA[&]]> B",
        "four": "A &amp; <b/>",
        "five": "<speak>Hi <break/></speak>",
        "six": "two\n  lines &lt; more",
    }
    actions = "".join(
        f"<Speech><actionID>{id}</actionID><message>{text}</message></Speech>" for id, text in texts.items()
    )
    act = outline_of({"acts/a.xml": f"<Dialog name='A'>{actions}</Dialog>"}).acts[0]
    shown = {action.id: action.calls[0].parameters["message"] for action in act.actions}
    assert {id: (value.text, value.reason) for id, value in shown.items()} == {
        "one": ("Well  done!", "a comment is in it"),
        "two": ("A & B", ""),
        "three": ("A & B", "text and CDATA are side by side in it"),
        "four": ("A &", "`<b>` is in it"),
        "five": ("<speak>Hi <break/></speak>", ""),
        "six": ("two lines < more", ""),
    }


def test_what_templates_bring_says_from_where() -> None:
    outline = study_state("lablinking").outline
    act = outline.act("R_Task1_Step1")
    assert act is not None
    assert act.reason == "it comes from the template `Instruction`, used here"
    assert (act.template, act.name_parameter) == ("Instruction", "name")
    use = next(use for use in outline.uses if use.node is act.node)
    assert use.values["first"].text == "Take the large plate."
    assert use.parameters == {"name": None, "first": None, "second": None, "x": None, "y": "0"}
    message = act.actions[1].calls[0].parameters["message"]
    assert (message.text, message.parameter) == ("Take the large plate.", "first")
    rule = outline.rule("Table setting")
    assert rule is not None
    assert [state.template for state in rule.states][:3] == ["", "", "Wait"]


def test_templates_that_use_each_other_bring_nothing_for_ever() -> None:
    text = (
        "<Dialogs><Template name='A'><use template='B'/><use template='B'/></Template>"
        "<Template name='B'><use template='A'/><use template='A'/></Template><use template='A'/></Dialogs>"
    )
    outline = outline_of({"acts/a.xml": text})
    assert (outline.acts, outline.unreadable) == ((), {})


def test_branches_stand_inside_their_if_or_behind_it() -> None:
    block = (
        "<if cond='a'><function assignValue='x = 1'/><elseif cond='b'/></if>"
        "<else><function assignValue='x = 2'/></else>"
        "<function assignValue='y = 1'/>"
    )
    state = f"<State id='S'><onEntry>{block}</onEntry></State>"
    rule = f"<InteractionRule name='R' initial='S'>{state}</InteractionRule>"
    first, second = outline_of({"rules/r.xml": rule}).rules[0].states[0].on_entry
    assert [branch.condition for branch in first.branches] == ["a", "b", None]
    assert rule[first.node.start : first.last.end].endswith("</else>")
    assert second.call is not None


def test_a_file_that_has_not_changed_is_not_read_again() -> None:
    files = dict(study_files("greeting"))
    before = state_of(files, "greeting").outline
    files["rules/gaze.xml"] = b"<!-- new -->" + files["rules/gaze.xml"]
    after = state_of(files, "greeting").outline
    assert all(old is new for old, new in zip(before.acts, after.acts, strict=True))
    assert [rule.name for rule in after.rules if rule not in before.rules] == ["Gaze"]
