"""A console on a study, for tests of a day with participants."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

from textual.pilot import Pilot
from textual.screen import Screen

from rise_tui.console.app import ConsoleApp
from rise_tui.console.input import CHANGE_SECONDS
from rise_tui.console.screen import ConsoleScreen
from rise_tui.console.study_screen import StudyScreen
from rise_tui.screens.checks import ChecksScreen
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.reading import ReportScreen
from rise_tui.screens.session_forms import OutcomeDialog
from tests.patience import PATIENCE
from tests.tui.fake import FakeClient, FakeLauncher, demo
from tests.tui.fake_study import FakeStudy
from tests.virtual_time import real_monotonic


class Day:
    """A console on a study under test."""

    def __init__(self, pilot: Pilot[Any], source: FakeStudy) -> None:
        self.pilot, self.source = pilot, source

    @property
    def app(self) -> ConsoleApp:
        app = self.pilot.app
        assert isinstance(app, ConsoleApp)
        return app

    @property
    def screen(self) -> StudyScreen:
        found = self.app.study_screen
        assert found is not None
        return found

    @property
    def top(self) -> Screen[Any]:
        return self.app.screen

    @property
    def notice(self) -> str:
        return self.screen.notice.text

    @property
    def client(self) -> FakeClient:
        return self.source.clients[-1]

    async def press(self, *keys: str) -> None:
        """Like a person who reads: longer between two keys than a held key takes to repeat."""
        for key in keys:
            if key == "enter":  # after a look at what has opened
                await self.pilot.pause(CHANGE_SECONDS)
            await self.pilot.press(key)
            await self.pilot.pause(0.8)

    async def type(self, text: str) -> None:
        for letter in text:
            await self.pilot.press("space" if letter == " " else letter)
            await self.pilot.pause(0.05)

    async def until(self, holds: Any, what: str = "") -> None:
        end = real_monotonic() + PATIENCE
        while not holds():
            assert real_monotonic() < end, what or "did not happen in time"
            await self.pilot.pause(0.02)

    async def shows(self, kind: type[Screen[Any]]) -> Any:
        await self.until(lambda: isinstance(self.top, kind) and self.top.is_mounted, f"no {kind.__name__}: {self.top}")
        await self.pilot.pause(0.1)
        return self.top

    async def select(self, participant: str) -> None:
        self.screen.lists.people.select(participant)
        await self.pilot.pause(0.05)

    async def checks(self) -> ChecksScreen:
        """From the participant under the cursor to the checks, which have come to something."""
        await self.press("enter")
        found = await self.shows(ChecksScreen)
        assert isinstance(found, ChecksScreen) and found.is_intro
        await self.press("enter")
        await self.until(lambda: all(item.outcome is not None for item in found.checks.items))
        return found

    async def begin(self) -> None:
        """A session of the participant under the cursor, with everything in order."""
        await self.checks()
        await self.press("y", "y", "enter")
        await self.shows(ConsoleScreen)
        await self.until(lambda: "Greet" in self.app.console_screen.pane_layout.panes["acts"].row_view.text)  # type: ignore[union-attr]

    async def leave_report(self) -> None:
        """What happened in the session that has just ended is shown; Esc goes on."""
        await self.shows(ReportScreen)
        await self.press("escape")
        await self.until(lambda: self.top is self.screen, "the screen of the study did not come back")

    async def gone_back(self) -> None:
        """Nothing is left over the list of participants."""
        await self.until(lambda: self.top is self.screen, "the screen of the study did not come back")
        await self.pilot.pause(0.1)

    async def over(self) -> None:
        """The session that runs ends by itself, and the wizard goes back to the study."""
        console = await self.shows(ConsoleScreen)
        self.client.end_in_order("ended by SIGTERM")
        await self.until(lambda: console.store.ended_in_order)
        await self.press("ctrl+c")
        await self.gone_back()

    async def says_end(self) -> None:
        await self.type("end")
        await self.press("enter")

    async def answer_debrief(self) -> OutcomeDialog:
        screen = await self.shows(ChecksScreen)
        await self.until(lambda: "debrief: answer with y or n" in self.text_of(screen))
        await self.press("y", "enter")
        found = await self.shows(OutcomeDialog)
        assert isinstance(found, OutcomeDialog)
        return found

    async def ask_to_end(self) -> None:
        await self.press("ctrl+c")
        await self.shows(Dialog)
        await self.press("ctrl+x")

    def text_of(self, screen: ChecksScreen) -> str:
        return f"{screen.list.text}\n{screen.answer_line.text}"


@asynccontextmanager
async def day(
    source: FakeStudy | None = None, size: tuple[int, int] = (80, 24), wizard: str = "anna", **options: Any
) -> AsyncIterator[Day]:
    source = source or FakeStudy()
    launcher = FakeLauncher(FakeClient(demo()))
    app = ConsoleApp(None, launcher=launcher, study=source, wizard=wizard, login="root", **options)
    async with app.run_test(size=size) as pilot:
        found = Day(pilot, source)
        await found.until(lambda: app.study_screen is not None and app.study_screen.is_read)
        await pilot.pause(0.1)
        yield found
