"""What `study check` says of a study.jsonl that contradicts the sessions, or that nobody reads."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rise_engine.study.study_log import LOG_FILE
from tests.commands import typed
from tests.results.analysis.samples import PEOPLE, make_study, sessions_of


@pytest.fixture
def study(tmp_path: Path) -> Path:
    study = make_study(tmp_path / "study")
    (study / "participants.csv").write_text(PEOPLE.replace("2026-", "2024-"), "utf-8")
    return study


def check(study: Path) -> tuple[int, str]:
    result = typed("study", "check", study)
    return result.exit_code, result.output


def edit(study: Path, pattern: str, new: str, file: str = LOG_FILE) -> None:
    text, changed = re.subn(pattern, new, (study / file).read_text("utf-8"), count=1, flags=re.MULTILINE)
    assert changed, pattern
    (study / file).write_text(text, "utf-8")


def test_a_study_as_it_was_run_contradicts_nothing(study: Path) -> None:
    status, said = check(study)
    assert status == 0
    assert not re.findall(r"^(?:study\.jsonl|participants\.csv|sessions/.*):\d+:\d+: .*", said, re.MULTILINE)
    assert "debug-mode" not in said


EDITS = [
    (
        LOG_FILE,
        r'("kind":"taken".*"participant":)"P01"',
        r'\1"P04"',
        r"study.jsonl:\d+:1: error other-holder: it says that P04 took slot 1, but .*P01.*, the session of P01, began "
        r"in slot 1 \(line \d+\), which P01 had not taken",
    ),
    (
        LOG_FILE,
        '("kind":"taken".*)"slot":1,"participant":"P01"',
        r'\1"slot":6,"participant":"P01"',
        r"study.jsonl:\d+:1: error other-holder: it says that P01 took slot 6, but .*P01.*, the session of P01, began "
        r"in slot 1 \(line \d+\), which P01 had not taken",
    ),
    (
        LOG_FILE,
        '"kind":"outcome"',
        '"kind":"outcom"',
        r"study.jsonl:\d+:1: error unknown-kind: `outcom` is not a kind of entry, .*; did you mean `outcome`\?",
    ),
    (
        LOG_FILE,
        '"kind":"outcome"',
        '"kind":"weather"',
        r"study.jsonl:\d+:1: warning unknown-kind: `weather` is not a kind of entry, .*; a newer version may have",
    ),
    (
        LOG_FILE,
        '"seconds":120.0',
        '"seconds":12.0',
        r"study.jsonl:\d+:1: warning other-result: it says 12.000 s, but journal.jsonl of .* ends at 120.000 s",
    ),
    (
        LOG_FILE,
        r'("kind":"session",.*P01.*"purpose":"counted".*)}$',
        r'\1,"checks":[{"id":"lamp","result":"failed"},{"id":"unknown","result":"failed"}]}',
        r"study.jsonl:\d+:1: warning other-result: it says that the check lamp failed before .*, but its journal.jsonl "
        r"says passed",
    ),
    (
        "study.toml",
        '^mode = "real"',
        'mode = "debug"',
        r'study.toml:1:1: warning debug-mode: mode is "debug", but 7 sessions with the robot counted',
    ),
    (
        "participants.csv",
        "P01,2024-11-01",
        "P01,2024-12-24",
        r"participants.csv:2:1: warning late-consent: `P01` has consented on 2024-12-24 \(consent_study\), and their "
        r"first session was on 2024-11-23",
    ),
]


@pytest.mark.parametrize(("file", "pattern", "new", "told"), EDITS)
def test_what_an_edit_contradicts_is_told(study: Path, file: str, pattern: str, new: str, told: str) -> None:
    edit(study, pattern, new, file)
    status, said = check(study)
    (line,) = (line for line in said.splitlines() if re.match(told, line))
    assert status == int(" error " in line)


def test_a_participant_who_withdrew_and_one_whose_session_was_reassigned_are_no_contradiction(study: Path) -> None:
    """Also where the row of the plan stayed with its holder."""
    name = next(each.name for each in sessions_of(study) if "P02" in each.name)
    for owner in ("P03", "P04"):
        typed("study", "reassign", study, name, owner, "--reason", f"{owner} sat there")
        assert "other-holder" not in check(study)[1]
    typed("study", "withdraw", study, "P02", "--yes")
    assert "other-holder" not in check(study)[1]
