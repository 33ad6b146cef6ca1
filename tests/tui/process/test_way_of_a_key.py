"""A key goes the way that docs/explanation/architecture.md draws: down to the robot, and back to the screen."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from rise_engine.base.files import Disk
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.scenario.model import Scenario
from rise_tui.config.launch import Launcher, load_scenario
from rise_tui.console.app import ConsoleApp
from tests.run.server.serving import OwnSession
from tests.shape import calls
from tests.sources import ROOT, parsed
from tests.tui.conftest import Console
from tests.tui.fake import DEMO, FakeClient, FakeLauncher, demo

MAP = ROOT / "docs/explanation/architecture.md"
NOT_HERE = re.compile(
    r"adapters/rise_adapters/ros2/|rise_engine/ports/|rise_engine/run/server/process\.py|"
    r"rise_tui/rendering/(terminal_(reader|driver|writer)|diff|cell_buffer)"
)
"""What a session in this process, with a simulated robot and without a terminal, does not come by."""
STEP = re.compile(r"^\d+\. .*", re.MULTILINE)
PLACE = re.compile(r"`([\w/]+\.py): ([\w.]+(?:, [\w.]+)*)`")


def is_function(file: str, name: str) -> bool:
    owner, _, member = name.rpartition(".")
    body = parsed(ROOT / file).body
    if owner:
        body = next(node.body for node in body if isinstance(node, ast.ClassDef) and node.name == owner)
    return any(
        isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.name == (member or name) for node in body
    )


def functions_on_the_map(heading: str) -> set[tuple[str, str]]:
    section = re.split(r"^##+ ", MAP.read_text(encoding="utf-8"), flags=re.MULTILINE)
    rows = STEP.findall(next(text for text in section if text.startswith(heading)))
    named = {(file, name) for row in rows for file, names in PLACE.findall(row) for name in names.split(", ")}
    return {(file, name) for file, name in named if not NOT_HERE.match(file) and is_function(file, name)}


@pytest.mark.slow
async def test_a_key_comes_by_everything_that_the_map_names(tmp_path: Path) -> None:
    settings = SessionOptions(DEMO, seed=1)
    scenario = load_scenario(settings)
    assert isinstance(scenario, Scenario)
    launcher = Launcher(
        start=lambda scenario, settings: OwnSession(tmp_path, Path(settings.folder), speed=20, disk=Disk())
    )
    app = ConsoleApp(launcher.start(scenario, settings), settings=settings, wizard="anna", launcher=launcher)
    with calls() as called:
        async with app.run_test(size=(200, 50)) as pilot:
            it = Console(pilot, FakeClient(demo()), FakeLauncher())
            await it.until(lambda: app.console_screen is not None and "Greet" in it.text("acts"))
            await it.press("g")
            await it.until(lambda: "✓ done" in it.row("acts", "Greet"))
            await it.screen.session.close(end_session=True)
    down, back = functions_on_the_map("Down"), functions_on_the_map("Back")
    assert len(down) > 25 and len(back) > 20
    assert sorted((down | back) - called) == []
