"""What a console finds again: kept soon after it has changed, never an error, never in anybody's way."""

from __future__ import annotations

import os
import stat
from pathlib import Path
from threading import Thread
from time import monotonic

import pytest

from rise_engine.run.protocol.registry import session_name
from rise_tui.config.preferences import (
    PREFERENCES_NAME,
    Preferences,
    SavedLayout,
    load_saved,
    state_folder,
    write_saved,
)
from rise_tui.console.layout import UiState
from rise_tui.rendering.themes import short_name
from tests.patience import PATIENCE
from tests.tui.conftest import Console, console
from tests.tui.fake import DEMO, FakeClient, demo
from tests.tui.terminals import terminal


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    return tmp_path / "rise-tui"


def kept_places() -> SavedLayout:
    return load_saved(state_folder() / f"{session_name(demo().folder)}.json", SavedLayout)[0]


def test_what_was_saved_is_loaded(own_state: Path) -> None:
    path = own_state / "deep" / "a.json"
    assert write_saved(path, SavedLayout({"upper": "act"}, {"log": "Ä"})) == ""
    assert load_saved(path, SavedLayout) == (SavedLayout({"upper": "act"}, {"log": "Ä"}), "")
    assert stat.S_IMODE(path.stat().st_mode) == 0o600 and stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    assert [each.name for each in path.parent.iterdir()] == ["a.json"], "a temporary file is left over"
    assert load_saved(own_state / "none.json", Preferences) == (Preferences(), "")


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{",
        b"[]",
        b"\xff\xfe",
        b'{"theme": "light", "font": "x"}',
        b'{"kind": "rise-tui console", "theme": 5}',
        b'{"kind": "rise-tui console", "theme": "light", "colour": "x"}',
        b'{"kind": "rise-tui scenario"}',
        b'{"kind": "rise-tui console", "theme": "' + b"x" * 200_000 + b'"}',
    ],
)
def test_a_broken_or_foreign_file_is_left_out_with_one_sentence(own_state: Path, content: bytes) -> None:
    own_state.mkdir()
    path = own_state / PREFERENCES_NAME
    path.write_bytes(content)
    found, said = load_saved(path, Preferences)
    assert found == Preferences() and said.startswith(f"{path} was not used: ") and "\n" not in said


def test_what_is_no_file_of_ours_is_left_out(own_state: Path) -> None:
    own_state.mkdir()
    write_saved(own_state / "real.json", Preferences("light"))
    (own_state / "link.json").symlink_to(own_state / "real.json")
    os.mkfifo(own_state / "pipe.json")
    (own_state / "folder.json").mkdir()
    for name in ("link", "pipe", "folder"):
        found, said = load_saved(own_state / f"{name}.json", Preferences)
        assert found == Preferences() and "was not used" in said, name


def test_what_cannot_be_written_is_a_sentence(own_state: Path) -> None:
    own_state.write_text("in the way")
    assert "cannot be saved for the next time" in write_saved(own_state / "a.json", Preferences())


def test_consoles_that_write_at_once_leave_a_whole_file(own_state: Path) -> None:
    path = own_state / PREFERENCES_NAME
    mixed: list[str] = []

    def write(theme: str) -> None:
        for _ in range(60):
            write_saved(path, Preferences(theme * 2000))
            found, said = load_saved(path, Preferences)
            if said or len(set(found.theme)) != 1:
                mixed.append(said or found.theme)

    writers = [Thread(target=write, args=(letter,)) for letter in "abc"]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert mixed == [] and len(list(own_state.iterdir())) == 1


# --- in the console ---------------------------------------------------------------------------------------------------


async def changed(it: Console) -> None:
    """Another pane in front, a filter, another theme."""
    it.screen.pane_layout.focus_pane("memory")
    it.screen.pane_layout.panes["acts"].set_filter("gre")
    it.app.theme = "rise-light"
    await it.pilot.pause()


@pytest.mark.slow
async def test_layout_filters_and_theme_come_back_and_with_fresh_nothing() -> None:
    async with console(ui_state=UiState(Preferences())) as it:
        it.screen.pane_layout.focus_pane("scheduler")
        await changed(it)
        await it.press("f4")  # zoomed, which is for the moment
        await it.until(lambda: kept_places().filters == {"acts": "gre"} and kept_places().layout["upper"] == "memory")
        await it.until(lambda: load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0].theme == "light")
    preferences = load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0]
    async with console(ui_state=UiState(preferences, fresh=True)) as it:
        panes = it.screen.pane_layout.panes
        assert panes["acts"].filter_text == "" and not panes["memory"].display
    async with console(ui_state=UiState(preferences), theme=preferences.theme) as it:
        panes = it.screen.pane_layout.panes
        assert panes["acts"].filter_text == "gre" and "Praise" not in it.text("acts")
        assert panes["memory"].display and not it.screen.pane_layout.is_zoomed
        assert short_name(it.app.theme) == "light"
    client = FakeClient(demo(), folder="/home/lab/rise-sessions/2026-11-21_160000_demo-study_debug")
    async with console(client=client, ui_state=UiState(Preferences())) as it:
        # The next participant's console has nothing of the one before but the theme and the pane below.
        panes = it.screen.pane_layout.panes
        assert panes["acts"].filter_text == "" and "Praise" in it.text("acts")
        assert panes["scheduler"].display and panes["rule"].display and not panes["memory"].display
        await it.until(lambda: it.text("rule").lstrip().startswith("Main"))  # `Again` comes before it in the alphabet
        assert it.pane("acts").row_view.has_focus


@pytest.mark.slow
async def test_those_who_only_watch_change_nothing_and_a_theme_of_the_command_line_is_for_once() -> None:
    async with console(ui_state=UiState(Preferences(), keeps_changes=False)) as it:
        await changed(it)
        await it.pilot.pause(1.3)
        assert not state_folder().exists()
    layout = {"upper": "nothing", "front": "", "focus": "gone"}
    path = state_folder() / f"{session_name(demo().folder)}.json"
    write_saved(path, SavedLayout(layout, {"nothing": "x", "log": "/("}))  # panes that are unknown change nothing
    async with console(ui_state=UiState(Preferences(theme="light")), theme="contrast") as it:
        assert it.screen.pane_layout.panes["rule"].display
        it.screen.pane_layout.focus_pane("memory")
        await it.until(lambda: kept_places().layout.get("upper") == "memory")
        assert not (state_folder() / PREFERENCES_NAME).exists()


async def test_two_consoles_keep_what_each_has_changed() -> None:
    write_saved(state_folder() / PREFERENCES_NAME, Preferences(theme="light"))
    keeper = UiState(Preferences())
    for path, kept in keeper.mark_tour_seen():
        write_saved(path, kept)
    assert load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0] == Preferences(theme="light", tour=True)


@pytest.mark.parametrize("name", [PREFERENCES_NAME, f"{session_name(demo().folder)}.json"])
async def test_a_broken_file_is_told_once_and_harms_nothing(name: str) -> None:
    state_folder().mkdir()
    (state_folder() / name).write_text("{")
    preferences, said = load_saved(state_folder() / PREFERENCES_NAME, Preferences)
    async with console(ui_state=UiState(preferences, remark=said)) as it:
        await it.until(lambda: f"{name} was not used" in it.notice)
        assert len(list(it.screen.pane_layout.visible_panes())) == 4


@pytest.mark.pty
def test_a_console_that_is_killed_has_kept_it() -> None:
    with terminal("--config", DEMO, "--seed", "1") as it:
        it.until("LIVE")
        kept = Path(it.home, "state", "rise-tui", f"{session_name(DEMO)}.json")
        it.press(b"/")
        it.until("keys start nothing")
        it.press(b"gre")
        end = monotonic() + PATIENCE
        while not (kept.exists() and "gre" in kept.read_text()):
            assert it.read(0.1) and monotonic() < end
        it.process.kill()
        it.process.wait()
        with terminal(home=it.home) as again:
            again.until("1 of 4")
