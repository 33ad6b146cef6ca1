"""`rise-engine check` of LabLinking as a whole process, compared with a Python that only imports the two libraries."""

from __future__ import annotations

import compileall
import statistics
import subprocess
import sys
import time
from pathlib import Path

from measure import Report

import rise_engine

SCENARIO = Path(__file__).parent.parent / "scenarios" / "lablinking"
ROUNDS = 15


def main() -> bool:
    # Compiled, as installed. In a checkout where Python may not write compiled files this would measure the compiler.
    compileall.compile_dir(Path(rise_engine.__file__).parent, quiet=1)
    commands = {
        "rise-engine check": [str(Path(sys.executable).parent / "rise-engine"), "check", str(SCENARIO)],
        "python -c 'import lxml.etree, msgspec'": [sys.executable, "-c", "import lxml.etree, msgspec"],
    }
    samples: dict[str, list[float]] = {name: [] for name in commands}
    for number in range(ROUNDS + 2):
        for name, command in commands.items():
            start = time.perf_counter()
            done = subprocess.run(command, capture_output=True, text=True)
            if number >= 2:
                samples[name].append(time.perf_counter() - start)
            assert done.returncode == 0, done.stdout + done.stderr
    check = statistics.median(samples["rise-engine check"])
    report = Report("Starting up", "wall time")
    for name, times in samples.items():
        report.row(name, f"{statistics.median(times) * 1000:.0f} ms")
    report.target("seconds of a check", check, 0.5, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
