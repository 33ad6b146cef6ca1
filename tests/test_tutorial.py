"""docs/tutorials/first-study.md works as written: its files are checked and its session is played."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.scenarios.played import Played, process

pytestmark = pytest.mark.slow

TUTORIAL = Path(__file__).parents[1] / "docs" / "tutorials" / "first-study.md"
FILES = re.compile(r"^\*\*`my-study/(?P<path>[\w./-]+)`\*\*\n\n```\w+\n(?P<content>.*?)^```$", re.MULTILINE | re.DOTALL)


def write_study(folder: Path, until: str = "") -> None:
    for match in FILES.finditer(TUTORIAL.read_text(encoding="utf-8")):
        file = folder / match["path"]
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(match["content"], encoding="utf-8")
        if match["path"] == until:
            return


def test_the_steps_have_the_findings_that_the_tutorial_says(tmp_path: Path) -> None:
    assert process(["check", str(tmp_path)]).returncode == 0

    write_study(tmp_path, until="rules/session.xml")
    before_keys = process(["check", str(tmp_path)])
    assert before_keys.returncode == 0
    assert b"answered" in before_keys.stdout
    assert b"again" in before_keys.stdout
    assert b"0 errors, 2 warnings" in before_keys.stdout

    write_study(tmp_path)
    complete = process(["check", str(tmp_path)])
    assert (complete.returncode, b"no errors or warnings" in complete.stdout) == (0, True), complete.stdout.decode()

    rule = tmp_path / "rules" / "session.xml"
    rule.write_text(rule.read_text(encoding="utf-8").replace("R_Hello", "R_Helo", 1), encoding="utf-8")
    mistaken = process(["check", str(tmp_path)])
    assert mistaken.returncode == 1
    assert re.search(rb"^rules/session.xml:5:\d+: error .*R_Hello", mistaken.stdout, re.MULTILINE)


def test_the_session_runs_as_the_tutorial_says(tmp_path: Path) -> None:
    write_study(tmp_path)
    tasks = ["--tasks", str(tmp_path / "session.jsonl")]
    result = process(["run", str(tmp_path), *tasks, "--speed", "max", "--json", "--strict"])
    assert result.returncode == 0, result.stderr.decode()
    session = Played(result.stdout)
    session.check_sound()
    assert session.said() == [
        "Hello, nice to see you! How do you feel today?",
        "You feel tired. Thank you for telling me.",
    ]
    assert session.states("Session") == ["Ask", "Wait for the wizard", "React", "Done"]
