"""A day's use of the console: 10,000 focus changes and 100,000 records, and the memory of its process before and after.

The records change existing values and states, so growth is a leak; only the log of tasks grows by design. The console
runs on a pseudo terminal, the served session in a separate process.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from console_terminal import Pty, environment_in
from measure import Report

ROOT = Path(__file__).parents[1]
FOCUS_CHANGES, RECORDS, PARTS = 10_000, 100_000, 5
GROWN = 3.0
"""Maximum growth of memory in MB in the second half of the day, which includes the allocator's variation."""

ENGINE = """
import sys
sys.path.insert(0, ".")
from rise_engine.kernel.records import MemoryRecord
from tests.tui.scripted import scripted

with scripted(sys.argv[1]) as engine:
    print("ready", flush=True)
    number = 0
    for line in sys.stdin:
        for _ in range(int(line) // 50):
            number += 1
            records = [
                MemoryRecord(0, 0.0, "", "side", f"v{number}x{one}", None, "node:n", created=False) for one in range(50)
            ]
            engine.do(lambda fake: fake.emit(*records))
        print(number, flush=True)
"""


def resident(pid: int) -> float:
    """MB."""
    pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def main(scale: float = 0.1) -> bool:
    """`scale`: the fraction of a day. A whole one takes ten minutes."""
    root = tempfile.mkdtemp(prefix="rise-", dir="/tmp")
    Path(root, "run").mkdir(0o700)
    environment = environment_in(root)
    engine = subprocess.Popen(
        [sys.executable, "-c", ENGINE, root],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, cwd=ROOT, env=environment,
    )  # fmt: skip
    assert engine.stdin is not None and engine.stdout is not None
    console = None
    sizes = []
    try:
        engine.stdout.readline()
        console = Pty([str(Path(sys.executable).with_name("rise-tui")), "--wizard", "anna"], environment)
        console.until(b"LIVE")
        console.read_for(2)
        for _ in range(PARTS + 1):
            sizes.append(resident(console.process.pid))
            engine.stdin.write(f"{int(RECORDS * scale) // PARTS}\n")
            engine.stdin.flush()
            for _ in range(int(FOCUS_CHANGES * scale) // PARTS):
                before = console.count
                os.write(console.master, b"\t")
                while console.count == before:
                    console.read(0.5)
            engine.stdout.readline()
            console.read_for(1)
    finally:
        if console is not None:
            console.close()
        engine.stdin.close()
        engine.wait()
        shutil.rmtree(root, ignore_errors=True)
    report = Report("A day at the console", "resident memory")
    report.row("focus changes, records", f"{FOCUS_CHANGES * scale:,.0f}, {RECORDS * scale:,.0f}")
    report.row("at the start", f"{sizes[0]:.1f} MB")
    report.row("after each part", ", ".join(f"{size:.1f}" for size in sizes[1:]))
    report.target("MB grown in the last three fifths", sizes[-1] - sizes[2], GROWN, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main(float(sys.argv[1]) if len(sys.argv) > 1 else 1.0))
