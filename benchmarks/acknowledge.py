"""A command over the session's socket until its acknowledgement, beside an echo over such a socket plus one fdatasync.

The same blocking client measures everything, one command after the other; the other side of each socket is a process
of its own. Ours comes back when the input is on the disk, and brings the records that it caused. The floor is the sum
of two medians: an echo on asyncio, which the engine runs on as well, and a write with fdatasync, one after each echo.
Beside it, for information, an echo whose loop stands still while it synchronises: no session could be served that way,
and it saves the two changes between threads, which cost as much as the disk where the disk is quick.
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
from rise_engine.link import messages

COMMANDS = 300

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
    """An echo's round trip, its process, and a write with fdatasync of its own after each."""
    path, file = folder / f"echo-{sync}.sock", folder / f"echo-{sync}"
    command = [sys.executable, "-c", ECHO, str(path), *([str(file)] if sync else [])]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    process.stdout.readline()
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(str(path))
    line = messages.line(_command(1))
    own = os.open(folder / f"own-{sync}", os.O_WRONLY | os.O_CREAT)

    def round_trip() -> float:
        start = time.perf_counter()
        connection.sendall(line)
        assert connection.recv(65_536) == line
        return time.perf_counter() - start

    def run() -> float:
        return statistics.median(round_trip() for _ in range(COMMANDS))

    def write() -> float:
        seconds = []
        for _ in range(COMMANDS):
            round_trip()
            start = time.perf_counter()
            os.write(own, line)
            os.fdatasync(own)
            seconds.append(time.perf_counter() - start)
        return statistics.median(seconds)

    return run, process, write


def ours(folder: Path) -> tuple[Callable[[], float], subprocess.Popen[str]]:
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
    connection.sendall(messages.line(messages.Attach(version=messages.VERSION, name="bench", role="node")))
    data = b""
    while b'"type":"ready"' not in data:
        data += connection.recv(1 << 20)
    number = 0

    def run() -> float:
        nonlocal number
        seconds = []
        for _ in range(COMMANDS):
            number += 1
            line = messages.line(_command(number))
            mark = b'"reply","id":%d,' % number
            start = time.perf_counter()
            connection.sendall(line)
            data = b""
            while mark not in data:
                data += connection.recv(1 << 20)
            seconds.append(time.perf_counter() - start)
        return statistics.median(seconds)

    return run, process


def _command(number: int) -> messages.Send:
    return messages.Send(id=number, message=Submit(function="raiseEventTopic", behavior="/next"))


def main() -> bool:
    # Beside the repository and not in /tmp, which may be no disk.
    with tempfile.TemporaryDirectory(prefix=".bench-", dir=Path(__file__).parents[1]) as name:
        folder = Path(name)
        bare, echoing, write = echo(folder, sync=False)
        still, standing, _ = echo(folder, sync=True)
        mine, serving = ours(folder)
        try:
            works: dict[str, tuple[Callable[[], object], int]] = {
                "command, acknowledged and durable": (mine, 0),
                "echo": (bare, 0),
                "write and fdatasync": (write, 0),
                "echo whose loop stands still meanwhile": (still, 0),
            }
            figures = interleave(works, 9)
        finally:
            for process in (serving, echoing, standing):
                process.terminate()
                process.wait()
    report = Report("A command over the socket", "wall time")
    for kind, figure in figures.items():
        report.row(kind, f"{figure.median * 1e6:.0f} us")
    own, echoed, written, stood = (figure.median for figure in figures.values())
    report.row("times the echo that stands still", f"{own / stood:.2f}")
    report.target("times echo plus fdatasync", own / (echoed + written), 2, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
