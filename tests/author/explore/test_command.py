"""`rise-engine explore` and `check --deep`, as somebody types them."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from tests.commands import typed

QUIZ = Path(__file__).parent / "studies" / "quiz"
QUICK = ("--no-stop", "--no-lost", "--cores", "1")


def test_a_problem_is_shown_with_its_way() -> None:
    result = typed("explore", QUIZ, *QUICK, "--show", "1", "--keys")
    assert result.exit_code == 1
    assert "PROBLEM: Praise can get stuck in Praise" in result.output
    assert "1. the wizard presses b (begin)" in result.output
    assert "x: it does something there" in result.output
    assert "1 problem, 6 warnings, 4 remarks" in result.output


def test_as_json() -> None:
    found = json.loads(typed("explore", QUIZ, *QUICK, "--json").stdout)
    assert found["complete"]
    assert found["findings"][0]["kind"] == "dead-end"
    assert found["findings"][0]["file"] == "rules/quiz.xml"


@pytest.mark.slow
def test_the_ways_are_task_files_that_play(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RISE_SESSIONS", str(tmp_path / "sessions"))
    ways = tmp_path / "ways"
    assert typed("explore", QUIZ, *QUICK, "--write", ways).exit_code == 1
    files = sorted(ways.iterdir())
    assert files[0].name == "01-dead-end.jsonl"
    for file in files:
        assert "Perhaps" not in file.read_text()
        played = typed("run", QUIZ, "--tasks", file, "--speed", "max")
        assert played.exit_code == 0, played.output
    played = typed("run", QUIZ, "--tasks", files[0], "--speed", "max")
    assert "stays in Praised on /W_next" in played.output
    assert "never ends" not in played.output


def test_a_folder_that_is_not_empty_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "kept.txt").write_text("mine")
    result = typed("explore", QUIZ, *QUICK, "--write", tmp_path)
    assert result.exit_code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["kept.txt"]


@pytest.mark.parametrize("pace", ["fast", "3-1", "0-2", "1"])
def test_a_pace_that_is_none(pace: str) -> None:
    result = typed("explore", QUIZ, "--pace", pace)
    assert result.exit_code == 2
    assert "--pace is two numbers such as 0.5-3, or `any`" in result.output


def test_the_check_looks_deeper() -> None:
    result = typed("check", QUIZ, "--deep")
    assert result.exit_code == 1
    assert "rules/quiz.xml:75:3: problem dead-end: Praise can get stuck" in result.output
    assert typed("check", QUIZ).exit_code == 0


def test_a_scenario_with_errors_is_not_explored(tmp_path: Path) -> None:
    study = tmp_path / "quiz"
    shutil.copytree(QUIZ, study)
    (study / "rules" / "quiz.xml").write_text("<InteractionRule")
    for command in (("explore", str(study)), ("check", str(study), "--deep")):
        result = typed(*command)
        assert result.exit_code == 1
        assert "ooked at" not in result.output
