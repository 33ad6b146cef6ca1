"""The console with the real engine, in one process."""

from __future__ import annotations

from pathlib import Path
from time import monotonic

import pytest

from rise_engine.protocol.client import Client, EngineGone
from rise_engine.protocol.session_options import SessionOptions
from rise_engine.scenario.model import Scenario
from rise_tui.config.launch import Launcher, ScenarioProblems, load_scenario
from rise_tui.console.app import ConsoleApp
from tests.console.conftest import Console
from tests.console.fake import DEMO, FakeClient, FakeLauncher, demo
from tests.server.conftest import scratch
from tests.server.serving import OwnSession

pytestmark = pytest.mark.slow

__all__ = ["scratch"]


def started(settings: SessionOptions, root: Path) -> ConsoleApp:
    scenario = load_scenario(settings)
    assert not isinstance(scenario, ScenarioProblems)
    fast = Launcher(start=lambda scenario, settings: OwnSession(root, Path(settings.folder), speed=20))
    return ConsoleApp(scenario, settings, wizard="anna", launcher=fast)


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


async def test_a_robot_that_cannot_be_started_is_told_after_leaving() -> None:
    def fail(scenario: Scenario, settings: SessionOptions) -> Client:
        raise EngineGone("the robot cannot be made")

    settings = SessionOptions(DEMO)
    scenario = load_scenario(settings)
    bad = Launcher(start=fail)
    app = ConsoleApp(scenario, settings, launcher=bad)  # type: ignore[arg-type]
    async with app.run_test() as pilot:
        end = monotonic() + 20
        while app.is_running:
            assert monotonic() < end, "it stays, without an engine"
            await pilot.pause(0.02)
    assert app.return_code == 1 and "could not start" in app.exit_message
