"""What study.toml says of columns and levels, in the files that describe the data."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rise_engine.results.analysis.reading import read_sessions
from rise_engine.results.export.format import load_format
from rise_engine.results.export.writing import export_context
from rise_engine.study.study_toml import load_study
from tests.results.analysis.samples import make_study, sessions_of

COLUMNS = '\n[participants]\ncolumns = { age = "Age in years", nars = "Sum of the NARS" }\n'
PEOPLE = "participant,consent_study,status,comment,age,nars\nP01,2026-11-01,,,91,12\n"


def described_study(folder: Path) -> Path:
    study = make_study(folder)
    toml = study / "study.toml"
    text = toml.read_text("utf-8")
    level = next(line for line in text.splitlines() if line.startswith("levels.") and ".memory" in line)
    name = level.partition(".memory")[0]
    said = f'{level}\n{name}.description = "The robot hesitates"'
    toml.write_text(text.replace(level, said, 1) + COLUMNS, "utf-8")
    (study / "participants.csv").write_text(PEOPLE, "utf-8")
    return study


def test_descriptions_change_nothing_that_sessions_depend_on(tmp_path: Path) -> None:
    before = load_study(make_study(tmp_path / "plain")).study
    after = load_study(described_study(tmp_path / "described")).study
    assert before is not None and after is not None
    assert (before.hash, before.design_hash) == (after.hash, after.design_hash)
    assert after.columns == ("age", "nars")


def test_they_are_in_datapackage_and_bids(tmp_path: Path) -> None:
    study = described_study(tmp_path / "study")
    folders = sessions_of(study)[1:2]
    for name in ("tables", "bids"):
        load_format(name).write(tmp_path / name, read_sessions(folders), export_context(folders, "full"))
    package = json.loads((tmp_path / "tables" / "datapackage.json").read_text("utf-8"))
    fields = {each["name"]: each for each in package["resources"][0]["schema"]["fields"]}
    levels = next(each["levels"] for name, each in fields.items() if name.startswith("factor_"))
    assert any(each.startswith("The robot hesitates") for each in levels.values())
    people = json.loads((tmp_path / "bids" / "participants.json").read_text("utf-8"))
    assert (people["age"]["Description"], people["nars"]["Description"]) == ("Age in years", "Sum of the NARS")
    (scans,) = (tmp_path / "bids").rglob("*_scans.json")
    assert "The robot hesitates" in scans.read_text("utf-8")


@pytest.mark.parametrize(
    ("written", "told"),
    [
        ("[participants]\ncolumns = { age = 7 }\n", "`age` is"),
        ('[participants]\ncolumns = { email = "x" }\n', "seems to hold"),
        ('[participants]\ncolumns = { status = "x" }\n', "has a column `status` already"),
        ('[report]\nauthors = "Doe, J. (0000-0002-1825-0098)"\n', "is not an ORCID: its last digit"),
        ('[report]\nauthors = "Doe, J. (12)"\n', "is not an ORCID: it has four groups"),
    ],
)
def test_what_cannot_be_meant(tmp_path: Path, written: str, told: str) -> None:
    study = make_study(tmp_path / "study")
    with (study / "study.toml").open("a", encoding="utf-8") as file:
        file.write(f"\n{written}")
    errors = [str(each) for each in load_study(study).errors]
    assert any(told in each for each in errors), errors
