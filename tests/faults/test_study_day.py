"""Whatever is killed on a day with participants, no slot is taken twice and none is lost (issue: "Proof")."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.forked import run_engine

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_a_handful_of_kills() -> None:
    """`./dev soak --days` goes on for hundreds, at other moments."""
    result = run_engine(
        "--kills", "5", "--seed", "3", "--exports", "0.6", module="tests.faults.study_day", cwd=ROOT, timeout=None
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert "kills 5," in result.stdout, result.stdout
