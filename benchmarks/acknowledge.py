"""A command over the session's socket until its acknowledgement, compared with an echo plus one fdatasync.

The same blocking client measures both; the other side of each socket is a separate process. A command returns when the
input is on the disk, with the records that it caused. The floor is the sum of two medians: an echo on asyncio, which
the engine also uses, and a write with fdatasync. The commands are a millisecond apart, more frequent than those of
wizards and programs. Two further rows are for information: back-to-back commands, and an echo whose loop blocks while
it synchronises. No session could work like that. It saves the switch between threads, which takes as long as a fast
disk.
"""

from __future__ import annotations

import os
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from measure import Report, interleave

from rise_engine.kernel.inputs import Submit
from rise_engine.run.protocol import messages

COMMANDS = 200
PAUSE = 0.001
"""Seconds between an answer and the next command."""

ECHO = """
import asyncio, os, sys
if len(sys.argv) > 2:
    file = os.open(sys.argv[2], os.O_WRONLY | os.O_CREAT)
class Echo(asyncio.Protocol):
    def connection_made(self, transport): self.transport = transport
    def data_received(self, data):
        if len(sys.argv) > 2:
            os.write(file, data)
            os.fdatasync(file)
        self.transport.write(data)
async def main():
    server = await asyncio.get_running_loop().create_unix_server(Echo, sys.argv[1])
    print("ready", flush=True)
    await server.serve_forever()
asyncio.run(main())
"""


def echo(folder: Path, *, sync: bool) -> tuple[Callable[[], float], subprocess.Popen[str], Callable[[], float]]:
    """The round trip of an echo, its process, and a write with fdatasync after each."""
    path, file = folder / f"echo-{sync}.sock", folder / f"echo-{sync}"
    command = [sys.executable, "-c", ECHO, str(path), *([str(file)] if sync else [])]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(str(path))
    line = messages.encode_line(_command(1))
    own = os.open(folder / f"own-{sync}", os.O_WRONLY | os.O_CREAT)

    def round_trip() -> float:
        start = time.perf_counter()
        connection.sendall(line)
        assert connection.recv(65_536) == line
        return time.perf_counter() - start

    def write() -> float:
        start = time.perf_counter()
        os.write(own, line)
        os.fdatasync(own)
        return time.perf_counter() - start

    return round_trip, process, write


def ours(folder: Path) -> tuple[Callable[[], float], subprocess.Popen[str]]:
    """A command's round trip, and the engine's process."""
    scenario = Path(__file__).parents[1] / "scenarios" / "lablinking"
    environment = {**os.environ, "RISE_SESSIONS": str(folder / "sessions"), "RISE_RUNTIME": str(folder / "run")}
    process = subprocess.Popen(
        [sys.executable, "-m", "rise_engine", "serve", str(scenario), "--name", "bench"],
        env=environment,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stderr is not None
    process.stderr.readline()
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(str(folder / "run" / "bench.sock"))
    connection.sendall(
        messages.encode_line(messages.AttachMessage(version=messages.VERSION, name="bench", role="node"))
    )
    data = b""
    while b'"type":"ready"' not in data:
        data += connection.recv(1 << 20)
    number = 0

    def run() -> float:
        nonlocal number
        number += 1
        line = messages.encode_line(_command(number))
        mark = b'"reply","id":%d,' % number
        start = time.perf_counter()
        connection.sendall(line)
        data = b""
        while mark not in data:
            data += connection.recv(1 << 20)
        return time.perf_counter() - start

    return run, process


def median(work: Callable[[], float], pause: float) -> Callable[[], float]:
    def run() -> float:
        seconds = []
        for _ in range(COMMANDS):
            time.sleep(pause)
            seconds.append(work())
        return statistics.median(seconds)

    return run


def _command(number: int) -> messages.SendMessage:
    return messages.SendMessage(id=number, message=Submit(function="raiseEventTopic", behavior="/next"))


def main() -> bool:
    # in the repository and not in /tmp, which may not be a disk
    with tempfile.TemporaryDirectory(prefix=".bench-", dir=Path(__file__).parents[1]) as name:
        folder = Path(name)
        bare, echoing, write = echo(folder, sync=False)
        still, standing, _ = echo(folder, sync=True)
        mine, serving = ours(folder)
        try:
            works: dict[str, tuple[Callable[[], object], int]] = {
                "command, acknowledged and durable": (median(mine, PAUSE), 0),
                "echo": (median(bare, PAUSE), 0),
                "write and fdatasync": (median(write, PAUSE), 0),
                "echo whose loop stands still meanwhile": (median(still, PAUSE), 0),
                "command, right after the answer before": (median(mine, 0), 0),
            }
            figures = interleave(works, 9)
        finally:
            for process in (serving, echoing, standing):
                process.terminate()
                process.wait()
    report = Report("A command over the socket", "wall time")
    for kind, figure in figures.items():
        report.row(kind, f"{figure.median * 1e6:.0f} us")
    own, echoed, written, stood, _ = (figure.median for figure in figures.values())
    report.row("times the echo that stands still", f"{own / stood:.2f}")
    report.target("times echo plus fdatasync", own / (echoed + written), 3, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
