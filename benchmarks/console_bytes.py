"""The bytes of a moved cursor and of a change of focus on the wire, at 120x40.

The session is idle, so each byte has a known cause. For information, it also measures another pane in front, a dialog,
and a repaint of the whole screen, which is the cost of writing all cells.
"""

from __future__ import annotations

import os
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from console_terminal import PATIENCE, Pty, environment_in
from measure import Report

ROOT = Path(__file__).parents[1]
ROUNDS = 6
CURSOR, FOCUS = 500, 2000
"""Maximum bytes, in the median."""
STILL = 0.4
"""Seconds without a byte after which the screen counts as painted."""
F2, TAB, DOWN, UP, ESCAPE = b"\x1bOQ", b"\t", b"\x1b[B", b"\x1b[A", b"\x1b"

ENGINE = """
import sys
sys.path.insert(0, ".")
from tests.tui.scripted import scripted

with scripted(sys.argv[1], speed=0.0):
    print("ready", flush=True)
    sys.stdin.readline()
"""


def cost(console: Pty, keys: bytes) -> int:
    """Bytes that follow these keys until the screen is painted."""
    while console.read(STILL):
        pass
    before = console.count
    os.write(console.master, keys)
    end = time.monotonic() + PATIENCE
    while console.count == before:
        console.read(0.1)
        if time.monotonic() > end:
            raise SystemExit(f"{keys!r} changed nothing on the screen")
    while console.read(STILL):
        pass
    return console.count - before


def main() -> bool:
    root = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    Path(root, "run").mkdir(0o700)
    environment = environment_in(root)
    engine = subprocess.Popen(
        [sys.executable, "-c", ENGINE, root],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=environment,
    )  # fmt: skip
    assert engine.stdin is not None and engine.stdout is not None
    console = None
    try:
        engine.stdout.readline()
        console = Pty([str(Path(sys.executable).with_name("rise-tui")), "--wizard", "anna"], environment)
        console.until(b"LIVE")
        console.read_for(2)
        moved = [cost(console, key) for _ in range(3) for key in (DOWN, UP)]
        focused = [cost(console, F2) for _ in range(ROUNDS)]
        shown = [cost(console, TAB) for _ in range(ROUNDS)]
        dialog = [cost(console, keys) for _ in range(3) for keys in (b"?", ESCAPE)]
        os.write(console.master, b":")
        console.read_for(1)
        os.write(console.master, b"paint the screen anew")
        console.read_for(1)
        whole = cost(console, b"\r")
    finally:
        if console is not None:
            console.close()
        engine.stdin.close()
        engine.wait()
        shutil.rmtree(root, ignore_errors=True)
    report = Report("What a key costs on the wire, at 120x40", "bytes")
    for name, each in (
        ("a moved cursor", moved),
        ("a change of focus", focused),
        ("another pane", shown),
        ("help opened, or closed", dialog),
    ):
        report.row(name, f"{statistics.median(each):,.0f} B", f"from {min(each):,} to {max(each):,}")
    report.row("the whole screen", f"{whole:,} B")
    report.target("bytes of a moved cursor", statistics.median(moved), CURSOR, at_least=False)
    report.target("bytes of a change of focus", statistics.median(focused), FOCUS, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
