"""What the editor looks like: where things stand and in which colours. Looked at whenever one of them changes."""

from __future__ import annotations

import shutil
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot

from rise_engine.author.edit.workspace import Workspace
from rise_tui.editor.dialogs import PickList, SaveDialog
from rise_tui.editor.model.draft import draft_of
from rise_tui.editor.rule_page import RulePage
from rise_tui.editor.screen import EditApp
from rise_tui.editor.study import EditedStudy, Explorer
from tests.tui.editor.conftest import STUDIES, Editor, OneSession
from tests.tui.editor.long_rule import long_rule_files
from tests.tui.editor.test_editor import open_speech
from tests.tui.editor.test_exploring import FOUND, Explorers, on_a_state
from tests.tui.editor.test_table_grid import folder as folder
from tests.tui.editor.test_table_grid import open_at as open_table
from tests.tui.editor.test_texts_page import open_at as open_text
from tests.tui.editor.texts_study import STALE, copy_lablinking

SIZES = {"small": (80, 24), "usual": (120, 40)}
Steps = Callable[[Editor], Awaitable[None]]
Compare = Callable[..., bool]


@pytest.fixture
def looks_as_before(snap_compare: Any, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Compare:
    """Opens an editor on a study, does some steps, and compares the screen."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))

    def compare(folder: Path, size: str, steps: Steps, explorer: Explorer | None = None) -> bool:
        workspace = Workspace(folder)
        study = EditedStudy(workspace, draft_of(workspace))
        app = EditApp(study, sessions=OneSession(), explorer=explorer)

        async def before(pilot: Pilot[Any]) -> None:
            it = Editor(pilot, app.edit_screen, folder)
            await it.until(lambda: it.screen.home.rows.cursor >= 0)
            await steps(it)
            await it.until(lambda: not it.screen.study.busy)
            await pilot.pause()

        return bool(snap_compare(app, terminal_size=SIZES[size], run_before=before))

    return compare


@pytest.fixture
def lablinking(tmp_path: Path) -> Path:
    """A copy of the shipped study."""
    return Path(shutil.copytree(STUDIES / "lablinking", tmp_path / "lablinking"))


@pytest.fixture
def long_study(tmp_path: Path) -> Path:
    """A study whose course has 40 states and 120 ways."""
    for name, data in long_rule_files().items():
        file = tmp_path / "forty" / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)
    return tmp_path / "forty"


async def is_open(it: Editor, dialog: type) -> None:
    await it.until(lambda: isinstance(it.pilot.app.screen, dialog))


async def change_a_sentence(it: Editor) -> None:
    await open_speech(it, "R_Yes")
    await it.press("enter", "end")
    await it.type(" Well done")
    await it.press("enter")
    await it.until(lambda: "Well done" in it.draft_text)


@pytest.mark.parametrize("size", SIZES)
def test_the_list_of_a_study(looks_as_before: Compare, lablinking: Path, size: str) -> None:
    async def steps(it: Editor) -> None:
        it.screen.home.rows.select("act\0R_Task1_Step1")
        it.screen.draw()

    assert looks_as_before(lablinking, size, steps)


@pytest.mark.parametrize("size", SIZES)
def test_an_act_with_its_form(looks_as_before: Compare, lablinking: Path, size: str) -> None:
    async def steps(it: Editor) -> None:
        await open_speech(it, "R_Task1_Step1")
        await it.press("enter", "end")
        await it.type(" {side")
        await it.until(lambda: "without its" in it.screen.page.form.text)  # type: ignore[attr-defined]

    assert looks_as_before(lablinking, size, steps)


def test_a_chooser(looks_as_before: Compare, lablinking: Path) -> None:
    async def steps(it: Editor) -> None:
        await it.open("act", "R_Yes")
        await it.press("a")
        await is_open(it, PickList)

    assert looks_as_before(lablinking, "small", steps)


@pytest.mark.parametrize("size", SIZES)
def test_a_rule_of_forty_states(looks_as_before: Compare, long_study: Path, size: str) -> None:
    async def steps(it: Editor) -> None:
        await it.open("rule", "Course")
        page = it.screen.opened
        assert isinstance(page, RulePage)
        page.editor.go_to_state("Cups, at work")
        await it.press("down")

    assert looks_as_before(long_study, size, steps)


def test_the_form_of_a_way(looks_as_before: Compare, lablinking: Path) -> None:
    async def steps(it: Editor) -> None:
        await it.open("rule", "Table setting")
        page = it.screen.opened
        assert isinstance(page, RulePage)
        page.editor.go_to_state("After task 1, step 1")
        await it.press("a")
        await it.until(lambda: page.is_typing)

    assert looks_as_before(lablinking, "small", steps)


@pytest.mark.parametrize("size", SIZES)
def test_a_trial(looks_as_before: Compare, lablinking: Path, size: str) -> None:
    async def steps(it: Editor) -> None:
        await it.open("rule", "Table setting")
        page = it.screen.opened
        assert isinstance(page, RulePage)
        page.editor.go_to_state("After task 1, introduction")
        await it.press("t")
        await it.until(lambda: page.is_trying and page.trial.rows.count)
        await it.press("n")

    assert looks_as_before(lablinking, size, steps)


def test_the_memory(looks_as_before: Compare, lablinking: Path) -> None:
    async def steps(it: Editor) -> None:
        await it.open("memory")
        await it.press("down")

    assert looks_as_before(lablinking, "small", steps)


def test_the_keys(looks_as_before: Compare, lablinking: Path) -> None:
    async def steps(it: Editor) -> None:
        await it.open("keys")
        await it.press("down")

    assert looks_as_before(lablinking, "small", steps)


def test_what_would_be_saved(looks_as_before: Compare, lablinking: Path) -> None:
    async def steps(it: Editor) -> None:
        await change_a_sentence(it)
        await it.press("ctrl+o")
        await is_open(it, SaveDialog)

    assert looks_as_before(lablinking, "small", steps)


def test_what_is_wrong(looks_as_before: Compare, lablinking: Path) -> None:
    async def steps(it: Editor) -> None:
        await open_speech(it, "R_Yes")
        await it.press("enter", "end")
        await it.type(" {side} {name")
        await it.press("enter")
        await it.until(lambda: it.screen.study.draft.checked.errors)
        it.screen.action_do("edit.findings")
        await is_open(it, PickList)

    assert looks_as_before(lablinking, "small", steps)


def test_what_exploring_has_found(looks_as_before: Compare, study: Path) -> None:
    async def steps(it: Editor) -> None:
        await it.until(lambda: it.screen.explored.at)
        await it.open("rule", "Greeting\0Nobody")
        await it.until(lambda: on_a_state(it, "Nobody"))
        await it.press("f")
        await is_open(it, PickList)

    assert looks_as_before(study, "usual", steps, Explorers(FOUND))


@pytest.mark.parametrize("size", SIZES)
def test_the_texts(looks_as_before: Compare, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: str) -> None:
    monkeypatch.chdir(tmp_path)
    lab = copy_lablinking(tmp_path / "lab")

    async def steps(it: Editor) -> None:
        await open_text(it, STALE)

    assert looks_as_before(lab, size, steps)


@pytest.mark.parametrize("size", SIZES)
def test_the_tables(looks_as_before: Compare, folder: Path, size: str) -> None:
    async def steps(it: Editor) -> None:
        await open_table(it, "tables/instructions.csv:9")
        await it.press("right", "right")

    assert looks_as_before(folder, size, steps)
