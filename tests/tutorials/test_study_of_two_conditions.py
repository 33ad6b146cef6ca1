"""docs/tutorials/study-of-two-conditions.md, followed key by key: its study, its sessions and its tables are there."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from tests.tutorials.player import play
from tests.tutorials.shell import shell

pytestmark = [pytest.mark.slow, pytest.mark.pty]
PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "study-of-two-conditions.md"


def rows(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def test_the_study_is_made_run_and_read(tmp_path: Path) -> None:
    pytest.importorskip("pandas")
    with shell(tmp_path) as terminal:
        play(PAGE.read_text(encoding="utf-8"), terminal)
    work = tmp_path / "lab"
    sessions = rows(work / "tables" / "sessions.csv")
    assert [(each["participant"], each["condition"], each["outcome"], each["purpose"]) for each in sessions] == [
        ("P01", "negation", "complete", "counted"),
        ("P02", "plain", "complete", "counted"),
    ]
    states = [(each["participant"], each["state"]) for each in rows(work / "tables" / "phases.csv")]
    assert states[:5] == [("P01", state) for state in ("Start", "Welcome", "Instruct", "Wait", "Correct")]
    assert ("P02", "Praise") in states and ("P02", "Correct") not in states
    acts = rows(work / "tables" / "acts.csv")
    negated = {(each["participant"], " not" in each["text"].lower()) for each in acts if each["act"] == "R_Instruct"}
    assert negated == {("P01", True), ("P02", False)}
    assert [each["text"] for each in acts if each["act"] == "R_Welcome"] == ["", ""]
    checks = {(each["check"], each["result"]) for each in rows(work / "tables" / "checks.csv")}
    assert checks == {(name, "passed") for name in ("disk", "scenario", "wizard", "tablet-on", "participant-debriefed")}
    assert (work / "rooms.html").stat().st_size > 0
