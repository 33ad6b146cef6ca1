"""The journal: records become durable lines, compared with bare lines that are written and synchronised in groups.

Both write the same number of lines of the same length to the same disk, as fast as possible. The measurement of the
journal begins with the record: its JSON, its checksum, the handover to the writer's thread.
"""

from __future__ import annotations

import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

from kernel_events import ours
from measure import Report, interleave

from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import AnyRecord
from rise_engine.session.journal import Journal
from rise_engine.session.journal_format import encode_input, encode_record, join_step

EVENTS = 5_000
GROUP = 1_000
"""Lines per write of the floor."""

SUBMIT = Submit(function="raiseEventTopic", behavior="/R_RequestInteraction_end", source="file")


def journaled(folder: Path, steps: list[list[AnyRecord]]) -> Callable[[], float]:
    """Wall seconds per line, from the first record until the last is durable."""
    lines = len(steps) + sum(map(len, steps))

    def run() -> float:
        path = folder / "journal.jsonl"
        changed = threading.Event()
        journal = Journal(path, changed=changed.set)
        start = time.perf_counter()
        for n, records in enumerate(steps):
            journal.append(join_step(encode_input(n, SUBMIT), map(encode_record, records)))
        while journal.durable != journal.appended:
            changed.wait()
            changed.clear()
        seconds = time.perf_counter() - start
        journal.close()
        path.unlink()
        return seconds / lines

    return run


def bare(folder: Path, steps: list[list[AnyRecord]]) -> Callable[[], float]:
    made = [join_step(encode_input(n, SUBMIT), map(encode_record, records)) for n, records in enumerate(steps)]
    lines = sum(each.count(b"\n") for each in made)
    line = b"x" * (sum(map(len, made)) // lines - 1) + b"\n"

    def run() -> float:
        path = folder / "bare"
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT)
        start = time.perf_counter()
        left = lines
        while left:
            now = min(left, GROUP)
            os.write(descriptor, line * now)
            os.fdatasync(descriptor)
            left -= now
        seconds = time.perf_counter() - start
        os.close(descriptor)
        path.unlink()
        return seconds / lines

    return run


def main() -> bool:
    kernel, _ = ours()
    steps = [kernel.handle(SUBMIT)[0] for _ in range(EVENTS)]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        works: dict[str, tuple[Callable[[], object], int]] = {
            "journal, from records": (journaled(folder, steps), 0),
            f"bare lines, {GROUP:,} per write": (bare(folder, steps), 0),
        }
        figures = interleave(works, rounds=21)
    report = Report("Journal throughput", "wall time")
    for name, figure in figures.items():
        report.row(name, f"{figure.per_second:,.0f} lines/s")
    mine, floor = figures.values()
    report.target("times the floor", mine.median / floor.median, 3, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
