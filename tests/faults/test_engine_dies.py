"""The engine is killed, again and again, at moments nobody chose (issue: "Proof, in tests")."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
KILLS = 250


@pytest.mark.soak
def test_nothing_that_was_acknowledged_is_lost_whenever_the_engine_is_killed() -> None:
    """Every acknowledged input is in the journal, every journal recovers, replay is identical. `./dev soak` goes on for
    thousands; the seed that is printed repeats a run as far as the system's scheduling lets it."""
    result = subprocess.run(
        [sys.executable, "-m", "tests.faults.soak", "--kills", str(KILLS)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    counts = dict(part.rsplit(" ", 1) for part in result.stdout.splitlines()[-1].rpartition(" in ")[0].split(", "))
    assert int(counts["kills"]) >= KILLS
    assert int(counts["recoveries"]) > KILLS / 4
    assert int(counts["acknowledged"]) > KILLS
