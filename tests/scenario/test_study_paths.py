"""The gate: no name of somebody else leads out of a study, to be written or to be read, and none is hidden."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import msgspec
import pytest

from rise_engine.author.edit.edits import AddAct, AddRule, AnyEdit, ReplaceFile, SetSetting
from rise_engine.author.edit.plan import EditRefused
from rise_engine.author.edit.study_folder import finish_interrupted, read_study_files, write_files
from rise_engine.author.edit.workspace import Workspace
from rise_engine.base.errors import StudyError
from rise_engine.scenario.files.study_paths import why_not_read, why_not_written
from rise_engine.scenario.files.tree import NEW_SUFFIX, NOTE, SavedFile, sum_of
from rise_engine.scenario.loader import load
from rise_engine.scenario.shipped_studies import write_new_folder
from rise_engine.study.study_toml import load_study
from tests.commands import typed
from tests.study.studies import write_study

SCENARIOS = Path(__file__).parents[2] / "scenarios"
NAMES = {
    "": "names no file",
    ".": "names no file",
    "/abs/x.toml": "leads out of",
    "Sessions/x.json": "is in `Sessions`",
    "package.json": "other programs take instructions",
    "../x.toml": "leads out of",
    "acts/../../x.toml": "leads out of",
    "acts/..": "leads out of",
    ".git/config": "`.git` begins with a dot",
    "acts/.git/hooks/post-checkout": "`.git` begins with a dot",
    ".vscode/tasks.json": "`.vscode` begins with a dot",
    ".envrc": "`.envrc` begins with a dot",
    "acts/.hidden.xml": "`.hidden.xml` begins with a dot",
    "acts\\..\\x.toml": "a character that is not allowed in names",
    "acts/a\0.xml": "a character that is not allowed in names",
    "acts/a\n.xml": "a character that is not allowed in names",
    "run.sh": "it has to end in .xml, .toml",
    "acts": "it has to end in",
    "Makefile": "it has to end in",
    "sessions/p01/session.toml": "with recorded data",
    "linked/x.toml": "leads out of the study's folder through a link, to ",
    "acts/linked.xml": "leads out of the study's folder through a link, to ",
    "hidden/config.toml": "is a link, and `.git/config.toml` is hidden",
    "acts/program.xml": "is a link, and `run.sh` is not a name for this file",
}
"""Names that nobody may write, and what is said of each."""


@pytest.fixture
def study(tmp_path: Path) -> Path:
    """A study with links out of it, and into what is hidden in it."""
    folder = tmp_path / "study"
    shutil.copytree(SCENARIOS / "greeting", folder)
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "file.xml").write_text("<Dialogs/>")
    (folder / ".git").mkdir()
    (folder / "run.sh").write_text("true")
    (folder / "linked").symlink_to(outside)
    (folder / "hidden").symlink_to(".git")
    (folder / "acts" / "linked.xml").symlink_to(outside / "file.xml")
    (folder / "acts" / "program.xml").symlink_to(folder / "run.sh")
    return folder


def everything(folder: Path) -> dict[str, bytes]:
    return {str(path): path.read_bytes() for path in sorted(folder.parent.rglob("*")) if path.is_file()}


@pytest.mark.parametrize("name", NAMES)
def test_what_nobody_may_write(study: Path, name: str) -> None:
    assert NAMES[name] in why_not_written(study, name)
    edit = ReplaceFile(name, "x = 1")
    with pytest.raises(EditRefused):
        write_files(study, {}, {name: b"x"})
    workspace = Workspace(study)
    before = everything(study)
    (outlook,) = workspace.preview_edits(edit)[2]
    assert NAMES[name] in outlook.why
    workspace.close()
    assert everything(study) == before


@pytest.mark.parametrize(
    "name", ["acts/new.xml", "./acts//new.xml", "new/deep/x.csv", "AGENTS.md", "ünï.md", "a b.TOML", "inside/x.xml"]
)
def test_what_may_be_written(study: Path, name: str) -> None:
    (study / "inside").symlink_to("rules")
    assert why_not_written(study, name) == ""


def test_a_link_that_goes_is_no_file_elsewhere(study: Path) -> None:
    assert why_not_written(study, "acts/linked.xml", goes=True) == ""
    assert "through a link" in why_not_written(study, "linked/file.xml", goes=True)


EDITS: list[AnyEdit] = [
    *(ReplaceFile(name, "{}") for name in ("/abs/x.toml", "../x.toml", ".git/config", ".vscode/tasks.json", ".envrc")),
    *(SetSetting(("x",), 1, file=name) for name in ("/abs/x.toml", "../x.toml", "linked/x.toml", "acts/x.xml")),
    ReplaceFile("linked/file.xml", "<Dialogs/>"),
    ReplaceFile("linked/file.xml", None),
    AddAct("R_New", file="acts/../../new.xml"),
    AddAct("R_New", file="acts/.new.xml"),
    AddRule("New", "Start", file="../rules/new.xml"),
]


@pytest.mark.parametrize("option", ["", "--dry-run"])
def test_a_file_of_edits_that_leads_out_is_refused_whole(study: Path, tmp_path: Path, option: str) -> None:
    edits = tmp_path / "edits.json"
    edits.write_bytes(msgspec.json.encode([*EDITS, SetSetting(("title",), "Changed")]))
    before = everything(study)
    found = typed("edit", study, edits, *filter(None, [option]))
    assert found.exit_code == 1
    told = [line for line in found.output.splitlines() if ": edit " in line]
    assert len(told) == len(EDITS) and found.output.endswith("nothing was written\n")
    assert everything(study) == before


def test_the_note_of_a_save_names_files_of_the_study_alone(study: Path) -> None:
    for name in (".git/config.toml", "hidden/config.toml", "linked/x.toml"):
        fresh = (study / name).parent / f".{Path(name).name}{NEW_SUFFIX}"
        fresh.write_bytes(b"evil")
        (study / NOTE).write_bytes(msgspec.json.encode([SavedFile(name, None, sum_of(b"evil"))]))
        assert finish_interrupted(study) == () and name not in read_study_files(study)
        assert not (study / name).exists()


def test_new_folders_pass_the_same_gate(tmp_path: Path) -> None:
    for name in (".envrc", "../x.toml"):
        with pytest.raises(StudyError, match=r"hidden|leads out"):
            write_new_folder(tmp_path / "new", {"scenario.toml": "", name: "x"})
    assert list(tmp_path.iterdir()) == []


# --- what is read -----------------------------------------------------------------------------------------------------

PLACES = ["../../../../etc", "..", "../outside", "/etc", "linked", "acts/../../outside"]


@pytest.mark.parametrize("kind", ["acts", "rules", "memory"])
def test_a_scenario_reads_nothing_outside_of_its_folder(study: Path, kind: str) -> None:
    for link in ("linked.xml", "program.xml"):
        (study / "acts" / link).unlink()
    settings = (study / "scenario.toml").read_text()
    for place in PLACES:
        (study / "scenario.toml").write_text(f"{kind} = {json.dumps(place)}\n{settings}")
        result = load(study)
        assert result.scenario is None
        (found,) = [each for each in result.errors if each.code == "outside-study"]
        assert str(found.location) == f"scenario.toml:1:{len(kind) + 4}"
        assert f"`{place}` leads out of the study's folder" in found.message
        assert not [name for name in result.files if "outside" in name or name.startswith("/etc")]
    (study / "scenario.toml").write_text(settings)
    assert load(study, paths={kind: "../outside"}).errors[0].code == "outside-study"


def test_files_that_are_links_out_are_told_at_once_and_not_read(study: Path, tmp_path: Path) -> None:
    (study / "acts" / "program.xml").unlink()
    links = ["acts/linked.xml", "tables/t.csv", "texts/de.toml", "lexicon.toml", "robots/floka.toml"]
    for name in links[1:]:
        (study / name).parent.mkdir(exist_ok=True)
        (study / name).symlink_to(tmp_path / "outside" / "file.xml")
    found = [each for each in load(study).errors if each.code == "outside-study"]
    assert sorted(str(each.location) for each in found) == sorted(f"{name}:1:1" for name in links)
    assert not {*links} & read_study_files(study).keys()
    for name in links:
        (study / name).unlink()
    assert load(study).scenario is not None


def test_a_folder_of_links_to_a_study_is_that_study(tmp_path: Path) -> None:
    """As `colcon build --symlink-install` makes it."""
    for path in sorted((SCENARIOS / "greeting").rglob("*")):
        link = tmp_path / path.relative_to(SCENARIOS / "greeting")
        link.mkdir() if path.is_dir() else link.symlink_to(path)
    assert load(tmp_path).scenario is not None
    assert why_not_read(tmp_path, "/etc") != ""


@pytest.mark.parametrize("place", ["../outside", "/etc", "..", "linked"])
def test_a_study_has_its_scenarios_in_its_folder(tmp_path: Path, place: str) -> None:
    study = tmp_path / "study"
    write_study(study)
    shutil.move(study / "scenario", tmp_path / "outside")
    (study / "linked").symlink_to("../outside")
    text = (study / "study.toml").read_text()
    (study / "study.toml").write_text(text.replace('scenario = "scenario"', f'scenario = "{place}"'))
    found = load_study(study)
    assert found.study is None
    (error,) = found.errors
    assert error.code == "outside-study" and f"`{place}` leads out of the study's folder" in error.message
    assert error.location.file == "study.toml" and error.location.line > 1
    assert os.path.lexists(tmp_path / "outside")
