from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from typing import Any, TypeVar

import pytest
from textual.pilot import Pilot
from textual.screen import Screen
from textual.widgets import Input

from rise_engine.run.protocol.session_options import SessionOptions
from rise_tui.console.app import ConsoleApp
from rise_tui.console.bars import ConsoleBars
from rise_tui.console.input import CHANGE_SECONDS
from rise_tui.console.screen import ConsoleScreen
from rise_tui.panes.pane import Pane
from rise_tui.widgets.lines import RowList
from tests.patience import PATIENCE
from tests.tui import pilots
from tests.tui.fake import DEMO, FakeClient, FakeLauncher, demo
from tests.virtual_time import VirtualLoop, real_monotonic

pilots.install()
Shown = TypeVar("Shown", bound=Screen[Any])
VIRTUAL_TIME = {"editor", "model", "panes", "screens"}
"""Folders whose tests have to do with nothing that has a clock of its own: no terminal, no thread, no process."""


def pytest_asyncio_loop_factories(item: pytest.Item) -> Mapping[str, Callable[[], asyncio.AbstractEventLoop]]:
    return {"virtual": VirtualLoop} if item.path.parent.name in VIRTUAL_TIME else {"machine": asyncio.new_event_loop}


@pytest.fixture(autouse=True)
def snapshots_in_virtual_time(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A snapshot is taken of an app that is started with a loop of its own."""
    if "snap_compare" in request.fixturenames and request.path.parent.name in VIRTUAL_TIME:
        monkeypatch.setattr(asyncio.events, "new_event_loop", VirtualLoop)


@pytest.fixture(autouse=True)
def steady_cursor(monkeypatch: pytest.MonkeyPatch) -> None:
    """A blinking cursor makes snapshots differ."""
    original = Input.__init__

    def init(self: Input, *args: Any, **options: Any) -> None:
        original(self, *args, **options)
        self.cursor_blink = False

    monkeypatch.setattr(Input, "__init__", init)


@pytest.fixture(autouse=True)
def a_busy_machine_ignores_no_keys(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """A console that stands still ignores the keys of that time. On the machine's clock, any test could meet that."""
    if request.path.parent.name not in VIRTUAL_TIME:
        monkeypatch.setattr("rise_tui.console.input.STALL_SECONDS", float("inf"))


class NoConsole(AssertionError):
    """The app is between two sessions: no console is shown."""


class Console:
    """A console under test: its pilot, its engine, and what is on the screen."""

    def __init__(self, pilot: Pilot[Any], client: FakeClient, launcher: FakeLauncher) -> None:
        self.pilot, self.client, self.launcher = pilot, client, launcher

    @property
    def app(self) -> ConsoleApp:
        app = self.pilot.app
        assert isinstance(app, ConsoleApp)
        return app

    @property
    def screen(self) -> ConsoleScreen:
        if (screen := self.app.console_screen) is None:
            raise NoConsole
        return screen

    @property
    def bars(self) -> ConsoleBars:
        return self.screen.bars

    def pane(self, name: str) -> Pane:
        return self.screen.pane_layout.panes[name]

    def text(self, name: str) -> str:
        pane = self.pane(name)
        graph = getattr(pane, "graph", None)
        return "\n".join(each.text for each in (pane.row_view, graph) if isinstance(each, RowList))

    def row(self, pane: str, name: str) -> str:
        """The first row with this text, or empty."""
        return next((line for line in self.text(pane).splitlines() if name in line), "")

    @property
    def notice(self) -> str:
        return self.bars.notice_line.text

    async def focus(self, pane: str) -> None:
        """Bring a list or a pane to the front; its rows are there then."""
        self.screen.pane_layout.focus_pane(pane)
        await self.pilot.pause()

    async def press(self, *keys: str) -> None:
        """Like a person: a moment between two keys, and Enter only after a look at what has opened."""
        for key in keys:
            if key == "enter":
                await self.pilot.pause(CHANGE_SECONDS)
            await self.pilot.press(key)
            await self.pilot.pause(0.06)

    async def until(self, holds: Callable[[], object], what: str = "") -> None:
        """What is asked of a console does not hold as long as there is none."""

        def held() -> bool:
            try:
                return bool(holds())
            except NoConsole:
                return False

        end = real_monotonic() + PATIENCE
        while not held():
            assert real_monotonic() < end, what or "did not happen in time"
            await self.pilot.pause(0.02)

    async def shows(self, kind: type[Shown]) -> Shown:
        """The screen of this kind that opens over the console."""
        await self.until(
            lambda: isinstance(self.app.screen, kind) and self.app.screen.is_mounted, f"no {kind.__name__}"
        )
        await self.pilot.pause()
        assert isinstance(self.app.screen, kind)
        return self.app.screen

    async def back(self) -> None:
        """Wait until nothing is left over the console."""
        await self.until(lambda: self.app.screen is self.screen, "the console did not come back")

    async def sent(self, function: str, behavior: str) -> None:
        await self.until(lambda: (function, behavior) in self.client.asked(), f"{function} {behavior} was not sent")


@asynccontextmanager
async def console(
    size: tuple[int, int] = (120, 40), client: FakeClient | None = None, **options: Any
) -> AsyncIterator[Console]:
    client = client or FakeClient(demo())
    launcher = options.pop("launcher", None) or FakeLauncher(client)
    ready = options.pop("ready", "Greet")
    """The name of an act of the scenario: the console shows it when it is there."""
    session = launcher.start(client.scenario, SessionOptions(DEMO))
    app = ConsoleApp(session, settings=SessionOptions(DEMO), wizard="anna", launcher=launcher, **options)
    async with app.run_test(size=size) as pilot:
        await pilot.pause()
        found = Console(pilot, client, launcher)
        await found.until(lambda: ready in found.text("acts"))
        yield found
