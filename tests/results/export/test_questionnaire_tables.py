"""Questionnaires in tables, in BIDS, in bundles, and after a withdrawal."""

from __future__ import annotations

import csv
import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from rise_engine.privacy.levels import ExportLevel
from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.export.bids import write_bids
from rise_engine.results.export.format import ExportError
from rise_engine.results.export.tables import FORMAT
from rise_engine.results.export.trial_tables import answers_at_level, answers_text
from rise_engine.results.export.writing import export_context, export_sessions
from rise_engine.study.traces import find_names
from tests.results.analysis.samples import make_study, sessions_of

VALIDATOR = Path(sys.executable).with_name("bids-validator-deno")
TOML = """
[questionnaire.godspeed]
about = "Godspeed I"
file = "answers/godspeed.csv"
columns.q1 = { about = "Unfriendly to friendly", levels = { 1 = "unfriendly", 5 = "friendly" } }

[questionnaire.after]
file = "answers/after.csv"
key = "code"
run = "visit"
"""
GODSPEED = "participant,q1,why\nP01,5,He knew Maria\nP02,1,\nP04,1,never came\nP09,1,nobody\n"
AFTER = "code,visit,load\nP01,2,3.5\nP01,1,2\nP02,1,4\n"


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    study = make_study(tmp_path_factory.mktemp("lab") / "study")
    with (study / "study.toml").open("a") as file:
        file.write(TOML)
    (study / "answers").mkdir()
    (study / "answers" / "godspeed.csv").write_text(GODSPEED)
    (study / "answers" / "after.csv").write_text(AFTER)
    return study


@pytest.fixture
def study(made: Path, tmp_path: Path) -> Path:
    return shutil.copytree(made, tmp_path / "study")


def first_sessions(study: Path) -> list[Path]:
    """Those of P01 and P02."""
    return [each for each in sessions_of(study) if "_P01_" in each.name or "_P02_" in each.name]


def rows(file: Path, delimiter: str = ",") -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as opened:
        return list(csv.DictReader(opened, delimiter=delimiter))


def make_tables(study: Path, out: Path, level: ExportLevel = "full") -> list[str]:
    sessions = first_sessions(study)
    return export_sessions(FORMAT, out, sessions, export_context(sessions, level)).warnings


def test_answers_stand_beside_what_is_the_same_in_all_sessions_of_a_participant(study: Path, tmp_path: Path) -> None:
    warnings = make_tables(study, tmp_path / "out")
    first, second = rows(tmp_path / "out" / "questionnaire_godspeed.csv")
    assert (first["participant"], first["q1"], first["why"]) == ("P01", "5", "He knew Maria")
    assert (second["participant"], second["outcome"]) == ("P02", "complete")  # an attempt before was aborted
    assert first["factor_hesitation"] in ("yes", "no") and first["factor_noise"] == ""  # within: it differs
    assert list(first)[:3] == ["participant", "condition", "mode"]
    assert any("answers/godspeed.csv, line 5: left out" in each for each in warnings)
    assert any("line 4: left out, because there is no session of this participant" in each for each in warnings)
    assert any("after has no row for every run of P02" in each for each in warnings)


def test_answers_after_a_run_stand_beside_their_session(study: Path, tmp_path: Path) -> None:
    make_tables(study, tmp_path / "out")
    sessions = {(each["participant"], each["run"]): each for each in rows(tmp_path / "out" / "sessions.csv")}
    found = rows(tmp_path / "out" / "questionnaire_after.csv")
    assert [(each["participant"], each["run"], each["load"]) for each in found] == [
        ("P01", "2", "3.5"),
        ("P01", "1", "2"),
        ("P02", "1", "4"),
    ]
    for each in found:
        assert each["session"] == sessions[each["participant"], each["run"]]["session"]
        assert each["factor_noise"] == sessions[each["participant"], each["run"]]["factor_noise"]


@pytest.mark.parametrize("level", ["full", "shared"])
def test_frictionless_accepts_them(study: Path, tmp_path: Path, level: ExportLevel) -> None:
    frictionless = pytest.importorskip("frictionless")
    make_tables(study, tmp_path / "out", level)
    report = frictionless.Package(str(tmp_path / "out" / "datapackage.json")).validate()
    assert report.valid, [each.errors for each in report.tasks]
    package = json.loads((tmp_path / "out" / "datapackage.json").read_text())
    (table,) = [each for each in package["resources"] if each["name"] == "questionnaire_godspeed"]
    (field,) = [each for each in table["schema"]["fields"] if each["name"] == "q1"]
    assert field["levels"] == {"1": "unfriendly", "5": "friendly"} and field["type"] == "integer"
    assert "(Godspeed I)" in table["description"]


def test_below_full_what_people_typed_is_counted(study: Path, tmp_path: Path) -> None:
    make_tables(study, tmp_path / "out", "shared")
    assert [each["why"] for each in rows(tmp_path / "out" / "questionnaire_godspeed.csv")] == [
        "[free text, 3 words]",
        "",
    ]


def test_a_questionnaire_with_errors_is_not_exported(study: Path, tmp_path: Path) -> None:
    (study / "answers" / "after.csv").write_text(AFTER + "P01,1,9\n")
    with pytest.raises(ExportError, match=r"after.csv:5:1: .*`P01`, run 1, is in line 3 already"):
        make_tables(study, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_no_file_yet(study: Path, tmp_path: Path) -> None:
    (study / "answers" / "after.csv").unlink()
    assert any("questionnaire after is not in it" in each for each in make_tables(study, tmp_path / "out"))
    assert not (tmp_path / "out" / "questionnaire_after.csv").exists()


def test_bids_has_them_as_phenotypes(study: Path, tmp_path: Path) -> None:
    sessions = first_sessions(study)
    write_bids(tmp_path / "bids", read_sessions(sessions, level="shared"), export_context(sessions, "shared"))
    of_run = [rows(tmp_path / "bids" / "phenotype" / f"after_run{number}.tsv", "\t") for number in (1, 2)]
    assert of_run == [
        [{"participant_id": "sub-P01", "load": "2"}, {"participant_id": "sub-P02", "load": "4"}],
        [{"participant_id": "sub-P01", "load": "3.5"}],
    ]
    about = json.loads((tmp_path / "bids" / "phenotype" / "godspeed.json").read_text())
    assert about["MeasurementToolMetadata"] == {"Description": "Godspeed I"}
    assert about["q1"] == {"Description": "Unfriendly to friendly", "Levels": {"1": "unfriendly", "5": "friendly"}}
    assert next(iter(rows(tmp_path / "bids" / "phenotype" / "godspeed.tsv", "\t")[0])) == "participant_id"


@pytest.mark.skipif(not VALIDATOR.exists(), reason="bids-validator-deno is not installed here")
def test_the_validator_of_bids_accepts_phenotypes(study: Path, tmp_path: Path) -> None:
    sessions = first_sessions(study)[1:3]
    write_bids(tmp_path / "bids", read_sessions(sessions, level="shared"), export_context(sessions, "shared"))
    command = [VALIDATOR, "--json", "--max-rows", "-1", tmp_path / "bids"]
    said = json.loads(subprocess.run([str(each) for each in command], capture_output=True, text=True).stdout)
    assert [each for each in said["issues"]["issues"] if each["severity"] == "error"] == []


def test_what_a_bundle_has_of_them_gives_the_same_again(study: Path) -> None:
    sessions = first_sessions(study)
    context = export_context(sessions, "shared")
    facts = [each.facts for each in read_sessions(sessions, level="shared")]
    before = answers_at_level(context.study, "shared", facts, [])
    for each in before:
        (study / each.settings.file).write_text(answers_text(each))
    warnings: list[str] = []
    again = answers_at_level(context.study, "shared", facts, warnings)
    assert [each.rows for each in again] == [each.rows for each in before]
    assert "P04" not in (study / "answers" / "godspeed.csv").read_text()
    assert not any("left out" in each for each in warnings)


def test_a_withdrawal_names_the_lines_that_people_have_to_delete(study: Path) -> None:
    (found,) = [each for each in find_names(study, "P01") if each.startswith("answers/after.csv")]
    assert found.startswith("answers/after.csv, lines 2, 3: delete the line yourself")


def test_the_wide_form_has_the_answers_of_each_participant(study: Path, tmp_path: Path) -> None:
    sessions = first_sessions(study)
    context = export_context(sessions, "full")
    context.wide = True
    export_sessions(FORMAT, tmp_path / "out", sessions, context)
    first, second = rows(tmp_path / "out" / "wide.csv")
    named = ("participant", "godspeed.q1", "after.load.run1", "after.load.run2")
    assert [first[name] for name in named] == ["P01", "5", "2", "3.5"]
    assert [second[name] for name in named] == ["P02", "1", "4", ""]
