"""Plays random studies to the kernel and to the interpreter that is written from the text, on all cores.

    python -m tests.reference --studies 20000      (./dev soak)
    python -m tests.reference --study 4711         (one of them, as a failure names it)

Study n is the same every time; `--seed` says with which one to begin. A study in which they differ is cut down to the
fewest moves that still show it, and printed.
"""

from __future__ import annotations

import argparse
import os
import random
import sys
import time
from concurrent.futures import ProcessPoolExecutor

from .comparison import difference, shortest_difference

STUDIES = 20_000


def main() -> int:
    """Run; gives the exit status."""
    parser = argparse.ArgumentParser(
        prog="./dev soak", description="Compare the kernel with docs/explanation/semantics.md"
    )
    parser.add_argument("--studies", type=int, default=STUDIES, metavar="N", help="how many (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=None, metavar="N", help="the first one's number (default: any)")
    parser.add_argument("--study", type=int, default=None, metavar="N", help="only this one")
    given = parser.parse_args()
    if given.study is not None:
        found = shortest_difference(given.study)
        print(found or "no difference")
        return 1 if found else 0
    first = random.SystemRandom().randrange(10**9) if given.seed is None else given.seed
    print(f"{given.studies:,} random studies from --seed {first}", flush=True)
    begun, wrong = time.monotonic(), []
    studies = range(first, first + given.studies)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for study, found in zip(studies, pool.map(difference, studies, chunksize=50), strict=True):
            if found:
                wrong.append(study)
                print(f"\n{shortest_difference(study)}" if len(wrong) <= 3 else f"study {study} too", flush=True)
    print(f"{len(wrong)} of {given.studies:,} differ; {time.monotonic() - begun:.0f} s")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
