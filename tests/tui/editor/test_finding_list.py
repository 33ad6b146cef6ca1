"""What is wrong, and what can be done about it, by keys."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_tui.editor.dialogs import PickList
from tests.tui.editor.conftest import Editor, editor

RULE = "rules/gaze.xml"


def write_wrong(study: Path, *wrong: tuple[str, str, str]) -> None:
    for file, old, new in wrong:
        text = (study / file).read_text()
        assert old in text
        (study / file).write_text(text.replace(old, new, 1))


async def show_remedies(it: Editor) -> None:
    """Of the first finding."""
    await it.press("f")
    findings = await it.shows(PickList)
    await it.press("tab")
    await it.until(lambda: it.pilot.app.screen is not findings)


@pytest.mark.slow
async def test_a_finding_is_mended_with_three_keys_and_taken_back_with_one(study: Path) -> None:
    write_wrong(study, (RULE, 'startCommunicationRobotAct="R_FollowGaze"', 'startCommunicationRobotAct="R_FolowGaze"'))
    async with editor(study) as it:
        wrong = it.screen.study.draft.files
        await show_remedies(it)
        await it.shows(PickList)
        await it.press("enter")
        await it.until(lambda: "R_FolowGaze" not in it.draft_text)
        await it.until(lambda: "rules/gaze.xml, line 10, is" in it.notice)
        assert it.screen.study.draft.findings == []
        await it.press("ctrl+u")
        await it.until(lambda: it.screen.study.draft.files == wrong)
        await show_remedies(it)
        await it.shows(PickList)
        await it.press("down", "enter")  # another remedy than the first
        await it.until(lambda: it.screen.study.draft.outline.act("R_FolowGaze") is not None)


async def test_what_only_the_author_can_say_is_said_and_enter_goes_there(study: Path) -> None:
    write_wrong(study, (RULE, 'target="Back to default"/>', 'target=""/>'))
    async with editor(study) as it:
        await show_remedies(it)
        await it.until(lambda: "only you can decide what is right here" in it.notice)
        await it.press("f", "escape")
        await it.until(lambda: it.pilot.app.screen is it.screen)
        await it.press("f")
        await it.shows(PickList)
        await it.press("enter")
        await it.until(lambda: it.screen.opened is not None and it.screen.opened.KIND == "rule")
