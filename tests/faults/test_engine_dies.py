"""The engine is killed, again and again, in the middle of whatever it does (issue: "Proof, in tests")."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
KILLS = 12


@pytest.mark.slow
def test_nothing_that_was_acknowledged_is_lost_whenever_the_engine_is_killed() -> None:
    """Every acknowledged input is in the journal, every journal recovers, replay is identical. `./dev soak` goes on for
    thousands, with other tasks at other moments."""
    result = subprocess.run(
        [sys.executable, "-m", "tests.faults.soak", "--kills", str(KILLS), "--seed", "1"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    counts = dict(part.rsplit(" ", 1) for part in result.stdout.splitlines()[-1].rpartition(" in ")[0].split(", "))
    assert int(counts["kills"]) >= KILLS and int(counts["recoveries"]) > 0 and int(counts["acknowledged"]) > 0
