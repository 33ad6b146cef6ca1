"""The studies that come with the program are found by their name from anywhere, and can be copied."""

from __future__ import annotations

import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from rise_engine.author.edit.plan import EditRefused
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.scenario import shipped_studies
from rise_engine.scenario.loader import load
from rise_engine.scenario.reading.element_templates import LIBRARY
from rise_tui.config.launch import ScenarioProblems, load_scenario
from rise_tui.config.settings import scenario_path
from rise_tui.panes.save_start_values import memory_file_path
from tests.commands import typed

STUDIES = Path(__file__).parents[2] / "scenarios"
NAMES = sorted(path.name for path in STUDIES.iterdir() if path.is_dir())


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_all_studies_are_shipped() -> None:
    assert list(shipped_studies.shipped_studies()) == NAMES
    assert [line.split("  ")[0].strip() for line in shipped_studies.study_lines()] == NAMES
    assert any(line.endswith("LabLinking: setting the table") for line in shipped_studies.study_lines())


def test_where_it_is_installed_the_package_has_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "rise_engine" / "studies" / "tea"
    folder.mkdir(parents=True)
    (folder / "scenario.toml").write_text('title = "Tea"\n')
    monkeypatch.setattr(shipped_studies, "_PACKAGE", tmp_path / "rise_engine")
    assert shipped_studies.shipped_studies() == {"tea": folder}
    assert shipped_studies.study_lines() == ["tea  Tea"]
    monkeypatch.setattr(shipped_studies, "_PACKAGE", tmp_path / "nowhere" / "else")
    assert (
        shipped_studies.shipped_studies() == {}
        and shipped_studies.shipped_hint() == ""
        and shipped_studies.resolve_study("tea") == "tea"
    )


@pytest.mark.parametrize("written", ["lablinking", "lablinking/"])
def test_a_name_is_the_study_where_no_such_folder_is(written: str, elsewhere: Path) -> None:
    place = str(STUDIES / "lablinking")
    assert shipped_studies.resolve_study(written) == place
    assert scenario_path(SessionOptions(written)) == place
    (elsewhere / "lablinking").mkdir()
    assert shipped_studies.resolve_study(written) == written, "what is there is meant"
    assert scenario_path(SessionOptions(written)) == "lablinking"


@pytest.mark.parametrize(
    "written", ["", ".", "/", "~", "nowhere", "a/lablinking", "../lablinking", "LabLinking", "x\0y"]
)
def test_everything_else_stays_what_it_is(written: str) -> None:
    assert shipped_studies.resolve_study(written) == written


def test_what_is_not_there_names_the_studies() -> None:
    diagnostics = load("lablnking").diagnostics
    assert "`lablinking`" in diagnostics[0].message and "there is no such folder" in diagnostics[0].message
    result = typed("check", "lablnking")
    assert result.exit_code == 2 and "`lablinking`" in result.output
    prepared = load_scenario(SessionOptions("lablnking"))
    assert isinstance(prepared, ScenarioProblems) and "`lablinking`" in prepared.lines[0]


def test_the_commands_take_the_name() -> None:
    checked = typed("check", "lablinking/")
    assert checked.exit_code == 0 and "35 acts" in checked.output
    ran = typed("run", "greeting", "--act", "R_Greeting", "--speed", "max")
    assert ran.exit_code == 0, ran.output
    prepared = load_scenario(SessionOptions("greeting"))
    assert not isinstance(prepared, ScenarioProblems) and prepared.title == "Greeting a visitor"


def test_nothing_is_written_into_it() -> None:
    scenario = load(shipped_studies.resolve_study("greeting")).scenario
    assert scenario is not None
    with pytest.raises(EditRefused, match="rise-engine new DIR --from greeting"):
        memory_file_path(scenario)


def test_a_copy_is_the_same_study_and_ones_own(elsewhere: Path) -> None:
    result = typed("new", "my study/first", "--from", "lablinking")
    assert result.exit_code == 0, result.output
    assert "rise-tui --config 'my study/first'" in result.output
    new = elsewhere / "my study" / "first"
    copied = {str(path.relative_to(new)): path.read_bytes() for path in new.rglob("*") if path.is_file()}
    assert copied.pop("AGENTS.md").startswith(b"# For language models")
    source = STUDIES / "lablinking"
    assert copied == {str(p.relative_to(source)): p.read_bytes() for p in source.rglob("*") if p.is_file()}
    scenario = load(new).scenario
    assert scenario is not None and memory_file_path(scenario) == new / "memory.json"
    assert all(os.access(path, os.W_OK) for path in new.rglob("*"))


@pytest.mark.parametrize("there", ["file", "full"])
def test_a_copy_never_mixes_with_what_is_there(there: str, elsewhere: Path) -> None:
    if there == "file":
        (elsewhere / "mine").write_text("x")
    else:
        (elsewhere / "mine").mkdir()
        (elsewhere / "mine" / ".hidden").write_text("x")
    before = sorted(elsewhere.rglob("*"))
    result = typed("new", "mine", "--from", "greeting")
    assert result.exit_code == 1 and ("is not a folder" in result.output or "is not empty" in result.output)
    assert sorted(elsewhere.rglob("*")) == before


def test_an_empty_folder_is_taken(elsewhere: Path) -> None:
    (elsewhere / "mine").mkdir()
    assert typed("new", "mine", "--from", "greeting").exit_code == 0


def test_new_says_what_there_is() -> None:
    listing = typed("new", "--list")
    assert listing.exit_code == 0 and [line.split()[0] for line in listing.output.splitlines()] == NAMES
    wrong = typed("new", "mine", "--from", "lablnking")
    assert wrong.exit_code == 1 and "did you mean `lablinking`?" in wrong.output
    assert "LabLinking: setting the table" in wrong.output
    assert not Path("mine").exists()
    for arguments in (["new"], ["new", "mine"], ["new", "--from", "lablinking"]):
        assert typed(*arguments).exit_code == 2


def test_the_wheel_holds_the_studies_the_ros_types_and_the_notices(tmp_path: Path) -> None:
    """Built as `pip wheel .` does it, by the backend itself; skipped where that is not installed."""
    pytest.importorskip("hatchling")
    build = "import hatchling.build, sys; print(hatchling.build.build_wheel(sys.argv[1]))"
    done = subprocess.run(
        [sys.executable, "-c", build, str(tmp_path)], cwd=STUDIES.parent, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    with zipfile.ZipFile(tmp_path / done.stdout.split()[-1]) as wheel:
        held = set(wheel.namelist())
    for path in STUDIES.rglob("*"):
        if path.is_file():
            assert f"rise_engine/studies/{path.relative_to(STUDIES).as_posix()}" in held
    assert {f"rise_engine/scenario/patterns/{path.name}" for path in LIBRARY.glob("*.xml")} <= held
    assert {"rise_adapters/py.typed", "rise_exchange/commands/__init__.py"} <= held
    types = STUDIES.parent / "adapters" / "rise_interfaces"
    assert {
        f"rise_adapters/ros2/share/{path.relative_to(types.parent)}" for path in types.rglob("*") if path.is_file()
    } <= held
    assert {name.partition(".dist-info/licenses/")[2] for name in held} >= {
        "LICENSE",
        "NOTICE",
        "LICENSES/Apache-2.0.txt",
    }


def test_the_notice_names_every_definition_of_others() -> None:
    root = STUDIES.parent
    share = root / "adapters" / "rise_adapters" / "ros2" / "share"
    notice = (root / "NOTICE").read_text("utf-8")
    for path in share.rglob("*.*"):
        package, *rest = path.relative_to(share).parts
        if path.is_file():
            section = notice[notice.index(f"\n{package} ") :].partition("https://")[0]
            assert "/".join(rest) in section, path
