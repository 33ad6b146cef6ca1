"""Makes the pictures of the console for README and docs: `.venv/bin/python docs/captures.py`.

The real console over the real engine, at ten times the speed, in the middle of the LabLinking study.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

from rise_engine.client.socket import SocketClient
from rise_engine.protocol.client import EngineGone
from rise_engine.protocol.session_options import SessionOptions
from rise_engine.scenario.model import Scenario
from rise_engine.server.spawn import EngineRefused, start_engine
from rise_tui.config.launch import Launcher, load_scenario
from rise_tui.console.app import ConsoleApp

IMAGES = Path(__file__).parent / "images"
SPEED = 10
STUDY = str(Path(__file__).parent.parent / "scenarios" / "lablinking")


def app(theme: str, faults: tuple[str, ...]) -> ConsoleApp:
    settings = SessionOptions(STUDY, seed=1, participant="P07", condition="hesitation")
    scenario = load_scenario(settings)
    assert isinstance(scenario, Scenario)

    def start(scenario: Scenario, settings: SessionOptions) -> SocketClient:
        who = {"participant": settings.participant, "condition": settings.condition}
        found = start_engine(
            SessionOptions(STUDY, seed=settings.seed, speed=SPEED, faults=faults, unfinished="new", **who)
        )
        if isinstance(found, EngineRefused):
            raise EngineGone("; ".join(found.lines))
        return SocketClient(found.name, "anna", "wizard", scenario=scenario)

    client = start(scenario, settings)
    return ConsoleApp(client, settings=settings, wizard="anna", theme=theme, launcher=Launcher(start=start))


async def capture(
    name: str, size: tuple[int, int], *keys: str, theme: str = "dark", faults: tuple[str, ...] = (), wait: str = ""
) -> None:
    """The console in the middle of the first task, after these keys, once the alarm says `wait`."""
    console = app(theme, faults)
    async with console.run_test(size=size) as pilot:

        async def until(holds: Callable[[], object]) -> None:
            for _ in range(600):
                if holds():
                    return
                await pilot.pause(0.05)
            raise TimeoutError(name)

        def state() -> str | None:
            assert console.console_screen is not None
            rule = console.console_screen.session.store.view.rules.get("Table setting")
            return rule.state if rule is not None else None

        await until(lambda: console.console_screen is not None)
        await pilot.pause(0.2)
        await pilot.press("t")
        for waiting in ("After the welcome", "After task 1, introduction", "After task 1, step 1"):
            await until(lambda waiting=waiting: state() == waiting)  # type: ignore[misc]
            await pilot.press("space")
            await pilot.pause(0.12)
            await pilot.press("n")
        await until(lambda: state() == "Task 1, step 2")
        await pilot.press("p")
        for key in keys:
            await pilot.press(key)
            await pilot.pause(0.1)
        await until(lambda: wait in console.console_screen.bars.alarm_bar.text if console.console_screen else False)
        await pilot.pause(0.3)
        console.save_screenshot(f"{name}.svg", path=str(IMAGES))
        assert console.console_screen is not None
        await console.console_screen.session.close(end_session=True)


async def main() -> None:
    await capture("console-120x40", (120, 40))
    await capture("console-80x24", (80, 24))
    await capture("console-200x50", (200, 50))
    await capture("console-light-120x40", (120, 40), theme="light")
    await capture("stopped-120x40", (120, 40), "f9", wait="confirmed")
    await capture("robot-lost-120x40", (120, 40), faults=("vanish@72",), wait="ROBOT LOST")
    await capture("saying-120x40", (120, 40), "ctrl+t", *"Well", "space", *"done,", "space", *"{person")
    await capture("help-120x40", (120, 40), "question_mark")


if __name__ == "__main__":
    with TemporaryDirectory() as place:
        os.environ |= {"RISE_SESSIONS": f"{place}/sessions", "RISE_RUNTIME": f"{place}/run"}
        asyncio.run(main())
