"""A rule changed and tried in the editor itself, on files."""

from __future__ import annotations

import shutil
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot

from rise_engine.author.edit.workspace import Workspace
from rise_engine.scenario.loader import load
from rise_tui.editor.app import EditApp
from rise_tui.editor.model.draft import draft_of
from rise_tui.editor.rule_page import RulePage
from rise_tui.editor.study import EditedStudy, NoSessions

SCENARIOS = Path(__file__).parents[3] / "scenarios"
pytestmark = pytest.mark.slow


async def settle(pilot: Pilot[Any]) -> None:
    """Until what a key asked for has been done."""
    await pilot.pause()
    await pilot.app.workers.wait_for_complete()
    await pilot.pause()


async def press(pilot: Pilot[Any], *keys: str) -> None:
    for key in keys:
        await pilot.press(key)
        await settle(pilot)


def state_of(page: RulePage) -> str:
    """The state under the cursor."""
    return page.editor.spot.state if page.editor.spot is not None else ""


@asynccontextmanager
async def opened(
    folder: Path, rule: str, size: tuple[int, int] = (80, 24)
) -> AsyncIterator[tuple[Pilot[Any], EditApp, RulePage]]:
    workspace = Workspace(folder)
    app = EditApp(EditedStudy(workspace, draft_of(workspace)), sessions=NoSessions())
    async with app.run_test(size=size) as pilot:
        await settle(pilot)
        app.edit_screen.open_page("rule", rule)
        await settle(pilot)
        page = app.edit_screen.page
        assert isinstance(page, RulePage)
        yield pilot, app, page


@pytest.fixture
def greeting(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return Path(shutil.copytree(SCENARIOS / "greeting", tmp_path / "greeting"))


async def test_a_way_is_one_line_of_the_file_and_undo_gives_the_same_bytes(greeting: Path) -> None:
    file = greeting / "rules/greeting.xml"
    before = file.read_bytes()
    async with opened(greeting, "Greeting") as (pilot, _, page):
        await press(pilot, "a", "tab", *"W_close", "tab", "tab", *"Closed", "enter")
        assert page.editor.spot is not None and page.editor.spot.way == 2, "the cursor is on the new way"
        assert file.read_bytes() == before, "nothing is written before it is saved"
        changed = page.draft.files["rules/greeting.xml"]
        line = b'    <transition eventTopic="/W_close" target="Closed"/>\n'
        assert changed.replace(line, b"", 1) == before, "one line more"
        await press(pilot, "ctrl+u")
        assert page.draft.files["rules/greeting.xml"] == before
        await press(pilot, "ctrl+r", "ctrl+o", "enter")
        assert file.read_bytes() == changed
    assert load(str(greeting)).scenario is not None


async def test_a_trial_goes_with_the_changes_is_kept_as_a_test_and_not_made_of_an_error(greeting: Path) -> None:
    async with opened(greeting, "Greeting", (120, 40)) as (pilot, app, page):
        await press(pilot, "a", "right", "tab", *"person_near and not", "tab", *"Closed", "enter")
        assert page.draft.checked.scenario is None
        assert any(row.startswith("✗") for row in page.editor.graph.text.splitlines())
        await press(pilot, "t")
        assert not page.is_trying
        assert "fix the error first" in app.edit_screen.notice.text
        await press(pilot, "ctrl+u", "t")
        assert page.has_class("-trying") and page.editor.display and page.trial.rows.has_focus
        assert state_of(page) == "Nobody", "the cursor follows the trial"
        await press(pilot, "a")  # a key of the study: somebody comes near
        assert state_of(page) == "Visitor comes"
        await press(pilot, "left")
        assert state_of(page) == "Nobody"
        await press(pilot, "a", "ctrl+k", *"Greeting", "enter")
        assert [name for name in page.draft.files if name.startswith("tests/")] == ["tests/greeting.jsonl"]
        await press(pilot, "escape")
        assert not page.is_trying and page.editor.graph.has_focus
        await press(pilot, "ctrl+o", "enter")
    kept = (greeting / "tests/greeting.jsonl").read_text()
    assert '"key": "a"' in kept and "Visitor comes" in kept


async def test_a_state_is_renamed_wherever_it_is_named(greeting: Path) -> None:
    async with opened(greeting, "Gaze") as (pilot, _, page):
        await press(pilot, "r", *["backspace"] * len("Nobody"), *"Alone", "enter")
        assert state_of(page) == "Alone"
        rule = page.editor.rule
        assert rule is not None and rule.initial == "Alone"
        assert page.draft.checked.scenario is not None, "what a template leads to is renamed too"
