"""`rise-engine report`: what is printed, which files are written, and how it ends."""

from __future__ import annotations

import json
import shutil
import stat
from pathlib import Path

import pytest
from click.testing import Result

from rise_engine.study.withdrawal import withdraw
from tests.commands import typed
from tests.results.analysis.samples import make_study, play_session, sessions_of, torn_session
from tests.results.report.test_page import assert_harmless


def report(*arguments: str | Path) -> Result:
    return typed("report", *arguments)


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return play_session(tmp_path_factory.mktemp("report") / "sessions")


def exported(study: Path) -> list[dict[str, object]]:
    lines = (study / "study.jsonl").read_text("utf-8").splitlines()
    return [entry for entry in map(json.loads, lines) if entry["kind"] == "exported"]


def test_a_session_as_text(session):
    found = report(session)
    assert (found.exit_code, found.stderr) == (0, "")
    assert found.stdout.startswith("SESSION REPORT\nP01\n")
    assert max(map(len, found.stdout.splitlines())) <= 80
    assert "identical: " in found.stdout


def test_a_session_by_its_name(session, monkeypatch):
    monkeypatch.setenv("RISE_SESSIONS", str(session.parent))
    assert report(session.name).stdout == report(session).stdout


def test_a_page_is_written_once_for_its_owner_alone(session, tmp_path):
    out = tmp_path / "p01.html"
    found = report(session, "-o", out)
    assert (found.exit_code, found.stdout) == (0, "")
    assert f"the report is in {out}" in found.stderr
    assert stat.S_IMODE(out.stat().st_mode) == 0o600
    page = out.read_text("utf-8")
    assert_harmless(page)
    again = report(session, "-o", out)
    assert again.exit_code == 2 and "is there already" in again.stderr
    assert out.read_text("utf-8") == page
    assert report(session, "-o", tmp_path / "none" / "x.html").exit_code == 2
    assert [path.name for path in tmp_path.iterdir()] == ["p01.html"]


def test_a_study_its_page_and_its_sheet_and_what_the_study_knows_of_them(tmp_path):
    study = make_study(tmp_path / "study")
    page, sheet = study / "report.html", tmp_path / "sheet.md"
    found = report(study / "study.toml", "-o", page, "--sheet", sheet, "--level", "shared")
    assert found.exit_code == 0, found.output
    assert page.exists() and sheet.read_text("utf-8").startswith("# Hesitation: reporting sheet")
    noted = exported(study)
    assert [entry["path"] for entry in noted] == ["report.html", str(sheet)]
    assert {entry["level"] for entry in noted} == {"shared"}
    assert noted[0]["participants"] == ["P01", "P02", "P03"]
    assert len(noted[0]["sessions"]) == len(sessions_of(study))  # type: ignore[arg-type]


def test_both_files_or_none(tmp_path):
    study = make_study(tmp_path / "study")
    (tmp_path / "sheet.md").write_text("mine")
    found = report(study, "-o", tmp_path / "report.html", "--sheet", tmp_path / "sheet.md")
    assert found.exit_code == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["sheet.md", "study"]


def test_a_report_of_somebody_who_withdraws_is_erased_and_the_next_one_does_not_know_them(tmp_path):
    study = make_study(tmp_path / "study")
    assert report(study, "-o", study / "report.html").exit_code == 0
    theirs = next(folder for folder in sessions_of(study) if "_P02_" in folder.name)
    shutil.copytree(theirs, tmp_path / theirs.name)
    withdraw(study, "P02")
    assert not (study / "report.html").exists()
    found = report(study)
    assert found.exit_code in (0, 1) and "P02" not in found.stdout
    assert "Withdrawn                           1" in found.stdout
    shutil.copytree(tmp_path / theirs.name, theirs)  # a backup brings it back
    found = report(theirs)
    assert found.exit_code == 2 and "withdrawn" in found.stderr and found.stdout == ""
    assert "P02" not in report(study).stdout


def test_what_cannot_be_read_is_said_and_the_rest_is_told(tmp_path):
    found = report(torn_session(tmp_path / "sessions"))
    assert found.exit_code == 1
    assert "warning: " in found.stderr and "torn" in found.stderr
    assert "Latency" in found.stdout
    study = make_study(tmp_path / "study")
    journal = sessions_of(study)[2] / "journal.jsonl"
    lines = journal.read_bytes().splitlines(keepends=True)
    journal.write_bytes(b"".join([*lines[:30], b"nothing that can be read\n", *lines[31:]]))
    found = report(study)
    assert found.exit_code == 1 and "STUDY REPORT" in found.stdout
    assert f"warning: {journal.parent.name}: journal.jsonl: line 31 cannot be read" in found.stderr


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["{nowhere}"], "there is no folder"),
        (["{session}", "--sheet", "x.md"], "--sheet is for a study"),
        (["{session}", "--conditions"], "--conditions is for a study"),
        (["{session}", "--level", "everything"], "is not one of"),
        ([], "Missing argument"),
    ],
)
def test_what_cannot_be_meant(session, tmp_path, arguments, said):
    given = [each.format(session=session, nowhere=tmp_path / "no" / "where") for each in arguments]
    found = report(*given)
    assert found.exit_code == 2
    assert said in found.stderr.replace("\n", " ")


def test_a_study_that_does_not_load_says_everything_that_is_wrong(tmp_path):
    study = make_study(tmp_path / "study")
    (study / "study.toml").write_text('title = "x"\nplaec = "y"\n[report]\nplaec = "Bielefeld"\nlimits = 3\n', "utf-8")
    found = report(study)
    assert found.exit_code == 2
    assert "unknown key `plaec`; did you mean `place`?" in found.stderr
    assert '`limits` is a text: limits = "..."' in found.stderr
    assert "`id` is missing" in found.stderr
