"""The console as a person starts it: a process on a terminal of its own."""

from __future__ import annotations

import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import sys
import termios
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import monotonic

import pytest

from tests.console.fake import DEMO

ROOT = Path(__file__).parents[2]
SEQUENCE = re.compile(rb"\x1b(\[[0-9;?<>=$]*[A-Za-z@`~p]|\][^\x07\x1b]*(\x07|\x1b\\)|[P_^][^\x1b]*\x1b\\|.)")
PATIENCE = 60.0


class Terminal:
    """A pty with a console on it. Waits for what it shows, never for time alone."""

    def __init__(self, *arguments: str) -> None:
        self.master, slave = pty.openpty()
        fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
        environment = {**os.environ, "TERM": "xterm-256color", "COLORTERM": "truecolor"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", "rise_tui.cli", *arguments],
            stdin=slave,
            stdout=slave,
            stderr=slave,
            cwd=ROOT,
            env=environment,
            start_new_session=True,
            preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0),
        )
        os.close(slave)
        self.shown = b""

    def read(self, seconds: float) -> bool:
        """Take in what comes; False at the end."""
        if not select.select([self.master], [], [], seconds)[0]:
            return True
        try:
            data = os.read(self.master, 65536)
        except OSError:
            return False
        self.shown += data
        return bool(data)

    def until(self, text: str) -> None:
        """Wait until it has shown this since the last call."""
        end = monotonic() + PATIENCE
        while text not in (plain := SEQUENCE.sub(b"", self.shown).decode(errors="replace")):
            assert monotonic() < end, f"{text!r} was not shown:\n{plain[-3000:]}"
            if not self.read(0.2) and text not in SEQUENCE.sub(b"", self.shown).decode(errors="replace"):
                raise AssertionError(f"it ended without {text!r}:\n{plain[-3000:]}")
        self.shown = b""

    def press(self, keys: bytes) -> None:
        self.shown = b""
        os.write(self.master, keys)

    def ended(self) -> int:
        end = monotonic() + PATIENCE
        while self.process.poll() is None:
            assert monotonic() < end, "it did not end"
            self.read(0.1)
        return self.process.returncode


@contextmanager
def terminal(*arguments: str) -> Iterator[Terminal]:
    found = Terminal(*arguments)
    try:
        yield found
    finally:
        if found.process.poll() is None:
            found.process.kill()
            found.process.wait()
        if found.master >= 0:
            os.close(found.master)


def test_start_press_stop_and_leave() -> None:
    with terminal("--config", DEMO, "--seed", "1", "--wizard", "anna") as it:
        it.until("LIVE")
        it.press(b"g")
        it.until("running")
        it.press(b"\x1b[20~")  # F9
        it.until("everything asked has confirmed")
        it.press(b"\x03")
        it.until("End the session?")
        it.press(b"e")
        assert it.ended() == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_in_order(number: signal.Signals) -> None:
    with terminal("--config", DEMO, "--seed", "1") as it:
        it.until("LIVE")
        it.press(b"g")
        it.until("running")
        it.process.send_signal(number)
        assert it.ended() == 128 + number
        it.read(0.2)
        assert b"\x1b[?1049l" in it.shown, "the terminal was not given back"


def test_a_closed_terminal_ends_it_in_order() -> None:
    with terminal("--config", DEMO, "--seed", "1") as it:
        it.until("LIVE")
        os.close(it.master)
        it.master = -1
        assert it.process.wait(PATIENCE) == 128 + signal.SIGHUP


def test_a_refused_scenario_is_told_with_all_findings_and_no_console(tmp_path: Path) -> None:
    (tmp_path / "acts").mkdir()
    (tmp_path / "acts" / "a.xml").write_text("<Dialogs><Dialog name='A'><Spech/></Dialog></Dialogs>", encoding="utf-8")
    (tmp_path / "scenario.toml").write_text('titel = "x"\n', encoding="utf-8")
    command = [sys.executable, "-m", "rise_tui.cli", "--config", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 1
    assert "acts/a.xml:1:" in done.stdout and "scenario.toml:1:1" in done.stdout
    assert "\x1b" not in done.stdout


def test_without_a_terminal_it_says_what_to_use_instead() -> None:
    command = [sys.executable, "-m", "rise_tui.cli", "--config", DEMO]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False, stdin=subprocess.DEVNULL)
    assert done.returncode == 2 and "rise-engine run" in done.stderr
