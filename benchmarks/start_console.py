"""`rise-tui --config` until a console of a live session is painted, compared with a bare Textual app with five panes.

Both start on a pseudo terminal and are measured from the start of the process until their last pane is painted. Ours
also starts the engine's process, its session and its journal, and shows the state of that engine.
"""

from __future__ import annotations

import fcntl
import os
import pty
import select
import shutil
import signal
import statistics
import struct
import subprocess
import sys
import tempfile
import termios
import time
from collections.abc import Callable
from pathlib import Path

from measure import Report

ROUNDS = 9
MOST = 2.5
"""Maximum ratio to the bare app."""
ROOT = Path(__file__).parents[1]

BARE = """
from textual.app import App
from textual.containers import Grid
from textual.widgets import Static

class Bare(App):
    ENABLE_COMMAND_PALETTE = False
    CSS = "Grid { grid-size: 2 3; } Static { border: solid white; }"

    def compose(self):
        with Grid():
            for n in range(1, 6):
                yield Static(f"pane {n} is LIVE" if n == 5 else f"pane {n}")

Bare().run()
"""


def until_painted(command: list[str], mark: bytes, environment: dict[str, str]) -> float:
    """Wall seconds from the start of the process until `mark` is on its terminal."""
    master, slave = pty.openpty()
    fcntl.ioctl(slave, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 120, 0, 0))
    began = time.perf_counter()
    process = subprocess.Popen(
        command, stdin=slave, stdout=slave, stderr=slave, cwd=ROOT, env=environment, start_new_session=True
    )
    os.close(slave)
    shown = b""
    while mark not in shown:
        if not select.select([master], [], [], 30)[0]:
            raise SystemExit(f"{command} painted nothing:\n{shown.decode(errors='replace')}")
        shown += os.read(master, 65_536)
    seconds = time.perf_counter() - began
    process.kill()
    process.wait()
    os.close(master)
    return seconds


def bare(environment: dict[str, str]) -> float:
    return until_painted([sys.executable, "-c", BARE], b"LIVE", environment)


def ours(environment: dict[str, str]) -> float:
    program = str(Path(sys.executable).with_name("rise-tui"))
    command = [program, "--config", "scenarios/lablinking", "--mode", "debug", "--new"]
    seconds = until_painted(command, b"LIVE", environment)
    for lock in Path(environment["RISE_RUNTIME"]).glob("*.lock"):
        pid = int(lock.read_text().split()[0])
        os.kill(pid, signal.SIGKILL)
        while Path(f"/proc/{pid}").exists():
            time.sleep(0.01)
    return seconds


def main() -> bool:
    folder = tempfile.mkdtemp(prefix="rise-bench-", dir="/tmp")
    environment = {
        **{name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"},
        "RISE_RUNTIME": f"{folder}/run",
        "RISE_SESSIONS": f"{folder}/sessions",
        "XDG_CONFIG_HOME": f"{folder}/config",
        "XDG_STATE_HOME": f"{folder}/state",
        "TERM": "xterm-256color",
    }
    works: dict[str, Callable[[dict[str, str]], float]] = {"rise-tui --config, live": ours, "bare app": bare}
    samples: dict[str, list[float]] = {name: [] for name in works}
    try:
        for n in range(ROUNDS + 1):
            for name, work in works.items():
                seconds = work(environment)
                if n:  # the first fills the caches
                    samples[name].append(seconds)
    finally:
        shutil.rmtree(folder, ignore_errors=True)
    report = Report("Cold start to a live console", "wall time")
    for name, each in samples.items():
        report.row(name, f"{statistics.median(each) * 1000:.0f} ms")
    mine, floor = (statistics.median(each) for each in samples.values())
    report.target("times the bare app", mine / floor, MOST, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
