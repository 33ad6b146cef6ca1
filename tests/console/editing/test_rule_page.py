"""A rule on the screen: what keys do, and which edits come of them."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from textual.pilot import Pilot

from rise_engine.edit.edits import (
    AddState,
    AddTransition,
    SetTransition,
    TransitionForm,
)
from rise_tui.editing.rules.rule_page import RulePage
from tests.console.editing.pages import PageApp, StudyInMemory


@asynccontextmanager
async def opened(
    study: StudyInMemory, rule: str = "Course", size: tuple[int, int] = (80, 24)
) -> AsyncIterator[tuple[Pilot[None], RulePage]]:
    page = RulePage(study, rule)
    async with PageApp(page).run_test(size=size) as pilot:
        await pilot.pause()
        yield pilot, page


async def test_a_new_way_is_made_trigger_first() -> None:
    study = StudyInMemory()
    async with opened(study) as (pilot, page):
        await pilot.press("a", "right", "tab", *"happy", "tab", *"Brea", "k", "enter")
        await pilot.pause()
        assert study.edits == [
            (
                AddState("Course", "Break", after="Start"),
                AddTransition("Course", "Start", TransitionForm(condition="happy", target="Break")),
            )
        ], page.panel.answer.text
