"""Whatever happens to a console, the participant notices nothing, and who attaches again sees the true state."""

from __future__ import annotations

import asyncio
import os
import shlex
import shutil
import signal
import subprocess
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import pytest

from rise_engine.kernel.records import ActionRecord
from rise_engine.kernel.view import SessionView
from rise_engine.run.client import connect
from rise_engine.run.client.session import Session
from rise_engine.session.folder import JOURNAL
from rise_engine.session.journal_reader import read_journal
from tests.chance import SEARCH
from tests.patience import PATIENCE
from tests.tui.terminals import Terminal, environment_of, terminal

pytestmark = pytest.mark.pty

ROOT = Path(__file__).parents[2]
STUDY = str(ROOT / "scenarios" / "lablinking")

SCRIPT = [
    ("startInteractionRule", "Table setting", "R_Welcome", 1),
    ("startCommunicationRobotAct", "R_Filler_Hm", "R_Filler_Hm", 1),
    ("raiseEventTopic", "/next", "R_Task1_Intro", 1),
    ("raiseEventTopic", "/repeat", "R_Task1_Intro", 2),
    ("startCommunicationRobotAct", "R_Praise", "R_Praise", 1),
]
"""What a wizard does, and how often which act has then to have succeeded before the next step."""

Fault = Callable[[Terminal], Awaitable[None]]


async def nothing(it: Terminal) -> None:
    """The console stays."""


async def kill(it: Terminal) -> None:
    os.kill(it.process.pid, signal.SIGKILL)


async def hang_up(it: Terminal) -> None:
    os.kill(it.process.pid, signal.SIGHUP)


async def close_terminal(it: Terminal) -> None:
    os.close(it.master)
    it.master = -1


async def hold(it: Terminal) -> None:
    """For the whole script: an engine that waited for this console would never get to its end."""
    os.kill(it.process.pid, signal.SIGSTOP)


def whole(view: SessionView) -> Any:
    """Everything that a console knows of a session, without who is attached."""
    same = msgspec.structs.replace(view, seq=0, t=0.0, control=None, asked=None)
    return list(view.tasks), msgspec.to_builtins(same, str_keys=True, enc_hook=list)


async def play(fault: Fault) -> list[list[str]]:
    """The scripted study with a console that something happens to while the robot speaks; what the robot did."""
    with terminal("--config", STUDY, "--mode", "debug", "--seed", "1", "--wizard", "anna") as it:
        await asyncio.to_thread(it.until, "LIVE")
        socket = it.socket
        async with connect(socket, "script") as stayed:
            record = Path(stayed.attach_reply.folder)
            for function, behavior, act, runs in SCRIPT:
                await stayed.submit(function, behavior)
                if act == "R_Welcome":
                    await stayed.wait_until(lambda view: view.acts["R_Welcome"].running, PATIENCE)
                    await fault(it)
                await stayed.wait_until(partial(_has_run, act, runs), PATIENCE)
            if fault is hold:
                os.kill(it.process.pid, signal.SIGCONT)
            if fault in (kill, hang_up, close_terminal):
                assert await asyncio.to_thread(it.ended) is not None
            async with connect(socket, "late") as late:
                await stayed.wait_until(lambda view: view.seq >= late.view.seq, PATIENCE)
                await late.wait_until(lambda view: view.seq >= stayed.view.seq, PATIENCE)
                assert whole(late.view) == whole(stayed.view)
            if fault is hold:
                await press_until(it, b"p", stayed, _praised_twice)
            again = await asyncio.to_thread(_attach_again, it.home) if fault is not nothing else ""
            assert "LIVE" in again or "WATCHING" in again or fault is nothing
            await stayed.end("the script is over")
        return deeds(record)


async def press_until(it: Terminal, key: bytes, client: Session, condition: Callable[[SessionView], object]) -> None:
    """Press a key, and again if nothing happens: keys of a standstill of the console start nothing, and it says so."""
    async with asyncio.timeout(PATIENCE):
        while True:
            it.press(key)
            with suppress(TimeoutError):
                await client.wait_until(condition, 3.0)
                return


def _praised_twice(view: SessionView) -> bool:
    act = view.acts["R_Praise"]
    return act.runs + len(act.running) >= 2


def _has_run(act: str, runs: int, view: SessionView) -> bool:
    return view.acts[act].runs == runs


def _attach_again(home: str) -> str:
    with terminal("--observe", home=home) as again:
        again.until("WATCHING")
        return "WATCHING"


def deeds(record: Path) -> list[list[str]]:
    """What the robot began and ended, act by act: within one, what is done at the same time has no order."""
    found: dict[int, list[str]] = {}
    for each in read_journal(record / JOURNAL).read_records():
        if isinstance(each, ActionRecord) and each.status != "accepted":
            what = f"{each.act} {each.action} {each.type} {each.status} {msgspec.json.encode(each.parameters)!r}"
            found.setdefault(each.task, []).append(what)
    return [sorted(each) for each in found.values()][: len(SCRIPT)]


@pytest.mark.search
async def test_a_console_that_dies_or_hangs_changes_nothing_for_the_participant() -> None:
    """All at the same time, each with an engine of its own: SIGKILL and SIGSTOP; in a search also SIGHUP and a closed
    terminal."""
    faults = (kill, hold, *((hang_up, close_terminal) if SEARCH else ()))
    calm, *others = await asyncio.gather(*map(play, (nothing, *faults)))
    assert len(calm) == len(SCRIPT) and sum(map(len, calm)) > 20
    for fault, other in zip(faults, others, strict=True):
        assert other == calm, fault.__name__


async def test_a_console_that_could_not_read_shows_the_state_as_it_is_and_has_kept_control() -> None:
    """The engine waits for nobody: it leaves out what does not fit, and gives the state anew."""
    with terminal("--config", STUDY, "--mode", "debug", "--seed", "1", "--wizard", "anna") as it:
        await asyncio.to_thread(it.until, "LIVE")
        async with connect(it.socket, "noise") as noise:
            os.kill(it.process.pid, signal.SIGSTOP)
            for _ in range(1_600):
                await noise.add_note("x" * 900)
            await noise.add_note("the last one")
            os.kill(it.process.pid, signal.SIGCONT)
            await asyncio.to_thread(it.until, "the last one")
            await press_until(it, b"p", noise, lambda view: "R_Praise" in view.acts)
            taken = {record.source for record in noise.view.tasks.values()}
            assert taken == {"wizard:anna"}, "it has control as before"


@pytest.mark.skipif(shutil.which("tmux") is None, reason="needs tmux")
def test_a_console_that_comes_back_looks_like_one_that_never_left() -> None:
    with terminal("--config", STUDY, "--mode", "debug", "--seed", "1", "--wizard", "anna") as it:
        it.until("LIVE")
        environment = environment_of(it.home)
        tmux = ["tmux", "-L", f"rise-{os.getpid()}", "-f", "/dev/null"]

        def run(*arguments: str) -> str:
            return subprocess.run(
                [*tmux, *arguments], env=environment, capture_output=True, text=True, check=True, cwd=ROOT
            ).stdout

        def shown(window: str, text: str) -> list[str]:
            deadline = time.monotonic() + PATIENCE
            while text not in (screen := run("capture-pane", "-p", "-t", window)):
                assert time.monotonic() < deadline, screen
                time.sleep(0.05)
            return screen.splitlines()

        observe = f"exec {shlex.quote(_own('rise-tui'))} --observe"
        run("new-session", "-d", "-x", "120", "-y", "40", "-n", "stays", observe)
        try:
            shown("stays", "WATCHING")
            run("new-window", "-n", "goes", observe)
            shown("goes", "WATCHING")
            os.kill(int(run("display-message", "-p", "-t", "goes", "#{pane_pid}")), signal.SIGKILL)
            it.press(b"t")
            it.until("R_Welcome")
            it.press(b"w")
            shown("stays", "R_AskUnderstood")
            it.press(b"\x1b[20~")  # F9: from here on nothing moves any more
            shown("stays", "every part has confirmed")
            run("new-window", "-n", "back", observe)
            shown("back", "every part has confirmed")
            deadline = time.monotonic() + PATIENCE
            while (stays := shown("stays", "STOPPED")[1:]) != (back := shown("back", "STOPPED")[1:]):
                assert time.monotonic() < deadline, "\n".join([*stays, *back])  # one may still be painting
                time.sleep(0.05)
        finally:
            run("kill-server")


def _own(program: str) -> str:
    import sys

    return str(Path(sys.executable).with_name(program))
