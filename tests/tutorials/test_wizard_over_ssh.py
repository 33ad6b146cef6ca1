"""docs/tutorials/wizard-over-ssh.md, followed key by key: the session outlives the window, and its record is whole."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.scenarios.played import process
from tests.tutorials.player import play
from tests.tutorials.shell import shell

pytestmark = [pytest.mark.slow, pytest.mark.pty]
PAGE = Path(__file__).parents[2] / "docs" / "tutorials" / "wizard-over-ssh.md"


def test_the_session_goes_on_without_its_window(tmp_path: Path) -> None:
    with shell(tmp_path) as terminal:
        play(PAGE.read_text(encoding="utf-8"), terminal)
        assert terminal.engines() == []
    (folder,) = (tmp_path / "home" / "rise-sessions").iterdir()
    exported = process(["export", str(folder), "--format", "jsonl"])
    assert exported.returncode == 0, exported.stderr.decode()
    records = [json.loads(line) for line in exported.stdout.splitlines()]

    control = [each for each in records if each["kind"] == "control"]
    assert [(each["status"], each["by"]) for each in control[:3]] == [
        ("taken", "wizard:anna"),
        ("released", "wizard:anna"),
        ("taken", "wizard:anna"),
    ]
    lost, back = control[1]["t"], control[2]["t"]
    welcome = [each for each in records if each["kind"] == "task" and each["behavior"] == "R_Welcome"]
    assert welcome[0]["t"] < lost < back
    assert [each["status"] for each in welcome] == ["PENDING", "ACTIVE", "SUCCEEDED"]  # once, and to its end
    assert [each["seq"] for each in records] == list(range(1, len(records) + 1))
    assert (records[-1]["kind"], records[-1]["status"]) == ("session", "ended")
    assert (tmp_path / "lab" / "P07.html").stat().st_size > 0
