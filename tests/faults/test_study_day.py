"""Whatever is killed on a day with participants, no slot is taken twice and none is lost (issue: "Proof")."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def kill(number: int) -> dict[str, int]:
    """What was done until so many were killed."""
    result = subprocess.run(
        [sys.executable, "-m", "tests.faults.study_day", "--kills", str(number)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=600,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    parts = result.stdout.splitlines()[-1].rpartition(" in ")[0].split(", ")
    return {name: int(count) for name, count in (part.rsplit(" ", 1) for part in parts)}


@pytest.mark.slow
def test_a_handful_of_kills() -> None:
    assert kill(8)["kills"] == 8


@pytest.mark.soak
def test_a_hundred_kills_while_sessions_start_run_end_and_are_judged() -> None:
    counts = kill(100)
    assert counts["kills"] == 100
    assert counts["killed while it starts"] > 10 and counts["killed while it ends"] > 5
