"""The launcher: what runs, what did not end and what can be opened; Enter opens what the row says."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest
from textual.pilot import Pilot

from rise_tui.screens.dialog import TitledBox
from rise_tui.screens.launcher import READ_AGAIN_SECONDS, LauncherApp, LauncherScreen, LaunchItem

RUNNING = LaunchItem(
    "running", "lablinking-2fd404", "LabLinking: setting the table", "P07 · no hesitation", "REAL pepper",
    "for 14 min", "~/rise-sessions/2026-11-30_140200_P07", "anna has control",
)  # fmt: skip
STUCK = LaunchItem("running", "stuck-000000", "stuck-000000", when="does not answer", role="fault")
UNFINISHED = LaunchItem(
    "unfinished", "/s/demo", "Demo", "P06", "DEBUG pepper", "2026-11-30 14:02", "/s/demo", "Nothing is repeated",
    session="/r/demo", role="wait",
)  # fmt: skip
STUDY = LaunchItem("recent", "/s/table", "Setting the table", "study", when="2026-11-29 09:00", where="/s/table")
SHIPPED = LaunchItem("shipped", "/p/greeting", "Greeting a visitor", "scenario", where="greeting")


class Opened:
    """An open launcher."""

    def __init__(self, app: LauncherApp, pilot: Pilot[object]) -> None:
        self.app, self.pilot = app, pilot

    @property
    def screen(self) -> LauncherScreen:
        return self.app.launcher

    @property
    def rows(self) -> list[str]:
        return self.screen.list.text.splitlines()

    @property
    def keys(self) -> str:
        return str(self.screen.query_one(TitledBox).border_subtitle).strip()

    async def press(self, *keys: str) -> None:
        await self.pilot.press(*keys)
        await self.pilot.pause(0.1)


@asynccontextmanager
async def launcher(
    *items: LaunchItem,
    find: Callable[[], list[LaunchItem]] | None = None,
    stop: Callable[[str], str] = lambda session: "",
    size: tuple[int, int] = (80, 24),
) -> AsyncIterator[Opened]:
    app = LauncherApp(find or (lambda: [*items]), stop)
    async with app.run_test(size=size) as pilot:
        await pilot.pause(0.1)
        yield Opened(app, pilot)


async def test_a_row_says_which_who_when_and_where() -> None:
    async with launcher(RUNNING, STUCK, UNFINISHED, STUDY, SHIPPED) as it:
        assert [" ".join(row.split()) for row in it.rows] == [
            "Running",
            "LabLinking: setting… P07 · no hesitation REAL pepper for 14 min",
            "stuck-000000 does not answer",
            "",
            "Did not end",
            "Demo P06 DEBUG pepper 2026-11-30 14:02",
            "",
            "Studies",
            "Setting the table study 2026-11-29 09:00 /s/table",
            "",
            "Examples that come with the program",
            "Greeting a visitor scenario greeting",
        ]
        assert it.keys == "enter attaches to it · ↑↓ choose · F9 stops what runs · esc leaves"
        assert "anna has control · ~/rise-sessions/2026-11-30_140200_P07" in it.screen.detail
    async with launcher(RUNNING, STUDY, size=(120, 40)) as it:
        assert it.rows[1].endswith("~/rise-sessions/2026-11-30_140200_P07") and it.rows[4].endswith("/s/table")


async def test_some_letters_of_any_column_find_a_row_and_enter_opens_it() -> None:
    async with launcher(RUNNING, UNFINISHED, STUDY, SHIPPED) as it:
        await it.press(*"visit")
        assert len(it.rows) == 2 and "Greeting a visitor" in it.rows[1] and it.keys.startswith("enter opens it")
        await it.press("enter")
    assert it.app.return_value == SHIPPED
    async with launcher(UNFINISHED, STUDY) as it:
        await it.press("s")
        assert it.rows[0] == " Did not end" and it.screen.current == STUDY, "who types looks for something to open"
    async with launcher(RUNNING, STUDY) as it:
        await it.press(*"zzz")
        assert it.rows == [" nothing found"]
        await it.press("enter", "escape")
    assert it.app.return_value is None


async def test_a_session_that_did_not_end_is_never_chosen_by_itself() -> None:
    items: list[LaunchItem] = []
    async with launcher(find=lambda: [*items]) as it:
        items.append(UNFINISHED)
        await it.pilot.pause(READ_AGAIN_SECONDS + 0.1)
        assert it.rows[0] == " Did not end" and it.screen.current is None
        await it.press("down")
        items.insert(0, RUNNING)
        await it.pilot.pause(READ_AGAIN_SECONDS + 0.1)
        assert it.screen.current == UNFINISHED, "the person has chosen it"
        await it.press("up")
        del items[0]
        await it.pilot.pause(READ_AGAIN_SECONDS + 0.1)
        assert it.screen.current is None


async def test_enter_does_not_open_the_row_that_takes_the_place_of_another() -> None:
    items = [RUNNING, STUDY]
    async with launcher(find=lambda: [*items]) as it:
        del items[0]
        await it.pilot.pause(READ_AGAIN_SECONDS - 0.05)
        assert it.screen.current == STUDY
        await it.press("enter")
        assert it.screen.current == STUDY and it.app.is_running
        await it.pilot.pause(1)
        await it.press("enter")
    assert it.app.return_value == STUDY


async def test_the_first_enter_only_chooses_a_session_that_did_not_end() -> None:
    async with launcher(UNFINISHED, SHIPPED) as it:
        assert it.screen.current is None and not it.keys.startswith("enter")
        await it.press("enter")
        assert it.screen.current == UNFINISHED and it.keys.startswith("enter goes on with it")
        assert "Nothing is repeated" in it.screen.detail
        await it.press("enter")
    assert it.app.return_value == UNFINISHED


@pytest.mark.parametrize("key", ["escape", "ctrl+c"])
async def test_one_may_leave_without_choosing(key: str) -> None:
    async with launcher(RUNNING, STUDY) as it:
        await it.press(key)
    assert it.app.return_value is None


async def test_sessions_that_begin_elsewhere_appear_and_the_cursor_stays_on_its_row() -> None:
    items = [STUDY, SHIPPED]
    async with launcher(find=lambda: [*items]) as it:
        await it.press("down")
        items.insert(0, RUNNING)
        await it.pilot.pause(READ_AGAIN_SECONDS + 0.1)
        assert it.rows[0] == " Running" and it.screen.current == SHIPPED
        del items[:]
        await it.pilot.pause(READ_AGAIN_SECONDS + 0.1)
        assert it.rows == [" nothing found"] and it.screen.current is None


@pytest.mark.parametrize("key", ["f9", "ctrl+g"])
async def test_f9_stops_every_running_session_and_says_what_it_reached(key: str) -> None:
    stopped: list[str] = []
    async with launcher(RUNNING, STUCK, STUDY, stop=lambda session: stopped.append(session) or "") as it:
        await it.press(key)
        assert sorted(stopped) == ["lablinking-2fd404", "stuck-000000"]
        assert it.screen.detail.startswith("STOPPED: every running session was told to stop everything.")
        await it.press("down")
        assert "STOPPED" not in it.screen.detail
    async with launcher(RUNNING, STUCK, stop=lambda session: "no answer" * session.startswith("stuck")) as it:
        await it.press(key)
        await it.pilot.pause(READ_AGAIN_SECONDS * 2)
        assert it.screen.detail == "THE STOP DID NOT REACH A SESSION, use its console: stuck-000000: no answer"
    async with launcher(STUDY) as it:
        await it.press(key)
        assert it.screen.detail == "No session is running here: there is nothing to stop."


async def test_nothing_of_a_title_reaches_the_terminal_as_it_is() -> None:
    evil = LaunchItem("running", "evil", "\x1b[2Jevil", "\x9b31m", detail="\x1b[2J", where="\x07")
    async with launcher(evil, STUDY, size=(120, 40)) as it:
        shown = "\n".join("".join(each.text for each in strip) for strip in it.app.screen._compositor.render_strips())
        assert "evil" in shown and not any(each in shown for each in "\x1b\x9b\x07")
