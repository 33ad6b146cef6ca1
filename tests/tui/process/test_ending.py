"""A console whose terminal is gone or takes nothing ends all the same, and never holds anything up."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from rise_tui.rendering.terminal_driver import TerminalWriter
from tests.chance import searched
from tests.patience import PATIENCE
from tests.tui.terminals import ROOT, Terminal, run_rise_tui, terminal

pytestmark = pytest.mark.pty

GREETING = str(ROOT / "scenarios" / "greeting")


def busy(it: Terminal) -> None:
    """The rule runs and the gaze follows for ever: the screen repaints all the time."""
    it.until("LIVE")
    it.press(b"b")
    it.until("► running")
    it.press(b"a")
    it.until("R_FollowGaze")


def test_a_terminal_that_closes_while_the_screen_is_busy_ends_the_console() -> None:
    with terminal("--config", GREETING, "--seed", "1") as it:
        busy(it)
        os.close(it.master)
        it.master = -1
        assert it.process.wait(PATIENCE) == 128 + signal.SIGHUP


@pytest.mark.parametrize("number", [signal.SIGTERM, pytest.param(signal.SIGHUP, marks=searched)])
def test_a_signal_ends_a_busy_console_whose_terminal_takes_nothing(number: signal.Signals) -> None:
    with terminal("--config", GREETING, "--seed", "1") as it:
        busy(it)
        with pytest.raises(subprocess.TimeoutExpired):  # nobody reads: the terminal fills up
            it.process.wait(8)
        it.process.send_signal(number)
        assert it.process.wait(PATIENCE) == 128 + number


FILLED = """
import os, sys
from contextlib import suppress
from rise_tui.cli.main import main
from rise_tui.console.app import ConsoleApp

run = ConsoleApp.run

def run_and_fill(app, **options):
    run(app, **options)
    terminal = os.open(os.ttyname(2), os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
    with suppress(BlockingIOError):
        while True:
            os.write(terminal, b"x" * 4096)

ConsoleApp.run = run_and_fill
main()
"""


def test_a_console_ends_although_its_terminal_takes_the_last_frame_but_not_the_sentence_after_it() -> None:
    with terminal("--config", GREETING, "--seed", "1", program=(sys.executable, "-c", FILLED)) as it:
        it.until("LIVE")
        it.process.send_signal(signal.SIGTERM)
        assert it.process.wait(PATIENCE) == 128 + signal.SIGTERM


def test_a_writer_gives_a_stalled_terminal_up_only_when_it_is_told_to_hurry() -> None:
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as file:
        writer = TerminalWriter(file)
        writing = threading.Thread(target=writer.write, args=("x" * 1_000_000,), daemon=True)
        writing.start()
        writing.join(TerminalWriter.PATIENCE + 0.5)
        assert writing.is_alive() and not writer.is_gone
        writer.end_quickly()
        writing.join(5)
        assert not writing.is_alive() and writer.is_gone
        os.close(writer.fileno())
    os.close(master)


def test_a_writer_says_once_that_its_terminal_is_gone_and_takes_everything_from_then_on() -> None:
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as file:
        writer = TerminalWriter(file)
        lost: list[bool] = []
        writer.on_gone = lambda: lost.append(True)
        writer.write("here")
        assert os.read(master, 10) == b"here" and not writer.is_gone
        os.close(master)
        writer.write("gone")
        writer.write("gone")
        assert writer.is_gone and lost == [True]
        os.close(writer.fileno())


def test_the_shell_keeps_its_blocking_terminal() -> None:
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as file:
        writer = TerminalWriter(file)
        assert os.get_blocking(slave) and not os.get_blocking(writer.fileno())
        os.close(writer.fileno())
    os.close(master)


@pytest.mark.parametrize(("folder", "said"), [("", "name a folder"), ("DIR", "there is no scenario in DIR:")])
def test_a_folder_that_is_no_scenario_is_refused(folder: str, said: str, tmp_path: Path) -> None:
    place = folder.replace("DIR", str(tmp_path))
    done = run_rise_tui("--config", place)
    assert done.returncode == 1
    assert said.replace("DIR", str(tmp_path)) in done.stdout
