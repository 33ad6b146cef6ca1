"""The editor over a console: the session goes on, and its stop key works."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_tui.editor.screen import EditScreen
from tests.tui.conftest import console
from tests.tui.fake import DEMO, FakeClient, demo


async def test_the_palette_opens_it_no_key_starts_anything_and_f9_stops(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    shutil.copytree(DEMO, tmp_path / "study")
    client = FakeClient(replace(demo(), folder=str(tmp_path / "study")))
    async with console(client=client) as it:
        await it.press("colon", *("space" if letter == " " else letter for letter in "edit this"), "enter")
        await it.until(lambda: isinstance(it.app.screen, EditScreen))
        editor = it.app.screen
        assert isinstance(editor, EditScreen)
        await it.until(lambda: editor.home.rows.cursor >= 0)
        assert "keeps its own copy" in editor.notice.text
        for key in it.screen.store.scenario.keys:
            if key not in ("a", "r", "c", "w", "v", "u", "e", "f"):  # those are commands of the editor
                await it.press(key)
        assert it.client.sent == []
        await it.press("e")
        await it.until(lambda: "the stop key must work" in editor.notice.text)
        await it.press("f9")
        await it.sent("stopAll", "")
        await it.until(lambda: "STOP" in editor.notice.text)
        await it.press("escape")
        await it.until(lambda: it.app.screen is it.screen)
