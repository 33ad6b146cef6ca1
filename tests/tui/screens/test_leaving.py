"""Leaving: detach or end, who may end, and the one line that stays in the terminal."""

from __future__ import annotations

import asyncio
import shutil
import signal
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from threading import Event
from typing import Any

import pytest
from msgspec.structs import replace
from textual.widgets import Button, Static

from rise_engine.base.exit_status import NOT_WRITTEN, STILL_RUNNING
from rise_engine.kernel.records import OpenGoal, RecordingRecord, RecordingStatus, RobotRecord, SessionRecord
from rise_engine.run.protocol.client import AttachReply, EngineGone, UnrecordedStop
from rise_engine.scenario.keys import KeyRefusedError, bindable_key_name
from rise_engine.session.folder import JOURNAL
from rise_tui.config.launch import RecoveredClient
from rise_tui.config.preferences import typed_command
from rise_tui.console.questions import END_KEY, END_PATIENCE, end_patience, engine_gone_dialog, exit_message
from rise_tui.console.screen import ConsoleScreen
from rise_tui.console.session import ConsoleSession
from rise_tui.model.status import running_lines, session_title
from rise_tui.model.store import Store
from rise_tui.screens.dialog import Dialog
from rise_tui.screens.session_forms import EndSessionDialog
from tests.patience import PATIENCE
from tests.tui.conftest import Console, console
from tests.tui.fake import FakeClient, FakeLauncher, demo

pytestmark = pytest.mark.slow  # many keys each

RISE_TUI = typed_command()


async def leaving(it: Console) -> list[str]:
    """What the question offers."""
    await it.press("ctrl+c")
    dialog = await it.shows(Dialog)
    await it.until(lambda: dialog.query("#buttons"))
    return [str(button.label) for button in dialog.query(Button)]


async def asked_to_end(it: Console) -> str:
    """What the question before the end says."""
    await leaving(it)
    await it.press("ctrl+x")
    question = await it.shows(EndSessionDialog)
    await it.until(lambda: question.query("#word"))
    return "\n".join([str(question.query_one("#box").border_title), *question._lines])


async def has_left(it: Console, said: str, code: int = 0) -> None:
    await it.until(lambda: not it.app.is_running)
    assert it.app.exit_message == said and it.app.return_code == code


async def test_leaving_asks_once_and_no_key_of_any_study_ends_a_session() -> None:
    with pytest.raises(KeyRefusedError):
        bindable_key_name(END_KEY)
    async with console() as it:
        assert await leaving(it) == ["Stay (esc)", "Detach (d)", "End the session (ctrl+x)"]
        assert it.app.focused is not None and it.app.focused.id == "answer-d"
        await it.press("ctrl+c")
        assert len(it.app.screen_stack) == 3, "a second ctrl+c asks nothing more"
        await it.press("escape")
        await it.back()
        assert it.client.closed == []
        await leaving(it)
        for key in (*"abcefghijklmnopqrstuvwxyz0123456789", "full_stop", "space", "f5"):
            await it.pilot.press(key)
        await it.pilot.pause(0.1)
        assert it.client.closed == [] and isinstance(it.app.screen, Dialog)
        await it.press("ctrl+x")
        question = await it.shows(EndSessionDialog)
        for word in ("e", "enter", "n", "x", "enter"):
            await it.press(word)
        assert it.client.closed == [] and it.app.screen is question
        assert "that is not the word" in str(question.query_one("#answer", Static).content)
        await it.press("escape")
        await it.back()
        await asked_to_end(it)
        it.client.control_record("taken", "wizard:ben", "wizard:ben")  # while the question is open
        await it.until(lambda: not it.screen.session.store.has_control)
        await it.press("e", "n", "d", "enter")
        await it.back()
        assert it.client.closed == [] and "the session goes on: ben has control" in it.notice


async def test_ending_names_who_and_all_that_runs_and_stop_works_while_the_word_is_typed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("HOME", "/home/lab")
    client = FakeClient(demo())
    client.emit(SessionRecord(0, 0.0, "", status="started", participant="P07", condition="hesitation"))
    client.rule("Main", "entered", "waiting")
    client.act("Greet")
    client.act("Praise", "PENDING", position=0)
    async with console(client=client, size=(80, 24)) as it:
        await it.press("f7")  # who has locked the keys can still end the session
        said = await asked_to_end(it)
        for piece in ("End the session of P07 · hesitation?", "P07 · hesitation · Demo study", "cannot be continued"):
            assert piece in said
        for piece in ("rule Main: in waiting", "act Greet", "act Praise, waiting"):
            assert piece in said
        assert max(map(len, said.splitlines())) <= 66
        for size in ((120, 40), (80, 24)):
            await it.pilot.resize_terminal(*size)
            box = it.app.screen.query_one("#box").region
            assert box.height <= size[1] and it.app.screen.query_one("#word").region.y < box.bottom - 1
        await it.press("e", "n", "f9")
        await it.sent("stopAll", "")
        assert isinstance(it.app.screen, EndSessionDialog) and client.closed == []
        await it.press("d", "enter")
        await it.until(lambda: client.closed == [True])
        folder = "~/rise-sessions/2026-11-21_141503_demo-study_debug"
        await has_left(
            it, f"ended: the record is in {folder}\nwhat happened: {typed_command('rise-engine')} report {folder}"
        )


async def test_an_end_that_is_not_confirmed_in_time_is_no_success(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rise_tui.console.questions.END_PATIENCE", 0.2)
    client = FakeClient(demo())

    async def close(*, end_session: bool = False, reason: str = "") -> None:
        await asyncio.Event().wait()

    monkeypatch.setattr(client, "close", close)
    async with console(client=client) as it:
        await asked_to_end(it)
        await it.press(*"end", "enter")
        await it.until(lambda: not it.app.is_running)
        assert "did not end within 0.2 s: look at the robot" in it.app.exit_message
        assert it.app.return_code == STILL_RUNNING


def test_of_much_that_runs_it_is_said_how_much_more() -> None:
    client = FakeClient(demo())
    assert running_lines(a_store(client)) == ["No rule and no act is running."]
    for _ in range(9):
        client.act("Filler")
    assert running_lines(a_store(client)) == ["Running now:", *["  act Filler"] * 5, "  and 4 more"]
    assert session_title(a_store(client)) == "no participant named · Demo study"


LEFT = OpenGoal("pepper/speech", "3/1", "Speech", "it refused to stop")


async def test_what_the_robot_may_still_be_doing_is_said_before_and_after_the_end() -> None:
    client = FakeClient(demo())
    client.emit(RobotRecord(0, 0.0, "", status="degraded", detail="pepper/speech", open=(LEFT,)))
    sentence = "pepper/speech may still be doing Speech (it refused to stop)"
    assert running_lines(a_store(client)) == ["No rule and no act is running.", f"{sentence}."]
    async with console(client=client) as it:
        await asked_to_end(it)
        client.emit(SessionRecord(0, 0.0, "", status="ended", reason="over", open=(LEFT,)))
        await it.until(lambda: it.screen.session.store.view.left_open == (LEFT,))
        await it.press("e", "n", "d", "enter")
        await it.until(lambda: client.closed == [True])
        await it.until(lambda: it.app.exit_message != "")
        assert it.app.exit_message.startswith(f"LOOK AT THE ROBOT: {sentence}\n")
        assert it.app.return_code == STILL_RUNNING


@pytest.mark.parametrize(
    ("way", "said", "code"),
    [
        ("enter", "", 0),
        (signal.SIGTERM, "SIGTERM: ", 143),
    ],
)
async def test_detaching_leaves_the_session_alone_and_so_does_a_signal(
    way: str | signal.Signals, said: str, code: int
) -> None:
    async with console() as it:
        if isinstance(way, signal.Signals):
            it.app._leave_by_signal(way)
        else:
            await leaving(it)
            await it.press(way)
        await it.until(lambda: it.client.closed == [False])
        await has_left(it, f"{said}detached: Demo study goes on; come back with: {RISE_TUI}", code)


async def test_a_console_that_has_left_does_not_wait_for_the_end_of_a_record_that_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The wait is in a thread, and a process cannot exit before its threads."""
    (tmp_path / JOURNAL).touch()
    looked: list[Path] = []
    monkeypatch.setattr("rise_tui.console.session._has_recorded_end", looked.append)
    session = await ConsoleSession.attach(FakeClient(demo(), folder=str(tmp_path)), "anna")
    receiving = asyncio.create_task(session.receive_records())
    await session.close(end_session=False)
    await receiving
    assert looked == []


@pytest.mark.parametrize("role", ["wizard", "observer"])
async def test_who_has_no_control_can_only_leave(role: str) -> None:
    client = FakeClient(demo(), you=f"{role}:ben", role=role)  # type: ignore[arg-type]
    async with console(client=client) as it:
        assert await leaving(it) == ["Stay (esc)", "Detach (d)"]
        await it.press("ctrl+x")
        await it.pilot.pause(0.1)
        assert client.closed == [] and isinstance(it.app.screen, Dialog)
        await it.press("d")
        await it.until(lambda: client.closed == [False])


async def test_a_session_whose_engine_has_gone_goes_on_in_the_same_console() -> None:
    client, again = FakeClient(demo()), FakeClient(demo())
    asked: list[str] = []
    ways = iter([EngineGone("the disk is full"), RecoveredClient(again, "3 actions were lost")])

    going = Event()
    going.set()

    def recover(attach_reply: AttachReply, tell: Callable[[str], object]) -> RecoveredClient:
        asked.append(attach_reply.folder)
        tell("recovering: 412,000 of 1,040,000 records")
        going.wait(PATIENCE)
        way = next(ways)
        if isinstance(way, EngineGone):
            raise way
        return way

    async with console(client=client, launcher=FakeLauncher(client, recover=recover)) as it:
        gone = it.screen
        client.end("its process no longer exists")
        await it.until(lambda: "ENGINE GONE" in it.bars.alarm_bar.text)
        assert "recovers the session, or leaves" in it.bars.alarm_bar.text
        assert await leaving(it) == ["Stay (esc)", "Recover (r)", "Leave (l)"]
        assert "F9" not in it.bars.key_hints.text, "no key reaches the robot"
        await it.press("r")
        await it.until(lambda: "could not recover it: the disk is full" in it.notice)
        assert it.screen is gone
        await leaving(it)
        going.clear()
        await it.press("r")
        await it.until(lambda: "412,000 of 1,040,000 records" in it.notice)
        await it.press("question_mark")  # a screen above it, while the engine starts
        await it.until(lambda: it.app.screen is not gone)
        going.set()
        await it.until(lambda: it.screen is not gone and not it.bars.alarm_bar.text)
        await it.until(lambda: "3 actions were lost" in it.notice)
        assert asked == [client.attach_reply().folder] * 2 and client.closed == [False]
        assert sum(isinstance(screen, ConsoleScreen) for screen in it.app.screen_stack) == 1
        it.client = again
        await it.press("ctrl+g")
        await it.until(lambda: again.asked() == [("stopAll", "")])


def test_nothing_is_promised_about_a_robot_whose_profile_may_let_it_go_on() -> None:
    said = " ".join(" ".join(engine_gone_dialog(a_store(FakeClient(demo())))._lines).split())
    assert 'nothing until somebody takes control, unless its profile has unattended = "go on".' in said


async def test_who_does_not_recover_leaves() -> None:
    client = FakeClient(demo(), you="observer:ben", role="observer")
    launcher = FakeLauncher(client, recover=lambda attach_reply, tell: RecoveredClient(client))
    async with console(client=client, launcher=launcher) as it:
        client.end("its process no longer exists")
        await it.until(lambda: "ENGINE GONE" in it.bars.alarm_bar.text)
        assert "watches again once it is recovered, or leaves" in it.bars.alarm_bar.text
        assert await leaving(it) == ["Stay (esc)", "Watch (r)", "Leave (l)"]
        await it.press("l")
        await it.until(lambda: not it.app.is_running)


@pytest.mark.parametrize("in_order", [True, False])
async def test_leaving_what_is_over_asks_nothing(in_order: bool) -> None:
    async with console() as it:
        if in_order:
            it.client.end_in_order("ended by wizard:ben")
        else:
            it.client.end("its process no longer exists")
        await it.until(lambda: ("SESSION ENDED" if in_order else "ENGINE GONE") in it.bars.alarm_bar.text)
        await it.press("ctrl+c")
        await it.until(lambda: not it.app.is_running)
        assert it.app.exit_message == exit_message(it.screen.store, end=False, in_time=True, patience=END_PATIENCE)


@pytest.mark.parametrize("ends", [True, False])
async def test_a_session_whose_end_could_not_be_recorded_is_not_said_to_have_ended_well(
    tmp_path: Path, ends: bool
) -> None:
    """By who ended it, and by who watched."""
    (tmp_path / JOURNAL).write_bytes(b'{"n":1,"input":"session_started"}\n')
    async with console() as it:
        it.screen.store.attach_reply = replace(it.screen.store.attach_reply, folder=str(tmp_path))
        it.client.journal(trouble="the disk is full", stop=UnrecordedStop("engine", True, unstoppable=("mila/say",)))
        if ends:
            await asked_to_end(it)
            await it.press(*"end", "enter")
        else:
            it.client._queue.put_nowait(None)  # the end of the records, without its record
            await it.until(lambda: "ENDED, NOT RECORDED" in it.bars.alarm_bar.text)
            assert "look at the robot" in it.bars.alarm_bar.text and "CANNOT BE STOPPED" in it.bars.alarm_bar.text
            await it.press("ctrl+c")
        await it.until(lambda: not it.app.is_running)
        assert it.app.return_code == (NOT_WRITTEN if ends else 0)
        said, where = it.app.exit_message.splitlines()
        assert said.startswith("LOOK AT THE ROBOT: the session has ended, and the end of its record could not be")
        assert said.endswith("CANNOT BE STOPPED: mila/say; confirmed by nobody") and str(tmp_path) in where


def a_store(client: FakeClient) -> Store:
    return Store(client.attach_reply(), "anna", client.now)


@pytest.mark.parametrize(("statuses", "seconds"), [((), 13), (("running",), 32), (("running", "stopped"), 13)])
def test_recorders_have_the_time_to_complete_their_files(statuses: Sequence[RecordingStatus], seconds: int) -> None:
    client = FakeClient(demo())
    for status in statuses:
        client.emit(RecordingRecord(0, 0.0, "", "camera", status, "", None, "", "engine"))
    assert end_patience(a_store(client)) == seconds


@pytest.mark.parametrize(
    ("gone", "in_order", "leaves", "said"),
    [
        ("", False, {}, f"detached: Demo study goes on; come back with: {RISE_TUI}"),
        ("", False, {"signal_name": "SIGHUP"}, f"SIGHUP: detached: Demo study goes on; come back with: {RISE_TUI}"),
        ("", False, {"end": True}, "ended: the record is in "),
        ("", False, {"end": True, "in_time": False}, "Demo study did not end within 13 s: look at the robot; "),
        ("it was killed", False, {}, f"the engine has gone; to recover the session: {RISE_TUI} --config "),
        ("ended by wizard:ben", True, {}, "ended: the record is in "),
    ],
)
def test_the_terminal_says_what_became_of_the_session(
    gone: str, in_order: bool, leaves: dict[str, Any], said: str
) -> None:
    store = a_store(FakeClient(demo()))
    store.gone_reason, store.ended_in_order = gone, in_order
    how: dict[str, Any] = {"end": False, "in_time": True, "patience": END_PATIENCE} | leaves
    assert exit_message(store, **how).startswith(said)


@pytest.mark.parametrize(
    ("found", "in_environment", "typed"),
    [
        ("/home/ann/rise/.venv/bin/rise-tui", True, "~/rise/.venv/bin/rise-tui"),
        (None, True, "~/rise/.venv/bin/rise-tui"),
        ("/home/ann/.local/bin/rise-tui", True, "rise-tui"),
        ("/usr/bin/rise-tui", False, "rise-tui"),
    ],
)
def test_what_the_last_line_says_works_in_a_terminal_without_the_environment(
    found: str | None, in_environment: bool, typed: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "prefix", "/home/ann/rise/.venv" if in_environment else sys.base_prefix)
    monkeypatch.setattr(shutil, "which", lambda name: found)
    monkeypatch.setattr(Path, "exists", lambda self: True)
    monkeypatch.setattr(Path, "home", lambda: Path("/home/ann"))
    assert typed_command() == typed
