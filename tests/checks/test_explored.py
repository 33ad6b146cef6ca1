"""The check that a scenario was explored: once for each, and anew when it has changed."""

from __future__ import annotations

import shutil
from pathlib import Path

import msgspec
import pytest

from rise_engine.checks import run_check
from rise_engine.checks.explored import KEPT, look_at_explored, read_kept
from rise_engine.study.model import StudyCheck
from tests.checks.samples import context, study

ROOT = Path(__file__).parents[2]
QUIZ = ROOT / "tests" / "explore" / "studies" / "quiz"


@pytest.fixture
def scenario(tmp_path: Path) -> Path:
    return Path(shutil.copytree(QUIZ, tmp_path / "scenario"))


def repair(scenario: Path) -> None:
    """*Praise* also goes on when it is stopped."""
    rules = scenario / "rules" / "quiz.xml"
    text = rules.read_text()
    ways = text.replace('eventTopic="/R_Praise_failed"', 'eventTopic="/R_Praise_end"')
    assert ways != text
    rules.write_text(ways)


@pytest.mark.slow
async def test_a_scenario_that_gets_stuck_fails_and_one_that_is_repaired_passes(tmp_path: Path, scenario: Path) -> None:
    check, of = StudyCheck("explored", auto="explored"), context(study(tmp_path), mode="debug")
    outcome = await run_check(check, of)
    assert outcome.result == "failed"
    assert outcome.reason.startswith("Praise can get stuck in Praise")
    repair(scenario)
    outcome = await run_check(check, of)
    assert outcome.result == "passed", outcome
    assert outcome.value.startswith("the scenario has changed since it was explored on ")
    assert outcome.value.endswith("none with a problem")


def test_the_same_scenario_is_looked_at_once(tmp_path: Path, scenario: Path) -> None:
    repair(scenario)
    assert look_at_explored(tmp_path, str(scenario), None, "debug").passed
    kept = read_kept(tmp_path)
    assert kept is not None
    (tmp_path / KEPT).write_bytes(msgspec.json.encode(msgspec.structs.replace(kept, situations=7)))
    assert (
        look_at_explored(tmp_path, str(scenario), None, "debug").value == "looked at 7 situations, none with a problem"
    )


def test_what_cannot_be_read_is_looked_at_anew(tmp_path: Path, scenario: Path) -> None:
    (tmp_path / KEPT).write_text("{")
    assert not look_at_explored(tmp_path, str(scenario), None, "debug").passed
    kept = read_kept(tmp_path)
    assert kept is not None
    assert kept.problems


def test_a_scenario_with_errors_has_not_passed(tmp_path: Path, scenario: Path) -> None:
    (scenario / "rules" / "quiz.xml").write_text("<InteractionRule")
    assert "has errors" in look_at_explored(tmp_path, str(scenario), None, "debug").reason
