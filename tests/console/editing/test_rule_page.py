"""A rule on the screen: what keys do, and which edits come of them."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import pytest
from textual.pilot import Pilot

from rise_engine.edit.edits import (
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
from rise_tui.editing.chooser import Chooser
from rise_tui.editing.model.rule_graph import GraphSpot
from rise_tui.editing.rules.rule_editor import RuleEditor
from tests.console.editing.pages import PageApp, StudyInMemory
from tests.console.editing.small_study import RULES

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


async def settle(pilot: Pilot[Any]) -> None:
    """Until what a key asked for has been done."""
    await pilot.pause()
    await pilot.app.workers.wait_for_complete()
    await pilot.pause()


async def go_to(pilot: Pilot[Any], page: RuleEditor, spot: GraphSpot) -> None:
    """Walk the graph down to a place."""
    for _ in range(page.graph.count):
        if page.spot == spot:
            return
        await pilot.press("down")
        await settle(pilot)
    raise AssertionError(f"the cursor never came to {spot}")


async def edits_after(*keys: str, rule: str = "Course") -> list[tuple[AnyEdit, ...]]:
    """The edits that come of these keys, pressed on the rule's page."""
    study = StudyInMemory()
    async with opened(study, rule) as (pilot, _):
        for key in keys:
            await pilot.press(key)
            await settle(pilot)
    return study.edits


def entry(*path: int) -> StatementAddress:
    return StatementAddress("Course", "Start", "onEntry", path=path)


async def test_a_new_way_is_made_trigger_first() -> None:
    edits = await edits_after("a", "right", "tab", *"happy", "tab", *"Break", "enter")
    assert edits == [
        (
            AddState("Course", "Break", after="Start"),
            AddTransition("Course", "Start", TransitionForm(condition="happy", target="Break")),
        )
    ]


async def test_a_way_is_changed_where_it_stands() -> None:
    down = ["tab", *["down"] * 13]
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await pilot.press(*down)
        assert page.parts.part is not None and page.parts.part.text == "2 as soon as /skip happens"
        assert page.spot is not None and page.spot.way == 1, "the graph's cursor follows"
        await pilot.press("enter")
        await settle(pilot)
        await pilot.press("tab", *["backspace"] * len(" and not happy"))
        await settle(pilot)
        assert "step is 0 at the start: true" in page.panel.rows[2].query("StaticLines").last().text  # type: ignore[attr-defined]
        await pilot.press("enter")
        await settle(pilot)
        assert page.parts.has_focus and not page.panel.is_open
    changed = TransitionForm(event="/skip", condition="step < 4", target="End")
    assert study.edits == [(SetTransition("Course", "Start", 1, SKIP, changed),)]


async def test_esc_leaves_everything_as_it_was() -> None:
    assert await edits_after("a", *"tab", "escape") == []
    assert await edits_after("tab", "down", "enter", "enter") == [], "done without a change changes nothing"


async def test_nothing_but_enter_and_esc_leads_out_of_a_form() -> None:
    async with opened(StudyInMemory()) as (pilot, page):
        await pilot.press("a")
        await settle(pilot)
        for key in ("up", "up", "down", "tab", "shift+tab", "tab", "tab", "tab"):
            await pilot.press(key)
            await settle(pilot)
            assert any(row.is_focused for row in page.panel.rows)


async def test_what_waits_for_nothing_is_not_made() -> None:
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await pilot.press("a")
        await settle(pilot)
        await pilot.press("enter")
        await settle(pilot)
        assert "it waits for nothing yet" in page.panel.answer.text
        assert page.panel.is_open and not study.edits


async def test_a_refusal_stays_in_the_form() -> None:
    study = StudyInMemory()
    study.refusal = "the folder cannot be written"
    async with opened(study) as (pilot, page):
        await pilot.press("n")
        await settle(pilot)
        await pilot.press(*"Break", "enter")
        await settle(pilot)
        assert study.said == ["the folder cannot be written"]
        assert page.panel.is_open


async def test_functions_are_added_changed_and_moved() -> None:
    assert await edits_after("tab", "down", "a", *"R_Bye", "enter") == [
        (AddStatement(entry(1), CallForm("startCommunicationRobotAct", "R_Bye")),)
    ]
    assert await edits_after("tab", "down", "enter", "tab", "backspace", "2", "enter") == [
        (SetCall(entry(0), CallForm("assignValue", "step = 2")),)
    ]
    assert await edits_after("tab", "down", "down", "down", "delete") == [(RemoveStatement(entry(1, 0, 0)),)]


async def test_a_function_is_put_into_a_condition_and_into_a_choice() -> None:
    to_hello = ["tab", "down", "down", "down"]
    assert await edits_after(*to_hello, "o", *"happy", "enter") == [
        (
            RemoveStatement(entry(1, 0, 0)),
            AddStatement(entry(1, 0, 0), IfForm((BranchForm("happy", (HELLO,)),))),
        )
    ]
    assert await edits_after(*to_hello, "b") == [
        (RemoveStatement(entry(1, 0, 0)), AddStatement(entry(1, 0, 0), OneOfForm((HELLO,))))
    ]
    assert await edits_after("tab", "down", "down", "l", *"step = 1", "enter") == [
        (AddBranch(entry(1, 2), "step = 1"),)
    ]
    assert await edits_after("tab", "down", "down", "enter", "backspace", "5", "enter") == [
        (SetBranchCondition(entry(1, 0), "step < 5"),)
    ]


async def test_states_are_made_renamed_removed_and_made_the_first() -> None:
    assert await edits_after("n", *"Break", "enter") == [(AddState("Course", "Break", after="Start"),)]
    assert await edits_after("r", "x", "enter") == [(Rename("state", "Course/Start", "Startx"),)]
    assert await edits_after("delete") == [(RemoveState("Course", "Start"),)]
    assert await edits_after("end", "i") == [(SetInitial("Course", "End"),)]
    assert await edits_after("i") == [], "it begins there already"


async def test_ways_are_moved_and_removed_in_the_graph() -> None:
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await go_to(pilot, page, GraphSpot("Start", 1))
        await pilot.press("[")
        await settle(pilot)
        assert page.spot == GraphSpot("Start", 0), "the cursor goes with it"
    assert study.edits == [(MoveTransition("Course", "Start", 1, SKIP, 0),)]
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await go_to(pilot, page, GraphSpot("Start", 1))
        await pilot.press("delete")
    assert study.edits == [(RemoveTransition("Course", "Start", 1, SKIP),)]


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


async def test_names_are_chosen_from_a_list_that_filters() -> None:
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await pilot.press("a")
        await settle(pilot)
        await pilot.press("tab", "f2")
        await settle(pilot)
        assert isinstance(pilot.app.screen, Chooser)
        await pilot.press(*"stop_it")
        await settle(pilot)
        assert pilot.app.screen.list.text.strip().startswith("/stop_it")
        await pilot.press("enter")
        await settle(pilot)
        await pilot.press("tab", "f2")
        await settle(pilot)
        await pilot.press(*"happy", "enter")
        await settle(pilot)
        await pilot.press("enter")
        await settle(pilot)
        assert not page.panel.is_open
    assert study.edits == [(AddTransition("Course", "Start", TransitionForm(event="/stop_it", condition="happy")),)]


async def test_an_event_that_nobody_raises_gets_a_key_of_the_keyboard() -> None:
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await go_to(pilot, page, GraphSpot("Start", 1))
        await pilot.press("enter")
        await settle(pilot)
        await pilot.press("f5")
        await settle(pilot)
        await pilot.press("n")
        await settle(pilot)
        await pilot.press("enter")
        await settle(pilot)
        assert "does something else already" in page.panel.answer.text
        await pilot.press("backspace", "k", "enter")
        await settle(pilot)
    assert study.edits == [(SetSetting(("keys", "k"), {"event": "/skip"}),)]


async def test_findings_stand_beside_what_they_are_about() -> None:
    line = RULES[: RULES.index(b"/skip")].count(b"\n") + 1
    found = Diagnostic("error", "condition", "it has no end", SourceLocation("rules/course.xml", line, 40))
    study = StudyInMemory(findings=[found])
    async with opened(study) as (pilot, page):
        (marked,) = (row for row in page.graph.text.splitlines() if row.startswith("✗"))
        assert "skip if step < 4" in marked
        await go_to(pilot, page, GraphSpot("Start", 1))
        await pilot.pause()
        assert "✗ it has no end" in page.state_heading.text


async def test_a_rule_without_states_says_what_to_do() -> None:
    study = StudyInMemory({"rules/course.xml": b'<InteractionRule name="Empty" initial="A"/>'})
    async with opened(study, "Empty") as (pilot, page):
        assert "n makes one" in page.graph.text
        await pilot.press("n")
        await settle(pilot)
        await pilot.press("A", "enter")
        await settle(pilot)
        assert study.edits == [(AddState("Empty", "A", after=""),)]
        study.files = {}
        page.redraw()
        assert "not there any more" in page.graph.text


async def test_every_size_shows_graph_and_list() -> None:
    for size in ((80, 24), (120, 40), (200, 50)):
        async with opened(StudyInMemory(), size=size) as (pilot, page):
            assert page.graph.size.height >= 4 and page.parts.size.height >= 3
            await pilot.press("a")
            await settle(pilot)
            assert page.panel.is_open and page.graph.size.height >= 4
            assert all(row.region.bottom <= size[1] for row in page.panel.rows)


async def test_what_is_typed_at_once_goes_into_the_form() -> None:
    study = StudyInMemory()
    async with opened(study) as (pilot, _):
        await pilot.press("n", *"inbe", "enter")  # `i`, `n` and `b` are commands where no form is open
        await settle(pilot)
    assert study.edits == [(AddState("Course", "inbe", after="Start"),)]
