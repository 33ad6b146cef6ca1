"""The memory of a session that runs for twenty minutes with a robot, compared with that of its records.

A wizard starts ten acts a second over ROS 2. The engine keeps the session's state for consoles that attach, so its
memory grows with its records. The floor is this growth alone: a process that folds the same records into a
`SessionView`. Both are compared over the second half, because the first one fills caches. A larger growth would be a
leak.

`RISE_BENCH_MINUTES` sets another duration.
"""

from __future__ import annotations

import asyncio
import os
import random
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from pathlib import Path
from time import monotonic

from measure import Report
from ros import HERE, LOOPBACK, process, ready, scenario

from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.view import SessionView
from rise_engine.run.client.socket import SocketClient
from rise_engine.session.journal_reader import read_journal

MINUTES = float(os.environ.get("RISE_BENCH_MINUTES", "20"))
PER_SECOND = 10
TIMES_FLOOR = 1.5
"""Maximum ratio of a record's memory to that in a bare view: the kernel keeps state of its own."""
MIN_KB = 2048.0
"""Growth in kB below which nothing counts as a leak: an allocator takes memory in pieces."""


def kilobytes(pid: int | str = "self") -> int:
    """The memory of a process."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmRSS"))


def growth_of_view(journal: Path, half: int) -> int:
    """The growth of a bare view in kB by the records after the first `half` of them."""
    view, before = SessionView(), 0
    for number, record in enumerate(read_journal(journal).read_records()):
        view.apply(record)
        if number == half:
            before = kilobytes()
    return kilobytes() - before


async def press(client: SocketClient, until: float) -> None:
    """Start acts until a time of the monotonic clock."""
    loop = asyncio.get_running_loop()
    while monotonic() < until:
        next_at = loop.time() + 1 / PER_SECOND
        await client.send(Submit(function="startCommunicationRobotAct", behavior="A"))
        await asyncio.sleep(max(0.0, next_at - loop.time()))


async def run(socket: Path, engine: int, journal: Path) -> tuple[int, int, int, int]:
    """Run the session. Returns the engine's memory in kB at half time and at the end, and the records until then."""
    client = SocketClient(socket, "anna")
    await client.attach()

    async def follow() -> None:
        async for _ in client.records():
            pass

    following = asyncio.get_running_loop().create_task(follow())
    found: list[int] = []
    for _ in range(2):
        await press(client, monotonic() + MINUTES * 30)
        found += [kilobytes(engine), read_journal(journal).records]
    following.cancel()
    await client.close()
    return found[0], found[1], found[2], found[3]


def main() -> bool:
    if not Path("/proc/self/status").exists():
        print("skipped: this system does not say how much memory a process has")
        return True
    choice = os.environ.get("RISE_BENCH_ROS", "dds")
    os.environ["CYCLONEDDS_URI"] = LOOPBACK
    os.environ["ROS_DOMAIN_ID"] = str(random.SystemRandom().randrange(1, 100))
    report = Report(f"{MINUTES:g} minutes of a session over ROS 2 by {choice}", "memory")
    with tempfile.TemporaryDirectory(prefix="rise-bench-") as name, ExitStack() as stack:
        folder = Path(name)
        environment = {**os.environ, "RISE_SESSIONS": str(folder / "sessions"), "RISE_RUNTIME": str(folder / "run")}
        if choice == "rclpy":
            environment["PYTHONPATH"] = os.pathsep.join(sys.path)
        study = scenario(folder / "study")
        peers = str(HERE / "ros_peers.py")
        ready(stack.enter_context(process(peers, "robot", "--ros", choice, environment=environment)), "ready")
        serve = ("-m", "rise_engine", "serve", str(study), "--name", "bench", "--ros", choice)
        engine = stack.enter_context(process(*serve, environment=environment))
        ready(engine, "serving")
        (journal,) = (folder / "sessions").glob("*/journal.jsonl")
        half, records, end, all_records = asyncio.run(run(folder / "run" / "bench.sock", engine.pid, journal))
        command = [sys.executable, __file__, str(journal), str(records)]  # a process with nothing else in its memory
        floor = subprocess.run(command, capture_output=True, text=True, check=True)
    taken, bare = end - half, int(floor.stdout)
    report.row("records", f"{all_records:,}", f"{all_records - records:,} of them in the second half")
    report.row("the engine's memory", f"{end / 1024:.1f} MB", f"{half / 1024:.1f} MB at half time")
    report.row("growth in the second half", f"{taken} kB", f"{bare} kB in a bare view")
    report.target("kB that grew in the second half", taken, max(MIN_KB, TIMES_FLOOR * bare), at_least=False)
    return report.met


if __name__ == "__main__":
    if len(sys.argv) > 2:
        print(growth_of_view(Path(sys.argv[1]), int(sys.argv[2])))
    else:
        sys.exit(not main())
