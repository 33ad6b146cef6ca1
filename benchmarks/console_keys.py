"""From a key to its durable command, while the console shows 1,000 records a second.

The console runs on a pseudo terminal, an engine with a journal in a separate process (`engine_under_load`). The time is
measured from the write of the key until the command is on the disk, and also until it reaches the engine. The floor is
the minimum of any program: one that reads a key from a terminal and writes a line to a socket, which the same process
of the engine reads, in the same run.

On a virtual machine, a processor sometimes stands still for 1 to 100 ms. A watcher on each processor detects this: it
has the highest priority and wakes twice a millisecond. Keys during such a stall do not count, neither ours nor those of
the floor; their number is reported.
"""

from __future__ import annotations

import json
import os
import random
import select
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from console_terminal import Pty, environment_in
from measure import Report

ROOT = Path(__file__).parents[1]
KEYS = "abcdehij"
QUIET, PRESSES = 100, 400
"""Keys without other activity, and while records pour in."""
MEDIAN, SLOWEST = 5.0, 30.0
"""Maximum milliseconds of half of the keys, and of 99 of 100: a wizard reacts in 200."""
GAP = 0.35
"""Seconds between two keys, longer than the time for which a paste silences the keyboard."""

BARE = """
import os, socket, sys, tty
tty.setraw(0)
link = socket.socket(socket.AF_UNIX)
link.connect(sys.argv[1])
os.write(1, b"ready")
while data := os.read(0, 4096):
    link.sendall(b'{"type":"send","id":1}\\n')
"""

WATCHER = """
import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
try:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(1))
except PermissionError:
    pass  # then it may be late because somebody else works, and too much is left out
stood = open(sys.argv[4], "w")  # a pipe that nobody reads meanwhile would hold it up once it is full
print("ready", flush=True)
last = time.monotonic()
while os.getppid() == int(sys.argv[2]):
    time.sleep(0.0005)
    now = time.monotonic()
    if now - last > float(sys.argv[3]):
        print(last, now, file=stood, flush=True)
    last = now
"""
STALL = 0.0015
"""Seconds between two wake-ups of a watcher above which they count as a stall; it wakes every half a millisecond."""


class Stalls:
    """The times at which the machine itself stood still."""

    def __init__(self, folder: str) -> None:
        self._told = [Path(folder, f"stalls-{cpu}") for cpu in sorted(os.sched_getaffinity(0))]
        self._watchers = [
            subprocess.Popen(
                [sys.executable, "-c", WATCHER, told.name.rpartition("-")[2], str(os.getpid()), str(STALL), str(told)],
                stdout=subprocess.PIPE, text=True,
            )
            for told in self._told
        ]  # fmt: skip
        for watcher in self._watchers:
            assert watcher.stdout is not None
            if not watcher.stdout.readline():
                raise SystemExit("nobody watches whether the machine stands still")

    def end(self) -> list[tuple[float, float]]:
        """Return the starts and ends, on the monotonic clock."""
        for watcher in self._watchers:
            watcher.kill()
            watcher.communicate()
        lines = (line.split() for told in self._told for line in told.read_text().splitlines())
        return [(float(line[0]), float(line[1])) for line in lines if len(line) == 2]


def scenario(folder: Path) -> None:
    """The long study's scenario, with keys that raise events, which are always accepted."""
    shutil.copytree(ROOT / "scenarios" / "lablinking", folder)
    keys = "\n".join(f'{key} = {{ event = "/press_{key}" }}' for key in KEYS)
    (folder / "scenario.toml").write_text(f'title = "Keys"\nrobot = "pepper"\nmode = "debug"\n[keys]\n{keys}\n')


def press(terminal: Pty, others: list[Pty], presses: int) -> list[tuple[float, str]]:
    """Type one key after the other, on each terminal in turn, and read what is painted meanwhile."""
    chance = random.Random(1)
    written = []
    every = (terminal, *others)
    for number in range(presses):
        key = KEYS[number % len(KEYS)]
        for each in every:
            until = time.monotonic() + GAP / len(every) * chance.uniform(0.9, 1.1)
            written.append((time.monotonic(), key))
            os.write(each.master, key.encode())
            while (left := until - time.monotonic()) > 0:
                for other in every:
                    other.read(0)
                select.select([other.master for other in every], [], [], left)
    return written


class Measured(NamedTuple):
    """Seconds of keys."""

    keys: list[float]
    """Until the command was durable."""
    came: list[float]
    """Until the engine had it."""
    floor: list[float]
    """Through the bare program."""
    every: list[float]
    """Like `keys`, with those during a stall of the machine."""
    rate: float
    """Records a second."""
    painted: int
    """Bytes."""


def measure(rate: float, presses: int) -> Measured:
    """Press this many keys while records pour in."""
    root = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    disk = tempfile.mkdtemp(prefix=".bench-", dir=ROOT)  # /tmp may not be a disk
    environment = environment_in(root)
    scenario(Path(root, "scenario"))
    engine = subprocess.Popen(
        [sys.executable, str(Path(__file__).with_name("engine_under_load.py")), root, disk, str(rate)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=environment,
    )  # fmt: skip
    assert engine.stdin is not None and engine.stdout is not None
    console = bare = None
    try:
        engine.stdout.readline()
        console = Pty([str(Path(sys.executable).with_name("rise-tui")), "--wizard", "anna"], environment)
        bare = Pty([sys.executable, "-c", BARE, f"{root}/floor.sock"], environment)
        console.until(b"LIVE")
        bare.until(b"ready")
        console.read_for(3)
        painted = console.count
        stalls = Stalls(root)
        written = press(console, [bare], presses)
        stood = stalls.end()
        painted = console.count - painted
        console.read_for(0.5)
        engine.stdin.write("\n")
        engine.stdin.flush()
        told = json.loads(engine.stdout.readline())
    finally:
        for each in (console, bare):
            if each is not None:
                each.close()
        engine.stdin.close()
        engine.wait()
        for folder in (root, disk):
            shutil.rmtree(folder, ignore_errors=True)
    ours = [(at, f"/press_{key}") for at, key in written[::2]]
    theirs = [at for at, _ in written[1::2]]
    noted = iter(told["commands"])
    command = next(noted, None)
    keys, came = [], []
    for pressed, wanted in ours:
        if command is not None and command[0] == wanted:
            came.append((pressed, command[1]))
            keys.append((pressed, command[2]))
            command = next(noted, None)
    if len(keys) < len(ours):  # two of them came in one read, like a paste: this machine is too busy
        print(
            f"  {len(ours) - len(keys)} of {len(ours)} keys came together with others and did nothing, as they should"
        )
    floor = list(zip(theirs, told["floor"], strict=False))
    every = [end - start for start, end in keys]
    ways = (undisturbed(each, stood) for each in (keys, came, floor))
    return Measured(*ways, every, told["rate"], painted)


def undisturbed(ways: list[tuple[float, float]], stood: list[tuple[float, float]]) -> list[float]:
    """The seconds of keys without a stall."""
    return [end - start for start, end in ways if not any(start < until and end > since for since, until in stood)]


def percentile(values: list[float], part: float) -> float:
    return sorted(values)[min(len(values) - 1, int(len(values) * part))]


def main() -> bool:
    report = Report("From a key to its durable command", "wall time")
    quiet, busy = measure(0, QUIET), measure(1000, PRESSES)
    for name, values in (
        ("nothing else happens", quiet.keys),
        ("of that, until the engine has it", quiet.came),
        (f"{busy.rate:,.0f} records a second", busy.keys),
        ("of those, until the engine has it", busy.came),
        ("floor: a bare program, same run", busy.floor),
        ("with those while the machine stood still", busy.every),
    ):
        shown = ", ".join(f"{part:.0%} {percentile(values, part) * 1000:.1f}" for part in (0.5, 0.9, 0.99))
        report.row(name, f"{statistics.median(values) * 1000:.2f} ms", f"{shown}, max {max(values) * 1000:.1f} ms")
    report.row("painted meanwhile", f"{busy.painted / PRESSES / GAP / 1000:.0f} kB/s")
    report.row(
        "left out because the machine stood still", f"{len(busy.every) - len(busy.keys)} of {len(busy.every)} keys"
    )
    report.target("ms, half of the keys at 1,000 records/s", percentile(busy.keys, 0.5) * 1000, MEDIAN, at_least=False)
    report.target("ms, 99 of 100 keys at 1,000 records/s", percentile(busy.keys, 0.99) * 1000, SLOWEST, at_least=False)
    return report.met


if __name__ == "__main__":
    with suppress(KeyboardInterrupt):
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
        sys.exit(not main())
