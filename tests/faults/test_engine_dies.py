"""The engine is killed, again and again, in the middle of whatever it does (issue: "Proof, in tests")."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.forked import run_engine

ROOT = Path(__file__).parents[2]
KILLS = 12


@pytest.mark.slow
def test_nothing_that_was_acknowledged_is_lost_whenever_the_engine_is_killed() -> None:
    """Every acknowledged input is in the journal, every journal recovers, replay is identical. `./dev soak` goes on for
    thousands, with other tasks at other moments."""
    result = run_engine("--kills", KILLS, "--seed", "1", module="tests.faults.soak", cwd=ROOT, timeout=None)
    assert result.returncode == 0, result.stdout + result.stderr
    counts = dict(part.rsplit(" ", 1) for part in result.stdout.splitlines()[-1].rpartition(" in ")[0].split(", "))
    assert int(counts["kills"]) >= KILLS and int(counts["recoveries"]) > 0 and int(counts["acknowledged"]) > 0
