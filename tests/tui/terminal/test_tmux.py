"""The console as many will run it: inside tmux, which has keys, colours and a screen of its own."""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from time import monotonic, sleep

import pytest

from rise_tui.config.preferences import typed_command
from tests.patience import PATIENCE
from tests.tui.fake import DEMO
from tests.tui.terminals import FINGERS, ROOT, environment_of, kill_engines

pytestmark = [pytest.mark.pty, pytest.mark.skipif(shutil.which("tmux") is None, reason="tmux is not installed")]


class Tmux:
    """A server of its own, with one window of 80x24."""

    def __init__(self, home: str) -> None:
        self.home = home
        self.environment = {name: value for name, value in environment_of(home).items() if name != "TMUX"}
        self._servers = 0

    def __call__(self, *words: str) -> str:
        command = ["tmux", "-L", f"rise-test-{os.getpid()}-{self._servers}", "-f", "/dev/null", *words]
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, check=False)
        return done.stdout

    def start(self, *arguments: str) -> None:
        """In a server of its own: one that is just ending would take the new window along."""
        self._servers += 1
        program = shlex.join([sys.executable, "-m", "rise_tui", *arguments])
        self("new-session", "-d", "-x", "80", "-y", "24", "-c", str(ROOT), f"{program}; sleep 600")

    def keys(self, *keys: str) -> None:
        """Press keys as a person does, who is never quicker than a finger."""
        sleep(FINGERS)
        self("send-keys", *keys)

    @property
    def text(self) -> str:
        return self("capture-pane", "-p")

    def until(self, text: str) -> None:
        """Wait for `text`, wherever the terminal wraps it: a checkout may have a long path."""
        end = monotonic() + PATIENCE
        while text not in (shown := self("capture-pane", "-p", "-J")):
            assert monotonic() < end, f"{text!r} is not on the screen:\n{shown}"
            sleep(0.1)


@pytest.fixture
def tmux() -> Iterator[Tmux]:
    home = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    made = Tmux(home)
    yield made
    made("kill-server")
    kill_engines(home)
    shutil.rmtree(home, ignore_errors=True)


def test_start_act_stop_release_detach_and_come_back(tmux: Tmux) -> None:
    tmux.start("--config", DEMO, "--seed", "1", "--wizard", "anna")
    tmux.until("LIVE")
    tmux.keys("g")
    tmux.until("► running")
    tmux.keys("F9")
    tmux.until("STOPPED")
    tmux.until("every part has confirmed")
    tmux.keys("C-r")
    tmux.until("Release (r)")
    tmux.keys("r")
    tmux.until("LIVE")
    tmux.keys("m")
    tmux.until("► running")
    tmux.keys("C-c")
    tmux.until("Detach (d)")
    tmux.keys("d")
    tmux.until(f"come back with: {typed_command()}")
    tmux("kill-server")
    tmux.start("--wizard", "anna")
    tmux.until("LIVE")
    tmux.until("waiting")  # the rule went on to its next state meanwhile
    lines = tmux.text.splitlines()
    assert len(lines) <= 24 and all(len(line) <= 80 for line in lines)
    assert "Demo study" in lines[0]
