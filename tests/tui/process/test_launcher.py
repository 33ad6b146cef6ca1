"""`rise-tui` alone: what it finds, and what comes of a choice."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from rise_tui.cli import launcher
from rise_tui.cli.launcher import find_items
from rise_tui.config.preferences import MAX_FOLDERS, PREFERENCES_NAME, Preferences, load_saved, state_folder
from rise_tui.console.layout import UiState, save_all
from tests.tui.fake import DEMO
from tests.tui.process.test_choose_session import about
from tests.tui.terminals import kill_engines, terminal

CTRL_C = b"\x03"


@pytest.fixture(autouse=True)
def nothing_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An account without sessions and studies."""
    monkeypatch.setenv("RISE_SESSIONS", str(tmp_path / "sessions"))
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(launcher, "all_running_sessions", dict)
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")


def test_running_sessions_with_who_which_when_and_where(monkeypatch: pytest.MonkeyPatch) -> None:
    found = {
        "a": about(participant="P07", condition="calm", folder="/r/P07", clients=["wizard:anna", "observer:ben"]),
        "b": about(title="Greeting", mode="real", robot="floka", t=61.0, control=None, stopped=True, folder="/r/b"),
        "c": about(trouble="the disk is full", scenario_folder="/s"),
        "d": None,
    }
    monkeypatch.setattr(launcher, "all_running_sessions", lambda: found)
    listed = [(*each.cells, each.where, each.detail, each.role) for each in find_items({}, only_running=True)]
    assert listed == [
        ("LabLinking", "P07", "DEBUG pepper", "for 14 min", "/r/P07",
         "anna has control, 2 attached", "plain"),
        ("Greeting", "nobody named", "REAL floka", "for 1 min", "/r/b", "STOPPED · nobody has control", "wait"),
        ("LabLinking", "nobody named", "DEBUG pepper", "for 14 min", "/s",
         "NOT RECORDING, paused: the disk is full · anna has control", "fault"),
        ("d", "", "", "does not answer", "", "", "fault"),
    ]  # fmt: skip


def test_studies_used_before_the_latest_first_then_those_in_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(DEMO, tmp_path / "one")
    shutil.copytree(DEMO, tmp_path / "two")
    (tmp_path / "study").mkdir()
    (tmp_path / "study" / "study.toml").write_text('title = "Whole study"\n', "utf-8")
    (tmp_path / "none").mkdir()
    used = {str(tmp_path / "one"): "2026-11-29T09:00:00+01:00", str(tmp_path / "gone"): "2026-11-30T09:00:00+01:00"}
    used[str(tmp_path / "two")] = "2026-11-30T10:00:00+01:00"
    monkeypatch.chdir(tmp_path)
    found = [each for each in find_items(used) if each.state == "recent"]
    assert [(Path(each.target).name, each.title, each.who, each.when) for each in found] == [
        ("two", "Demo study", "scenario", "2026-11-30 10:00"),
        ("one", "Demo study", "scenario", "2026-11-29 09:00"),
        ("study", "Whole study", "study", ""),
    ]
    shipped = [each for each in find_items(used) if each.state == "shipped"]
    assert [each.where for each in shipped] == ["greeting", "lab_opening", "lablinking", "negation"]


def test_what_was_opened_is_kept_for_the_next_time(tmp_path: Path) -> None:
    state = UiState(Preferences())
    for number in range(MAX_FOLDERS + 1):
        save_all(state.save_folder(f"/s/{number}"))
    save_all(UiState(Preferences(), fresh=True).save_folder("/s/5"))
    save_all(UiState(Preferences(), keeps_changes=False).save_folder("/s/observed"))
    kept = load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0].folders
    assert [*kept] == [f"/s/{number}" for number in (5, 12, 11, 10, 9, 8, 7, 6, 4, 3, 2, 1)]


@pytest.mark.pty
def test_a_killed_session_goes_on_by_enter_and_a_study_opens_by_its_name() -> None:
    with terminal("--config", DEMO, "--participant", "P07", "--wizard", "anna") as it:
        it.until("LIVE")
        it.process.kill()
        it.process.wait()
        kill_engines(it.home)
        with terminal("--wizard", "anna", home=it.home, size=(80, 24)) as again:
            again.until("Did not end")
            again.until("P07")
            again.press(b"\r")
            again.until("enter goes on with it")
            again.press(b"\r")
            again.until("the session goes on")
            again.until("LIVE")
            again.press(CTRL_C)
            again.until("Detach (d)")
            again.press(b"d")
            assert again.ended() == 0
        kill_engines(it.home)
        with terminal("--wizard", "anna", home=it.home) as again:
            again.until("Studies")
            again.press(b"visitor")
            again.until_screen("Did not end", gone=True)
            again.press(b"\r")
            again.until("Greeting a visitor")
            again.until("LIVE")
            again.press(CTRL_C)
            again.until("Detach (d)")
            again.press(b"d")
            assert again.ended() == 0
        kill_engines(it.home)
        with terminal(home=it.home) as again:
            again.until("Studies")
            again.press(b"\x1b")
            assert again.ended() == 0
