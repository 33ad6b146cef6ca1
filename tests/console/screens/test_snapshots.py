"""What it looks like. Time stands still, the session is played, the cursor does not blink."""

from __future__ import annotations

from typing import Any

import pytest
from textual.pilot import Pilot

from rise_engine.kernel.records import RobotRecord
from rise_tui.app import ConsoleApp
from rise_tui.start.settings import Settings
from tests.console.fake import DEMO, FakeClient, FakeLauncher, demo


def played(**options: Any) -> FakeClient:
    """A session in the middle of something."""
    client = FakeClient(demo(), **options)
    client.time = 70.0
    client.act("Praise", "SUCCEEDED")
    client.task(
        "startCommunicationRobotAct", "Goodbye", "REJECTED", reason="the robot has no voice", source="ros:trial"
    )
    client.task("startInteractionRule", "Main")
    client.rule("Main", "started", "greeting", trigger="start")
    client.time = 80.0
    client.rule("Main", "entered", "waiting", previous="greeting", trigger="/Greet_end", transition=0)
    task = client.act("Greet", source="rule:Main")
    client.action(task, "Greet", "2", "Animation", "succeeded", value="head_nod", duration=400)
    client.action(task, "Greet", "1", "Speech", "accepted", message="Hello Ada!")
    client.time = 81.5
    client.act("Filler", "PENDING")
    client.time = 83.0
    return client


def app(theme: str = "dark", client: FakeClient | None = None) -> ConsoleApp:
    client = client or played()
    settings = Settings(DEMO.rpartition("/tests/")[2])
    return ConsoleApp(client.scenario, settings, wizard="anna", theme=theme, launcher=FakeLauncher(client))


async def settle(pilot: Pilot[Any], *keys: str) -> None:
    await pilot.pause(0.3)
    for key in keys:
        await pilot.press(key)
        await pilot.pause(0.1)
    await pilot.pause(0.3)


SIZES = {"small": (80, 24), "usual": (120, 40), "wide": (200, 50)}


@pytest.mark.parametrize("theme", ["dark", "light", "mono"])
@pytest.mark.parametrize("size", SIZES)
def test_the_console(snap_compare: Any, size: str, theme: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot)

    assert snap_compare(app(theme), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("theme", ["contrast", "colorblind", "terminal"])
def test_themes(snap_compare: Any, theme: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "f3", "f3")

    assert snap_compare(app(theme), terminal_size=(120, 40), run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_stopped(snap_compare: Any, size: str) -> None:
    client = played()
    client.stop("latched", ("pepper/speech", "pepper/gaze"), ("pepper/base",))

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "ctrl+r")

    assert snap_compare(app(client=client), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_editing_the_memory(snap_compare: Any, size: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "f3", "f3", "f3", "home", "enter", "backspace", "4", "full_stop", "5")

    assert snap_compare(app(), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_help(snap_compare: Any, size: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "question_mark")

    assert snap_compare(app(), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_the_palette(snap_compare: Any, size: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "colon", *"filler")

    assert snap_compare(app(), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_jumping(snap_compare: Any, size: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "ctrl+d")

    assert snap_compare(app(), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_saying_something(snap_compare: Any, size: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "ctrl+t", *"Well", "space", *"done")

    assert snap_compare(app(), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_a_mistake(snap_compare: Any, size: str) -> None:
    client = played()
    client.answers = False

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "exclamation_mark")

    assert snap_compare(app(client=client), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_safe(snap_compare: Any, size: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "f3", "f3", "f3", "f3", "ctrl+x")

    assert snap_compare(app(), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_everything_about_a_task(snap_compare: Any, size: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "ctrl+d", "l", "enter")

    assert snap_compare(app(), terminal_size=SIZES[size], run_before=before)


# --- several consoles, leaving, trouble ------------------------------------------------------------------------------


@pytest.mark.parametrize("size", ["small", "usual"])
def test_watching(snap_compare: Any, size: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "g")

    assert snap_compare(app(client=played(you="wizard:ben")), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_asked_for_control(snap_compare: Any, size: str) -> None:
    client = played()
    client.control_record("asked", "wizard:ben", "wizard:anna")

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "f8")

    assert snap_compare(app(client=client), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_control_taken(snap_compare: Any, size: str) -> None:
    client = played()

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot)
        client.control_record("taken", "wizard:ben", "wizard:ben")
        await settle(pilot)

    assert snap_compare(app(client=client), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_the_robot_is_lost(snap_compare: Any, size: str) -> None:
    client = played()
    client.emit(RobotRecord(0, 0.0, "", "lost", "no answer from pepper/speech"), at=80.0)

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot)

    assert snap_compare(app(client=client), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_not_recording(snap_compare: Any, size: str) -> None:
    client = played()
    client.journal(trouble="no space is left on the disk (/home/lab/rise-sessions)")

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "g")

    assert snap_compare(app(client=client), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_stopped_and_not_recording(snap_compare: Any, size: str) -> None:
    client = played()
    client.stop("latched", ("pepper/speech", "pepper/gaze"), ("pepper/base",))
    client.journal(trouble="no space is left on the disk (/home/lab/rise-sessions)")

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot)

    assert snap_compare(app(client=client), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_leaving(snap_compare: Any, size: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "ctrl+c")

    assert snap_compare(app(), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_a_replay(snap_compare: Any, size: str) -> None:
    client = played(you="observer:replay", role="observer", replay=True)

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot)

    assert snap_compare(app(client=client), terminal_size=SIZES[size], run_before=before)


@pytest.mark.parametrize("size", ["small", "usual"])
def test_a_note(snap_compare: Any, size: str) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "ctrl+o", *"child", "space", *"laughed")

    assert snap_compare(app(), terminal_size=SIZES[size], run_before=before)
