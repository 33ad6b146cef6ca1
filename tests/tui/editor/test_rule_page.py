"""A rule on the screen: what keys do, and which edits come of them."""

from __future__ import annotations

from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager
from typing import Any

import pytest
from textual.pilot import Pilot

from rise_engine.author.edit.edits import (
    AddBranch,
    AddState,
    AddStatement,
    AddTransition,
    AnyEdit,
    BranchForm,
    CallForm,
    IfForm,
    MoveTransition,
    OneOfForm,
    RemoveState,
    RemoveStatement,
    RemoveTransition,
    Rename,
    SetBranchCondition,
    SetCall,
    SetInitial,
    SetSetting,
    SetTransition,
    SetUseParameter,
    StatementAddress,
    TransitionForm,
)
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.model import SourceLocation
from rise_tui.editor.dialogs import PickList
from rise_tui.editor.model.rule_graph import GraphSpot
from rise_tui.editor.rule_editor import RuleEditor
from tests.tui.editor.pages import PageApp, StudyInMemory, settle
from tests.tui.editor.small_study import RULES

pytestmark = pytest.mark.slow
HELLO = CallForm("startCommunicationRobotAct", "R_Hello")
SKIP = TransitionForm(event="/skip", condition="step < 4 and not happy", target="End")


@asynccontextmanager
async def opened(
    study: StudyInMemory, rule: str = "Course", size: tuple[int, int] = (80, 24)
) -> AsyncIterator[tuple[Pilot[Any], RuleEditor]]:
    page = RuleEditor(study, rule)
    async with PageApp(page).run_test(size=size) as pilot:
        await pilot.pause()
        yield pilot, page


async def go_to(pilot: Pilot[Any], page: RuleEditor, spot: GraphSpot) -> None:
    """Walk the graph down to a place."""
    for _ in range(page.graph.count):
        if page.spot == spot:
            return
        await pilot.press("down")
        await settle(pilot)
    raise AssertionError(f"the cursor never came to {spot}")


async def press(pilot: Pilot[Any], *keys: str) -> None:
    """Each when what the one before asked for has been done."""
    for key in keys:
        await pilot.press(key)
        await settle(pilot)


async def edits_after(*sequences: Sequence[str]) -> list[list[tuple[AnyEdit, ...]]]:
    """The edits that come of the keys of each sequence, pressed on a page of the rule that was just opened."""
    study, found = StudyInMemory(), []
    async with opened(study) as (pilot, _):
        for keys in sequences:
            await press(pilot, *keys)
            found.append(study.edits)
            study.edits = []
            await reopened(pilot, study)
    return found


async def reopened(pilot: Pilot[Any], study: StudyInMemory) -> RuleEditor:
    """The page of the rule, opened once more in the same app."""
    assert isinstance(pilot.app, PageApp)
    page = RuleEditor(study, "Course")
    await pilot.app.show(page)
    await settle(pilot)
    page.graph.focus()
    await settle(pilot)
    return page


def entry(*path: int) -> StatementAddress:
    return StatementAddress("Course", "Start", "onEntry", path=path)


async def test_keys_become_edits() -> None:
    to_hello = ("tab", "down", "down", "down")
    cases: list[tuple[str, Sequence[str], Sequence[tuple[AnyEdit, ...]]]] = [
        (
            "a new transition is made trigger first",
            ("a", "right", "tab", *"happy", "tab", *"Break", "enter"),
            [
                (
                    AddState("Course", "Break", after="Start"),
                    AddTransition("Course", "Start", TransitionForm(condition="happy", target="Break")),
                )
            ],
        ),
        ("esc leaves everything as it was", ("a", *"tab", "escape"), []),
        ("done without a change changes nothing", ("tab", "down", "enter", "enter"), []),
        (
            "a function is added",
            ("tab", "down", "a", *"R_Bye", "enter"),
            [(AddStatement(entry(1), CallForm("startCommunicationRobotAct", "R_Bye")),)],
        ),
        (
            "a function is changed",
            ("tab", "down", "enter", "tab", "backspace", "2", "enter"),
            [(SetCall(entry(0), CallForm("assignValue", "step = 2")),)],
        ),
        ("a function is removed", (*to_hello, "delete"), [(RemoveStatement(entry(1, 0, 0)),)]),
        (
            "it is put into a condition",
            (*to_hello, "o", *"happy", "enter"),
            [
                (
                    RemoveStatement(entry(1, 0, 0)),
                    AddStatement(entry(1, 0, 0), IfForm((BranchForm("happy", (HELLO,)),))),
                )
            ],
        ),
        (
            "it is put into a choice",
            (*to_hello, "b"),
            [(RemoveStatement(entry(1, 0, 0)), AddStatement(entry(1, 0, 0), OneOfForm((HELLO,))))],
        ),
        (
            "a condition gets an arm",
            ("tab", "down", "down", "l", *"step = 1", "enter"),
            [(AddBranch(entry(1, 2), "step = 1"),)],
        ),
        (
            "a condition is changed",
            ("tab", "down", "down", "enter", "backspace", "5", "enter"),
            [(SetBranchCondition(entry(1, 0), "step < 5"),)],
        ),
        ("a state is made", ("n", *"Break", "enter"), [(AddState("Course", "Break", after="Start"),)]),
        ("a state is renamed", ("r", "x", "enter"), [(Rename("state", "Course/Start", "Startx"),)]),
        ("a state is removed", ("delete",), [(RemoveState("Course", "Start"),)]),
        ("a state is made the first", ("end", "i"), [(SetInitial("Course", "End"),)]),
        ("it begins there already", ("i",), []),
    ]
    edits = await edits_after(*(keys for _, keys, _ in cases))
    for (what, _, wanted), found in zip(cases, edits, strict=True):
        assert found == wanted, what


async def test_a_way_is_changed_moved_and_removed_where_it_stands() -> None:
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await pilot.press("tab", *["down"] * 13)
        assert page.parts.part is not None and page.parts.part.text == "2 as soon as /skip happens"
        assert page.spot is not None and page.spot.transition == 1, "the graph's cursor follows"
        await press(pilot, "enter")
        await pilot.press("tab", *["backspace"] * len(" and not happy"))
        await settle(pilot)
        assert "step is 0 at the start: true" in page.panel.text
        await press(pilot, "enter")
        assert page.parts.has_focus and not page.panel.is_open
        page = await reopened(pilot, study)
        await go_to(pilot, page, GraphSpot("Start", 1))
        await press(pilot, "[")
        assert page.spot == GraphSpot("Start", 0), "the cursor goes with it"
        page = await reopened(pilot, study)
        await go_to(pilot, page, GraphSpot("Start", 1))
        await press(pilot, "delete")
    changed = TransitionForm(event="/skip", condition="step < 4", target="End")
    assert study.edits == [
        (SetTransition("Course", "Start", 1, SKIP, changed),),
        (MoveTransition("Course", "Start", 1, SKIP, 0),),
        (RemoveTransition("Course", "Start", 1, SKIP),),
    ]


async def test_a_form_is_left_by_enter_and_esc_alone_and_keeps_what_is_refused() -> None:
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await pilot.press("n", *"inbe", "enter")  # `i`, `n` and `b` are commands where no form is open
        await settle(pilot)
        assert study.edits == [(AddState("Course", "inbe", after="Start"),)], "what is typed at once goes into the form"
        await press(pilot, "a")
        for key in ("up", "up", "down", "tab", "shift+tab", "tab", "tab", "tab"):
            await press(pilot, key)
            assert page.panel.has_focus_within
        await press(pilot, "enter")
        assert "it waits for nothing yet" in page.panel.text
        assert page.panel.is_open and len(study.edits) == 1
        await press(pilot, "escape")
        study.refusal = "the folder cannot be written"
        await press(pilot, "n", *"Break", "enter")
        assert study.said == ["the folder cannot be written"]
        assert page.panel.is_open


async def test_what_comes_from_a_template_is_changed_in_its_use() -> None:
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await go_to(pilot, page, GraphSpot("Wait"))
        await pilot.press("tab", "down", "down")
        await pilot.press("enter")
        await settle(pilot)
        await pilot.press(*["backspace"] * 3, *"Start", "enter")
    use = study.outline.uses[0]
    assert study.edits == [(SetUseParameter("rules/course.xml", use.line, "Wait", "then", "Start"),)]


async def test_names_are_chosen_from_a_list_that_filters_and_an_event_gets_a_key() -> None:
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await press(pilot, "a", "tab", "f2")
        assert isinstance(pilot.app.screen, PickList)
        await press(pilot, *"stop_it")
        assert pilot.app.screen.list.text.strip().startswith("/stop_it")
        await press(pilot, "enter", "tab", "f2", *"happy", "enter", "enter")
        assert not page.panel.is_open
        page = await reopened(pilot, study)
        await go_to(pilot, page, GraphSpot("Start", 1))
        await press(pilot, "enter", "f5", "n", "enter")
        assert "does something else already" in page.panel.text
        await press(pilot, "backspace", "k", "enter")
    assert study.edits == [
        (AddTransition("Course", "Start", TransitionForm(event="/stop_it", condition="happy")),),
        (SetSetting(("keys", "k"), {"event": "/skip"}),),
    ]


async def test_findings_stand_beside_what_they_are_about_at_every_size() -> None:
    line = RULES[: RULES.index(b"/skip")].count(b"\n") + 1
    found = Diagnostic("error", "condition", "it has no end", SourceLocation("rules/course.xml", line, 40))
    async with opened(StudyInMemory(findings=[found])) as (pilot, page):
        (marked,) = (row for row in page.graph.text.splitlines() if row.startswith("✗"))
        assert "skip if step < 4" in marked
        await go_to(pilot, page, GraphSpot("Start", 1))
        await pilot.pause()
        assert "✗ it has no end" in page.state_heading.text
        for size in ((200, 50), (120, 40), (80, 24)):
            await pilot.resize_terminal(*size)
            assert page.graph.size.height >= 4 and page.parts.size.height >= 3
            await press(pilot, "a")
            assert page.panel.is_open and page.graph.size.height >= 4
            assert page.panel.region.bottom <= size[1]
            await press(pilot, "escape")


async def test_a_rule_without_states_says_what_to_do() -> None:
    study = StudyInMemory({"rules/course.xml": b'<InteractionRule name="Empty" initial="A"/>'})
    async with opened(study, "Empty") as (pilot, page):
        assert "n adds one" in page.graph.text
        await press(pilot, "n", "A", "enter")
        assert study.edits == [(AddState("Empty", "A", after=""),)]
        study.files = {}
        page.redraw()
        assert "no longer exists" in page.graph.text
