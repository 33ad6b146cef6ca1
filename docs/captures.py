"""Makes the pictures of the console for README and docs: `.venv/bin/python docs/captures.py`.

It uses the real console and engine, at ten times the speed, in the middle of the LabLinking study; the screen of a
study made by the real commands, with real sessions; and the editor on a copy of LabLinking.
"""

from __future__ import annotations

import asyncio
import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory

from rise_engine.author.edit.workspace import Workspace
from rise_engine.kernel.inputs import CheckReport
from rise_engine.kernel.records import OutcomeStatus, RecordingStatus
from rise_engine.ports.bridge import RosConnection
from rise_engine.run.client import connect
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import EngineGone
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server.spawn import EngineRefused, start_engine
from rise_engine.scenario.model import Scenario
from rise_engine.study.study_toml import load_study
from rise_tui.cli.study_folder import open_study
from rise_tui.config.launch import Launcher, load_scenario
from rise_tui.console.app import ConsoleApp
from rise_tui.editor.model.draft import draft_of
from rise_tui.editor.model.study_rows import row_id
from rise_tui.editor.rule_page import RulePage
from rise_tui.editor.screen import EditApp
from rise_tui.editor.study import EditedStudy, RunningHere


class NoSessions:
    """Finds no session beside the editor."""

    def find(self, folder: Path) -> RunningHere | None:
        return None

    def stop(self, session: RunningHere) -> str:
        return ""


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
    name: str,
    size: tuple[int, int],
    *keys: str,
    theme: str = "dark",
    faults: tuple[str, ...] = (),
    wait: str = "",
    recorders: Mapping[str, RecordingStatus] | None = None,
) -> None:
    """The console in the middle of the first task, after these keys and with these recorders, when the alarm is
    `wait`."""
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
        for recorder, status in (recorders or {}).items():
            async with connect("lablinking", name="recorders") as session:
                reason = "it has not grown for 3 s" if status == "stalled" else ""
                await session.report_recording(recorder, status, reason=reason)
        await until(lambda: wait in console.console_screen.bars.alarm_bar.text if console.console_screen else False)
        await pilot.pause(0.3)
        console.save_screenshot(f"{name}.svg", path=str(IMAGES))
        assert console.console_screen is not None
        await console.console_screen.session.close(end_session=True)


def command(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "rise_engine", *arguments], check=True, stdout=subprocess.DEVNULL)


def make_study(folder: str) -> None:
    """LabLinking with two factors and ten participants, one of whom has not consented."""
    levels = [
        f"--level={level}"
        for level in (
            "hesitation.yes=hesitation = true",
            "hesitation.no=hesitation = false",
            "noise.quiet=distraction = false",
            "noise.loud=distraction = true",
        )
    ]
    options = ["--title=Hesitation and noise", "--id=hesitation", "--scenario=lablinking", "--n=8", "--seed=7"]
    options += ["--robot=generic", "--auto=disk", "--ask=The lamp behind the robot is on", "--ask-after=-", "--yes"]
    command("study", "new", folder, *options, "--factor=hesitation=between", "--factor=noise=within", *levels)
    with Path(folder, "participants.csv").open("a", encoding="utf-8") as file:
        for number in range(1, 11):
            file.write(f"P{number:02},{'2026-11-20' if number != 6 else ''},,\n")
    command("study", "plan", folder)


async def run_session(folder: str, participant: str, outcome: OutcomeStatus = "complete", reason: str = "") -> None:
    """The shortest session of the study."""
    known = load_study(folder).study
    assert known is not None
    checks = tuple(CheckReport(id=check.id, result="passed") for check in known.checks if check.when == "before")
    started = start_engine(SessionOptions("", study=folder, participant=participant, wizard="anna", checks=checks))
    assert not isinstance(started, EngineRefused), started.lines
    async with connect(started.name, "anna") as session:
        await session.report_outcome(outcome, reason)
        await session.end("for a picture")


async def capture_study(place: str) -> None:
    """The screen of a study after some sessions, and the questions before the next one."""
    folder = str(Path(place, "hesitation"))
    await asyncio.to_thread(make_study, folder)
    for participant in ("P01", "P01", "P02", "P02", "P03"):
        await run_session(folder, participant)
    await run_session(folder, "P04", "aborted", "felt unwell")

    async def not_here(*_: object) -> SocketClient:
        raise EngineGone("no session is begun for a picture")

    for name, size in (("study-80x24", (80, 24)), ("study-120x40", (120, 40))):
        study = open_study(folder, RosConnection("off"))
        console = ConsoleApp(None, launcher=Launcher(start=not_here), study=study, wizard="anna")  # type: ignore[arg-type]
        async with console.run_test(size=size) as pilot:
            while console.study_screen is None or not console.study_screen.is_read:
                await pilot.pause(0.05)
            await pilot.pause(0.5)
            console.save_screenshot(f"{name}.svg", path=str(IMAGES))


async def capture_editor(place: str) -> None:
    """The editor on a copy of LabLinking: the list, an act, a rule, and its trial."""
    folder = Path(shutil.copytree(STUDY, Path(place, "my-study")))

    async def show(name: str, size: tuple[int, int], opened: tuple[str, str], state: str = "", *keys: str) -> None:
        workspace = Workspace(folder)
        editor = EditApp(EditedStudy(workspace, draft_of(workspace)), sessions=NoSessions())
        async with editor.run_test(size=size) as pilot:
            screen = editor.edit_screen
            while screen.home.rows.cursor < 0:
                await pilot.pause(0.05)
            screen.home.rows.select(row_id(*opened))
            screen.draw()
            if keys:
                await pilot.press("enter")
                while screen.opened is None or not screen.opened.is_mounted:
                    await pilot.pause(0.05)
                await pilot.pause(0.3)
            if isinstance(screen.opened, RulePage):
                screen.opened.editor.go_to_state(state)
            for key in keys[1:]:
                await pilot.press(key)
                await pilot.pause(0.2)
            await pilot.pause(0.3)
            editor.save_screenshot(f"{name}.svg", path=str(IMAGES))

    step = "After task 1, step 1"
    await show("edit-list-80x24", (80, 24), ("act", "R_Apology"))
    await show("edit-act-80x24", (80, 24), ("act", "R_Apology"), "", "enter", *["down"] * 4, "tab", "down", "enter")
    await show("edit-rule-80x24", (80, 24), ("rule", "Table setting"), step, "enter", "a")
    await show("edit-trial-120x40", (120, 40), ("rule", "Table setting"), step, "enter", "t", "n", "enter")


async def main() -> None:
    await capture("console-120x40", (120, 40))
    await capture("console-80x24", (80, 24))
    await capture("console-200x50", (200, 50))
    await capture("console-light-120x40", (120, 40), theme="light")
    await capture("stopped-120x40", (120, 40), "f9", wait="confirmed")
    await capture("robot-lost-120x40", (120, 40), faults=("vanish@72",), wait="ROBOT LOST")
    await capture("saying-120x40", (120, 40), "ctrl+t", *"Well", "space", *"done,", "space", *"{person")
    await capture("stalled-80x24", (80, 24), recorders={"camera": "running", "mic": "stalled"})
    await capture("help-120x40", (120, 40), "question_mark")


if __name__ == "__main__":
    with TemporaryDirectory() as place:
        os.environ |= {"RISE_SESSIONS": f"{place}/sessions", "RISE_RUNTIME": f"{place}/run"}
        os.environ["XDG_STATE_HOME"] = f"{place}/state"
        asyncio.run(capture_editor(place))
        asyncio.run(main())
        asyncio.run(capture_study(place))
