"""Tools of the benchmarks: interleaved rounds, CPU seconds, medians. Every figure is compared with a peer or floor."""

from __future__ import annotations

import gc
import statistics
import sys
import time
from collections.abc import Callable
from typing import NamedTuple


class Figure(NamedTuple):
    """Seconds of one operation: the median of the rounds, and the extremes."""

    median: float
    low: float
    high: float

    @property
    def per_second(self) -> float:
        return 1 / self.median


def cpu_seconds(work: Callable[[], object], operations: int) -> float:
    """Process CPU seconds per operation for one call of `work`, which does `operations` of them."""
    gc.collect()
    start = time.process_time()
    work()
    return (time.process_time() - start) / operations


def interleave(works: dict[str, tuple[Callable[[], object], int]], rounds: int = 7) -> dict[str, Figure]:
    """Measure several works in turn, round by round, so that a slow moment of the machine hits all of them.

    A work that measures itself (another process) has 0 operations and returns its seconds per operation.
    """
    samples: dict[str, list[float]] = {name: [] for name in works}
    for work, _ in works.values():
        work()  # warm up
    for _ in range(rounds):
        for name, (work, operations) in works.items():
            samples[name].append(cpu_seconds(work, operations) if operations else float(work()))  # type: ignore[arg-type]
    return {name: Figure(statistics.median(s), min(s), max(s)) for name, s in samples.items()}


class Report:
    """Prints rows of figures and remembers whether every target was met."""

    def __init__(self, title: str, measured: str = "CPU time") -> None:
        self.met = True
        version = ".".join(map(str, sys.version_info[:3]))
        print(f"\n{title}  (CPython {version}, {measured}, median of interleaved rounds)")

    def row(self, name: str, value: str, note: str = "") -> None:
        print(f"  {name:<44} {value:>18}  {note}".rstrip())

    def target(self, name: str, value: float, limit: float, *, at_least: bool) -> None:
        ok = value >= limit if at_least else value <= limit
        self.met &= ok
        sign = ">=" if at_least else "<="
        print(f"  {'ok  ' if ok else 'MISS'} {name:<39} {value:>18.2f}  wanted {sign} {limit:g}")
