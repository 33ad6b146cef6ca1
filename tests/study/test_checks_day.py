"""A day with checks, as processes: refused with all that is missing, then served, judged, and confirmed afterwards."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from click.testing import Result

from rise_engine.study.study_log import read_log
from tests.checks.samples import real_study, script
from tests.cli.processes import Live, engine
from tests.commands import typed

pytestmark = pytest.mark.slow

CHECKS = """
[[check]]
id = "lamp"
ask = "The lamp is on"
[[check]]
id = "agreed"
auto = "consent"
[[check]]
id = "robot"
auto = "robot"
[[check]]
id = "tracker"
run = ["./tracker.sh"]
every = "30 d"
[[check]]
id = "again"
auto = "replay"
[[check]]
id = "debrief"
ask = "Participant was debriefed"
when = "after"
"""
CONFIRMED = ("--confirm", "lamp", "--skip-check", "robot=the real one is being mended")


@pytest.fixture
def lab(tmp_path: Path) -> Path:
    """A study in real mode whose robot is only simulated, and a program that counts how often it was asked."""
    script(tmp_path, "tracker.sh", 'echo "for $RISE_PARTICIPANT" >> asked', "echo 0.4 degrees")
    real_study(tmp_path, CHECKS)
    return tmp_path


def serve(lab: Path, participant: str, *arguments: str) -> str:
    """Serve a session, end it; what it said."""
    with Live("serve", "--study", lab, "--participant", participant, "--wizard", "anna", *arguments) as live:
        assert live.process.stderr is not None
        said: list[str] = []
        for line in live.process.stderr:
            said.append(line)
            if line.startswith("serving "):
                live.process.terminate()
        assert live.process.wait(60) == 0, "".join(said)
    return "".join(said)


def journal(lab: Path) -> list[dict[str, Any]]:
    """The inputs of the last session."""
    folder = max((lab / "sessions").iterdir())
    lines = map(json.loads, (folder / "journal.jsonl").read_text().splitlines())
    return [line for line in lines if "input" in line]


def judge(lab: Path, *arguments: str) -> Result:
    return typed("study", "outcome", lab, *arguments)


def due(lab: Path) -> str:
    return typed("study", "status", lab).output


def test_a_day(lab: Path) -> None:
    refused = engine("serve", "--study", lab, "--participant", "P01")
    assert refused.returncode == 1
    assert refused.stderr.splitlines()[-5:] == [
        "error: lamp: not confirmed: “The lamp is on”",
        "error: robot: the robot generic is only simulated, and the mode is real: no robot would move; name the real "
        "one (`robot` in study.toml or scenario.toml)",
        "when it is true, use --confirm lamp",
        "to skip what you cannot fix now, use --skip-check robot=REASON",
        "nothing was started",
    ]
    assert not (lab / "sessions").exists() or not list((lab / "sessions").iterdir())

    said = serve(lab, "P01", *CONFIRMED)
    assert "ok       tracker: good since " in said and "ok       again: there is no earlier session" in said
    assert (lab / "asked").read_text() == "for P01\n"  # before the session that was refused, and still good
    inputs = journal(lab)
    checks = [each for each in inputs if each["input"] == "check"]
    first_of_others = next(
        n for n, each in enumerate(inputs) if each["input"] not in ("session_started", "robot", "check")
    )
    assert inputs.index(checks[-1]) < first_of_others
    assert [(each["id"], each["result"], each["source"]) for each in checks] == [
        ("lamp", "passed", "wizard:anna"),
        ("agreed", "passed", "engine"),
        ("robot", "skipped", "wizard:anna"),
        ("tracker", "passed", "engine"),
        ("again", "passed", "engine"),
    ]
    assert checks[2]["reason"] == "the real one is being mended"

    assert "P01, run 1: not confirmed: “Participant was debriefed” (check debrief)" in due(lab)
    assert judge(lab, "P01", "complete", "--confirm", "debreif").exit_code == 1
    judged = judge(lab, "P01", "complete")
    assert judged.exit_code == 0 and "not confirmed: “Participant was debriefed”" in judged.output
    assert "Participant was debriefed" in due(lab)
    later = judge(lab, "P01", "complete", "--confirm", "debrief")
    assert later.exit_code == 0 and "not confirmed" not in due(lab)
    checked = [(each.get("id"), each.get("result")) for each in read_log(lab) if each.kind == "checked"]
    assert checked.count(("robot", "failed")) == 1 and checked.count(("tracker", "passed")) == 1
    assert checked[-1] == ("debrief", "passed")


def test_whoever_has_not_consented_does_not_begin_whatever_is_said(lab: Path) -> None:
    for more in ((), ("--skip-check", "agreed=she said yes")):
        refused = engine("serve", "--study", lab, "--participant", "P03", *CONFIRMED, *more)
        assert refused.returncode == 1 and "consent" in refused.stderr
    assert not [each for each in read_log(lab) if each.kind in ("taken", "session")]


def test_options_of_checks_go_with_a_study(lab: Path) -> None:
    refused = engine("serve", lab / "scenario", "--confirm", "lamp")
    assert refused.returncode == 2 and "--skip-check go with --study" in refused.stderr
