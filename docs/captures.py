"""Makes the pictures of the console for README and docs: `.venv/bin/python docs/captures.py`.

The real console over the real engine, at ten times the speed, in the middle of the LabLinking study.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path

from rise_engine.link.local import start_local
from rise_engine.scenario.model import Scenario
from rise_tui.app import ConsoleApp
from rise_tui.launch import Launcher, Refused, prepare
from rise_tui.settings import Settings

IMAGES = Path(__file__).parent / "images"
STUDY = str(Path(__file__).parent.parent / "scenarios" / "lablinking")


def app() -> ConsoleApp:
    settings = Settings(STUDY, seed=1)
    scenario = prepare(settings)
    assert not isinstance(scenario, Refused)

    def start(scenario: Scenario, settings: Settings) -> object:
        return start_local(scenario, seed=settings.seed, speed=10, who="anna")

    return ConsoleApp(scenario, settings, wizard="anna", launcher=Launcher(start=start))  # type: ignore[arg-type]


async def capture(name: str, size: tuple[int, int], *, stopped: bool = False) -> None:
    console = app()
    async with console.run_test(size=size) as pilot:

        async def until(holds: Callable[[], bool]) -> None:
            for _ in range(600):
                if holds():
                    return
                await pilot.pause(0.05)
            raise TimeoutError(name)

        def state() -> str | None:
            screen = console.console_screen
            assert screen is not None
            rule = screen.session.store.view.rules.get("Table setting")
            return rule.state if rule is not None else None

        await until(lambda: console.console_screen is not None)
        await pilot.pause(0.2)
        await pilot.press("t")
        for waiting in ("After the welcome", "After task 1, introduction", "After task 1, step 1"):
            await until(lambda waiting=waiting: state() == waiting)  # type: ignore[misc]
            await pilot.press("n")
        await until(lambda: state() == "Task 1, step 2")
        await pilot.press("p")
        if stopped:
            await pilot.press("f9")
        await pilot.pause(0.3)
        console.save_screenshot(f"{name}.svg", path=str(IMAGES))


async def main() -> None:
    await capture("console-120x40", (120, 40))
    await capture("console-80x24", (80, 24))
    await capture("stopped-120x40", (120, 40), stopped=True)


if __name__ == "__main__":
    asyncio.run(main())
