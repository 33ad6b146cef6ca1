"""What it looks like: what no sentence says, namely where things stand and in which colours.

Few, because each has to be looked at when anything changes; what is said on a screen, other tests assert in words. Time
stands still, the session is played, the cursor does not blink.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from textual.pilot import Pilot

from rise_engine.kernel.records import RecordingRecord, RobotRecord, SyncRecord
from rise_engine.run.client.shadow import ShadowClient
from rise_engine.run.protocol.session_options import SessionOptions
from rise_tui.console.app import ConsoleApp
from tests.results.analysis.cues import make_session
from tests.tui.fake import DEMO, FakeClient, FakeLauncher, demo
from tests.tui.fake_study import FakeStudy


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
    settings = SessionOptions(DEMO.rpartition("/tests/")[2])
    return ConsoleApp(client, settings=settings, wizard="anna", theme=theme, launcher=FakeLauncher(client))


async def settle(pilot: Pilot[Any], *keys: str) -> None:
    await pilot.pause(0.3)
    for key in keys:
        await pilot.press(key)
        await pilot.pause(0.1)
    await pilot.pause(0.3)


SIZES = {"small": (80, 24), "usual": (120, 40), "wide": (200, 50)}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("size", "theme"),
    [("small", "dark"), ("usual", "dark"), ("wide", "dark"), ("usual", "light"), ("usual", "mono")],
)
def test_the_console(snap_compare: Any, size: str, theme: str) -> None:
    assert snap_compare(app(theme), terminal_size=SIZES[size], run_before=settle)


@pytest.mark.slow
def test_a_shadow(snap_compare: Any, tmp_path: Path) -> None:
    """At its beginning, so that the time stands still."""
    folder = make_session(tmp_path)
    fake = FakeClient(demo())
    console = ConsoleApp(ShadowClient(folder, "ben", at=10.2), wizard="ben", launcher=FakeLauncher(fake))
    assert snap_compare(console, terminal_size=SIZES["small"], run_before=settle)


def test_stopped(snap_compare: Any) -> None:
    """With the question whether to release it."""
    client = played()
    client.stop("latched", ("pepper/speech", "pepper/gaze"), ("pepper/base",))

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "ctrl+r")

    assert snap_compare(app(client=client), terminal_size=SIZES["usual"], run_before=before)


def test_the_robot_is_lost(snap_compare: Any) -> None:
    client = played()
    client.emit(RobotRecord(0, 0.0, "", "lost", "no answer from pepper/speech"), at=80.0)
    assert snap_compare(app(client=client), terminal_size=SIZES["small"], run_before=settle)


def test_a_camera_does_not_record(snap_compare: Any) -> None:
    client = played()
    reason = "its file has not grown for 3 s"
    client.emit(RecordingRecord(0, 0.0, "", "camera", "stalled", "", None, reason, "node:recorders"), at=80.0)
    assert snap_compare(app(client=client), terminal_size=SIZES["small"], run_before=settle)


def test_a_mark_for_cameras(snap_compare: Any) -> None:
    client = played()

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot)
        client.emit(SyncRecord(0, 0.0, "", 12, "flash", "", "node:recorders"))
        await pilot.pause(0.2)

    assert snap_compare(app(client=client), terminal_size=SIZES["small"], run_before=before)


def test_control_taken(snap_compare: Any) -> None:
    client = played()

    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot)
        client.control_record("taken", "wizard:ben", "wizard:ben")
        await settle(pilot)

    assert snap_compare(app(client=client), terminal_size=SIZES["small"], run_before=before)


def test_editing_the_memory(snap_compare: Any) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "f3", "f3", "f3", "home", "enter", "backspace", "4", "full_stop", "5")

    assert snap_compare(app(), terminal_size=SIZES["usual"], run_before=before)


def test_help(snap_compare: Any) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "question_mark")

    assert snap_compare(app(), terminal_size=SIZES["usual"], run_before=before)


def test_the_palette(snap_compare: Any) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "colon", *"filler")

    assert snap_compare(app(), terminal_size=SIZES["small"], run_before=before)


def test_saying_something(snap_compare: Any) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "ctrl+t", *"Well", "space", *"done")

    assert snap_compare(app(), terminal_size=SIZES["small"], run_before=before)


def study_app(theme: str = "dark") -> ConsoleApp:
    """A study in the middle of it, with a check that has failed."""
    source = FakeStudy()
    source.results = {"tracker": "no answer from the eye tracker at 10.0.0.7"}
    launcher = FakeLauncher(FakeClient(demo()))
    return ConsoleApp(None, study=source, wizard="anna", theme=theme, launcher=launcher)


@pytest.mark.parametrize(("size", "theme"), [("small", "dark"), ("usual", "light")])
def test_a_study(snap_compare: Any, size: str, theme: str) -> None:
    assert snap_compare(study_app(theme), terminal_size=SIZES[size], run_before=settle)


def test_the_checks_before_a_session(snap_compare: Any) -> None:
    async def before(pilot: Pilot[Any]) -> None:
        await settle(pilot, "enter")
        await pilot.pause(0.8)
        await settle(pilot, "enter", "y")

    assert snap_compare(study_app(), terminal_size=SIZES["small"], run_before=before)
