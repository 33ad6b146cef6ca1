"""Commands over the socket while a session makes 1,000 records a second: until they are durable, and until a stop
reaches the robot.

The engine is a separate process with a journal; the wizard's client is another. A command's time is measured from the
write to the socket to its reply, which comes after its records are on the disk. A stop's time ends when the robot's
adapter gets it, without waiting for the disk. The floor is a write with fdatasync in the same run.
"""

from __future__ import annotations

import asyncio
import json
import os
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from contextlib import closing, suppress
from pathlib import Path
from typing import Any

from measure import Report
from steady_load import make_records

from rise_engine.kernel.inputs import Submit
from rise_engine.run.engine.clock import RealClock
from rise_engine.run.engine.drivers import make_robot
from rise_engine.run.engine.engine import Engine, versions
from rise_engine.run.protocol import messages
from rise_engine.run.protocol.registry import acquire_lock
from rise_engine.run.server.hub import SessionHub
from rise_engine.run.server.server import SessionServer
from rise_engine.scenario.loader import load
from rise_engine.session.folder import JOURNAL, create_session
from rise_engine.session.journal import Journal
from rise_engine.session.journal_format import encode_header

ROOT = Path(__file__).parents[1]
RATE = 1000
COMMANDS, STOPS = 1000, 100
PAUSE = 0.01
"""Seconds between two commands."""


async def serve(folder: Path) -> None:
    """The engine's process: makes records until its input ends, then prints when stops reached the robot."""
    loop = asyncio.get_running_loop()
    loaded = load(str(ROOT / "scenarios" / "lablinking"))
    scenario = loaded.scenario
    assert scenario is not None
    record = create_session(folder, scenario, loaded.files, seed=1, faults=(), versions=versions())
    clock = RealClock(loop)
    robot = make_robot(scenario.robot, scenario.mode, clock, 1)
    stops: list[float] = []
    stop_all = robot.stop_all

    def watched_stop() -> None:
        stops.append(time.monotonic())
        stop_all()

    robot.stop_all = watched_stop  # type: ignore[method-assign]

    def changed() -> None:
        with suppress(RuntimeError):  # the loop has ended
            loop.call_soon_threadsafe(engine.flush_durable)

    journal = Journal(record / JOURNAL, changed=changed, now=clock.now)
    journal.append(encode_header("benchmark"))
    engine = Engine(scenario, robot, clock, 1, journal=journal)
    with closing(acquire_lock("bench")) as name:
        assert name is not None
        hub = SessionHub(engine, str(record))
        server = SessionServer(hub, name.socket)
        await server.start()
        engine.start()
        reading = asyncio.ensure_future(asyncio.to_thread(sys.stdin.read))
        print(name.socket, flush=True)
        rate = await make_records(engine, hub, RATE, reading)
        print(json.dumps({"stops": stops, "rate": rate}), flush=True)
        engine.end_now("done")
        await server.close()
        await asyncio.to_thread(journal.close, 5.0)


class Wizard:
    """A blocking client. Each reply comes with a hundred records, which it ignores."""

    def __init__(self, path: str) -> None:
        self._connection = socket.socket(socket.AF_UNIX)
        self._connection.connect(path)
        self._connection.sendall(messages.encode_line(messages.AttachMessage(messages.VERSION, "bench", "wizard")))
        self._read_until(b'"type":"ready"')
        self._number = 0

    def _read_until(self, mark: bytes) -> None:
        data = b""
        while mark not in data:
            more = self._connection.recv(1 << 20)
            if not more:
                raise SystemExit("the engine has cut the connection: this machine is too busy to measure on")
            data = data[-len(mark) :] + more

    def send(self, function: str, behavior: str = "") -> tuple[float, float]:
        """The times of sending and of the reply."""
        self._number += 1
        submit = Submit(function=function, behavior=behavior)  # type: ignore[arg-type]
        line = messages.encode_line(messages.SendMessage(self._number, submit))
        sent = time.monotonic()
        self._connection.sendall(line)
        self._read_until(b'"type":"reply","id":%d,' % self._number)
        return sent, time.monotonic()

    def rest(self, seconds: float) -> None:
        """Read for so long, so that nothing waits."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            self._connection.settimeout(left)
            with suppress(TimeoutError):
                self._connection.recv(1 << 20)
        self._connection.settimeout(None)


def synchronise(folder: Path) -> list[float]:
    """Seconds of a write with fdatasync, in another file on the same disk."""
    file = os.open(folder / "floor", os.O_WRONLY | os.O_CREAT)
    took = []
    for _ in range(200):
        began = time.monotonic()
        os.write(file, b"x" * 300)
        os.fdatasync(file)
        took.append(time.monotonic() - began)
    os.close(file)
    return took


def measure(root: str, disk: Path) -> tuple[list[float], list[float], float]:
    """Seconds of commands and of stops, and the records per second meanwhile."""
    environment = {**os.environ, "RISE_RUNTIME": f"{root}/run"}
    command = [sys.executable, __file__, "serve", str(disk)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment) as engine:
        assert engine.stdin is not None and engine.stdout is not None
        wizard = Wizard(engine.stdout.readline().strip())
        commands, asked = [], []
        for _ in range(COMMANDS):
            wizard.rest(PAUSE)
            sent, replied = wizard.send("raiseEventTopic", "/next")
            commands.append(replied - sent)
        for _ in range(STOPS):
            wizard.rest(PAUSE)
            asked.append(wizard.send("stopAll")[0])
            wizard.rest(PAUSE)
            wizard.send("releaseStop")
        engine.stdin.close()
        measured: dict[str, Any] = json.loads(engine.stdout.readline())
    stopped = [reached - sent for sent, reached in zip(asked, measured["stops"], strict=True)]
    return commands, stopped, measured["rate"]


def percentile(values: list[float], part: float) -> float:
    return sorted(values)[min(len(values) - 1, int(len(values) * part))]


def main() -> bool:
    root = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    # in the repository and not in /tmp, which may not be a disk
    with tempfile.TemporaryDirectory(prefix=".bench-", dir=ROOT) as name:
        disk = Path(name)
        try:
            commands, stops, rate = measure(root, disk)
            floor = synchronise(disk)
        finally:
            shutil.rmtree(root, ignore_errors=True)
    report = Report(f"Commands while {rate:,.0f} records a second are made", "wall time")
    for kind, values in (("command, durable", commands), ("stop, at the robot", stops), ("write and fdatasync", floor)):
        shown = f"90% {percentile(values, 0.9) * 1000:.1f}, max {max(values) * 1000:.1f} ms"
        report.row(kind, f"{statistics.median(values) * 1000:.2f} ms", shown)
    report.target("ms to a durable command, p50", statistics.median(commands) * 1000, 5, at_least=False)
    report.target("ms to a durable command, p99", percentile(commands, 0.99) * 1000, 30, at_least=False)
    report.target("ms to a stop, p99", percentile(stops, 0.99) * 1000, 20, at_least=False)
    return report.met


if __name__ == "__main__":
    if sys.argv[1:2] == ["serve"]:
        asyncio.run(serve(Path(sys.argv[2])))
    else:
        sys.exit(not main())
