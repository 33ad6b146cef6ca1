"""A rule changed and tried in the editor itself, on files."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.scenario.loader import load
from rise_tui.editor.model.statement_forms import CallRuleForm
from rise_tui.editor.rule_page import RulePage
from tests.tui.editor.conftest import Editor, editor

pytestmark = pytest.mark.slow


async def opened(it: Editor, rule: str) -> RulePage:
    await it.open("rule", rule)
    page = it.screen.page
    assert isinstance(page, RulePage)
    await it.until(lambda: page.editor.spot is not None)
    return page


def state_of(page: RulePage) -> str:
    """The state under the cursor."""
    return page.editor.spot.state if page.editor.spot is not None else ""


async def test_a_way_is_one_line_of_the_file_and_undo_gives_the_same_bytes(study: Path) -> None:
    file = study / "rules/greeting.xml"
    before = file.read_bytes()
    async with editor(study) as it:
        page = await opened(it, "Greeting")
        await it.press("a", "tab", *"W_close", "tab", "tab", *"Closed", "enter")
        assert page.editor.spot is not None and page.editor.spot.transition == 2, "the cursor is on the new transition"
        assert file.read_bytes() == before, "nothing is written before it is saved"
        changed = page.draft.files["rules/greeting.xml"]
        line = b'    <transition eventTopic="/W_close" target="Closed"/>\n'
        assert changed.replace(line, b"", 1) == before, "one line more"
        await it.press("ctrl+u")
        assert page.draft.files["rules/greeting.xml"] == before
        await it.press("ctrl+r", "ctrl+o", "enter")
        await it.until(lambda: not it.screen.study.draft.changed_files)
        assert file.read_bytes() == changed
    assert load(str(study)).scenario is not None


async def test_a_trial_goes_with_the_changes_is_kept_as_a_test_and_not_made_of_an_error(study: Path) -> None:
    async with editor(study, (120, 40)) as it:
        page = await opened(it, "Greeting")
        await it.press("a", "right", "tab", *"person_near and not", "tab", *"Closed", "enter")
        assert page.draft.checked.scenario is None
        assert any(row.startswith("✗") for row in page.editor.graph.text.splitlines())
        await it.press("t")
        assert not page.is_trying
        assert "fix the error first" in it.notice
        await it.press("ctrl+u", "t")
        assert page.has_class("-trying") and page.editor.display and page.trial.rows.has_focus
        await it.until(lambda: state_of(page) == "Nobody", "the cursor follows the trial")
        await it.press("a")  # a key of the study: somebody comes near
        await it.until(lambda: state_of(page) == "Visitor comes")
        await it.press("left")
        await it.until(lambda: state_of(page) == "Nobody")
        await it.press("a")
        await it.until(lambda: state_of(page) == "Visitor comes")
        await it.press("ctrl+k", *"Greeting", "enter")
        await it.until(lambda: "new file: tests/greeting.jsonl" in it.notice)
        assert [name for name in page.draft.files if name.startswith("tests/")] == ["tests/greeting.jsonl"]
        await it.press("escape")
        assert not page.is_trying and page.editor.graph.has_focus
        await it.press("ctrl+o", "enter")
        await it.until(lambda: not it.screen.study.draft.changed_files)
    kept = (study / "tests/greeting.jsonl").read_text()
    assert '"key": "a"' in kept and "Visitor comes" in kept


async def test_a_state_is_renamed_wherever_it_is_named(study: Path) -> None:
    async with editor(study) as it:
        page = await opened(it, "Gaze")
        await it.press("r", *["backspace"] * len("Nobody"), *"Alone", "enter")
        assert state_of(page) == "Alone"
        rule = page.editor.rule
        assert rule is not None and rule.initial == "Alone"
        assert page.draft.checked.scenario is not None, "what a template leads to is renamed too"


async def test_after_a_removal_the_cursor_stays_among_its_kind(study: Path) -> None:
    async with editor(study) as it:
        page = await opened(it, "Greeting")
        page.editor.go_to_state("Visitor comes")
        await it.press("tab")
        parts = page.editor.parts
        await it.press("home", "down", "delete")
        assert "R_Notice" not in page.draft.files["rules/greeting.xml"].decode().partition("<transition ended")[0]
        assert parts.section_of(parts.cursor).startswith("heading:onEntry"), parts.text
        await it.press("a")
        assert isinstance(page.editor.panel.form, CallRuleForm), "it adds a function, and no transition"
