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

from rise_tui.quiet import Outlet
from tests.console.terminals import ROOT, Terminal, terminal

pytestmark = pytest.mark.pty

GREETING = str(ROOT / "scenarios" / "greeting")
SECONDS = 20.0
"""More than the 5 s of the watchdog on a busy machine; an orderly end takes less than 3."""


def busy(it: Terminal) -> None:
    """The rule runs and the gaze follows for ever: the screen repaints all the time."""
    it.until("LIVE")
    it.press(b"b")
    it.until("running")
    it.press(b"a")
    it.until("R_FollowGaze")


def test_a_terminal_that_closes_while_the_screen_is_busy_ends_the_console() -> None:
    with terminal("--config", GREETING, "--seed", "1") as it:
        busy(it)
        os.close(it.master)
        it.master = -1
        assert it.process.wait(SECONDS) == 128 + signal.SIGHUP


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_busy_console_whose_terminal_takes_nothing(number: signal.Signals) -> None:
    with terminal("--config", GREETING, "--seed", "1") as it:
        busy(it)
        with pytest.raises(subprocess.TimeoutExpired):  # nobody reads: the terminal fills up
            it.process.wait(8)
        it.process.send_signal(number)
        assert it.process.wait(SECONDS) == 128 + number


def test_an_outlet_gives_a_stalled_terminal_up_only_when_it_is_told_to_hurry() -> None:
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as file:
        outlet = Outlet(file)
        writing = threading.Thread(target=outlet.write, args=("x" * 1_000_000,), daemon=True)
        writing.start()
        writing.join(Outlet.PATIENCE + 0.5)
        assert writing.is_alive() and not outlet.gone
        outlet.hurry()
        writing.join(5)
        assert not writing.is_alive() and outlet.gone
        os.close(outlet.fileno())
    os.close(master)


def test_an_outlet_says_once_that_its_terminal_is_gone_and_takes_everything_from_then_on() -> None:
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as file:
        outlet = Outlet(file)
        lost: list[bool] = []
        outlet.lost = lambda: lost.append(True)
        outlet.write("here")
        assert os.read(master, 10) == b"here" and not outlet.gone
        os.close(master)
        outlet.write("gone")
        outlet.write("gone")
        assert outlet.gone and lost == [True]
        os.close(outlet.fileno())


def test_the_shell_keeps_its_blocking_terminal() -> None:
    master, slave = pty.openpty()
    with os.fdopen(slave, "w") as file:
        outlet = Outlet(file)
        assert os.get_blocking(slave) and not os.get_blocking(outlet.fileno())
        os.close(outlet.fileno())
    os.close(master)


@pytest.mark.parametrize("held", ["", "time.sleep(60)"])
def test_the_watchdog_ends_what_nothing_else_ends(held: str) -> None:
    lines = "import time\nfrom rise_tui import app\napp._end_at_last(143, 0.2)"
    program = f"import threading, time\nthreading.Thread(target=lambda: exec({lines!r})).start()\n{held}"
    assert subprocess.run([sys.executable, "-c", program], check=False, timeout=SECONDS, cwd=ROOT).returncode == 143


@pytest.mark.parametrize(("folder", "said"), [("", "name a folder"), ("DIR", "there is no scenario in DIR:")])
def test_a_folder_that_is_no_scenario_is_refused(folder: str, said: str, tmp_path: Path) -> None:
    place = folder.replace("DIR", str(tmp_path))
    command = [sys.executable, "-m", "rise_tui", "--config", place]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False, timeout=SECONDS)
    assert done.returncode == 1
    assert said.replace("DIR", str(tmp_path)) in done.stdout
