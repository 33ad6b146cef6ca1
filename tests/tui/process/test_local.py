"""The console with the real engine, in one process."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.scenario.model import Scenario
from rise_tui.config.launch import Launcher, ScenarioProblems, load_scenario
from rise_tui.console.app import ConsoleApp
from tests.run.server.conftest import scratch
from tests.run.server.serving import OwnSession
from tests.tui.conftest import Console
from tests.tui.fake import DEMO, FakeClient, FakeLauncher, demo

pytestmark = pytest.mark.slow

__all__ = ["scratch"]


def started(settings: SessionOptions, root: Path) -> ConsoleApp:
    def start(scenario: Scenario, settings: SessionOptions) -> OwnSession:
        return OwnSession(root, Path(settings.folder), speed=20)

    scenario = load_scenario(settings)
    assert not isinstance(scenario, ScenarioProblems)
    return ConsoleApp(start(scenario, settings), settings=settings, wizard="anna", launcher=Launcher(start=start))


async def test_a_session_from_the_first_key_to_the_last(scratch: Path) -> None:
    app = started(SessionOptions(DEMO, seed=1), scratch)
    async with app.run_test(size=(200, 50)) as pilot:
        it = Console(pilot, FakeClient(demo()), FakeLauncher())
        await it.until(lambda: app.console_screen is not None and "Greet" in it.text("acts"))
        await it.press("m")
        await it.until(lambda: "waiting" in it.row("rules", "Main"), "the main rule did not come to wait")
        assert "✓ done" in it.row("acts", "Greet")
        await it.press("n")
        await it.until(lambda: (greet := it.screen.session.store.act("Greet")).runs == 2 or greet.running)
        it.screen.pane_layout.focus_pane("memory")
        await it.press("home", "enter", "backspace", "7", "enter")
        await it.until(lambda: it.row("memory", "task").split()[1] == "7")
        await it.press("f9")
        await it.until(lambda: "STOPPED" in it.bars.alarm_bar.text, "the stop was not confirmed")
        await it.press("g")
        assert "not started" in it.notice
        await it.press("ctrl+r", "r")
        await it.until(lambda: "LIVE" in it.bars.status_line.text)
        await it.press("m")
        await it.until(lambda: "running" in it.row("rules", "Main"))
        await pilot.pause(0.6)  # its debounce time
        await it.press("m")
        await it.until(lambda: "rejected" in it.notice, "starting a running rule was not refused in words")
        await it.press("ctrl+c", "ctrl+x", "e", "n", "d", "enter")
        await it.until(lambda: not app.is_running)
    assert app.return_code == 0
