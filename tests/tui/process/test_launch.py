"""Starting sessions in processes of their own, as the settings screen does; and consoles on sessions that run."""

from __future__ import annotations

import pytest

from rise_engine.base.exit_status import ALREADY_RUNNING
from rise_engine.run.client.socket import SocketClient
from rise_engine.run.protocol.client import EngineGone
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.server import spawn
from rise_tui.cli import open_console as launching
from rise_tui.cli.open_console import process_launcher
from rise_tui.config.launch import settings_of_session
from rise_tui.config.settings import engine_options, scenario_path
from rise_tui.console.app import ConsoleApp
from rise_tui.console.screen import ConsoleScreen
from tests.tui.conftest import Console
from tests.tui.fake import DEMO, FakeClient, FakeLauncher, demo


def test_a_folder_and_its_scenario_file_are_one_session() -> None:
    assert scenario_path(SessionOptions("/a/b")) == scenario_path(SessionOptions("/a/b/scenario.toml")) == "/a/b"
    assert scenario_path(SessionOptions("/a/b/other.toml")) == "/a/b/other.toml"


def test_the_engine_is_told_what_the_settings_say() -> None:
    asked = engine_options(SessionOptions("/a", "nao", "real", paths={"acts": "mine"}), 7, "new")
    assert (asked.folder, asked.robot, asked.mode, asked.seed, asked.unfinished) == ("/a", "nao", "real", 7, "new")
    assert asked.paths == {"acts": "mine"}


class Engine:
    """Answers in the place of `start_engine`."""

    def __init__(self, *answers: spawn.StartOutcome) -> None:
        self.answers = list(answers)
        self.asked: list[SessionOptions] = []

    def __call__(self, options: SessionOptions) -> spawn.StartOutcome:
        self.asked.append(options)
        return self.answers.pop(0)


BUSY = spawn.EngineRefused(ALREADY_RUNNING, ["a session of this scenario is running already: demo-000000"])


def test_the_next_session_waits_until_the_last_one_has_let_go(monkeypatch: pytest.MonkeyPatch) -> None:
    engine = Engine(BUSY, BUSY, spawn.EngineStarted("demo-000000", "/s"))
    monkeypatch.setattr(launching, "start_engine", engine)
    client = process_launcher("anna", "wizard").start(demo(), SessionOptions(DEMO, seed=3))
    assert isinstance(client, SocketClient)
    assert len(engine.asked) == 3 and engine.asked[0].seed == 3 and engine.asked[0].unfinished == "ask"


def test_a_session_that_goes_on_running_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(launching, "ENGINE_EXIT_SECONDS", 0.0)
    monkeypatch.setattr(launching, "start_engine", Engine(BUSY, BUSY))
    with pytest.raises(EngineGone, match="is running already"):
        process_launcher("anna", "wizard").start(demo(), SessionOptions(DEMO))


def test_an_unfinished_session_of_another_scenario_is_not_given_up_in_passing(monkeypatch: pytest.MonkeyPatch) -> None:
    refused = spawn.EngineRefused(4, ["an earlier session did not end"], [("/s", "Demo")])
    monkeypatch.setattr(launching, "start_engine", Engine(refused))
    with pytest.raises(EngineGone, match="to recover it or begin a new one: rise-tui --config"):
        process_launcher("anna", "wizard").start(demo(), SessionOptions(DEMO))


def test_a_console_that_attaches_knows_what_its_session_was_started_with() -> None:
    found = settings_of_session(FakeClient(demo(), mode="real").attach_reply())
    assert (found.folder, found.robot, found.mode, found.seed) == (demo().folder, "pepper", "real", 1)


async def test_what_there_is_to_say_about_a_recovery_is_said_first() -> None:
    client = FakeClient(demo())
    app = ConsoleApp(client, wizard="anna", launcher=FakeLauncher(client), notice="1 action counts as lost")
    async with app.run_test(size=(120, 40)) as pilot:
        it = Console(pilot, client, FakeLauncher())
        await it.until(lambda: app.console_screen is not None and "counts as lost" in it.notice)
        assert isinstance(app.screen, ConsoleScreen)


async def test_a_session_that_cannot_be_reached_is_told_after_leaving() -> None:
    client = FakeClient(demo())
    client.gone = "no session lablinking is running"
    app = ConsoleApp(client, launcher=FakeLauncher(client))
    async with app.run_test() as pilot:
        await pilot.pause(0.3)
    assert app.return_code == 1
    assert app.exit_message == "the session could not be reached: no session lablinking is running"
