"""`rise-engine uses`, `rename` and `fmt`."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from rise_engine.author.edit.workspace import Workspace
from rise_engine.cli import main
from rise_engine.scenario.loader import load
from tests.author.edit.samples import SCENARIOS


@pytest.fixture
def study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    shutil.copytree(SCENARIOS / "greeting", tmp_path / "study")
    return tmp_path / "study"


def call(capsys: pytest.CaptureFixture[str], *arguments: str | Path) -> tuple[int, str, str]:
    """Exit status, standard output, standard error."""
    with pytest.raises(SystemExit) as ended:
        main(list(map(str, arguments)))
    output = capsys.readouterr()
    return int(ended.value.code or 0), output.out, output.err


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_uses_says_where_a_name_stands(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    status, out, err = call(capsys, "uses", study, "act", "R_Introduction")
    lines = out.splitlines()
    assert (status, err) == (0, "") and lines[0] == "acts/greeting.xml:22:15: act R_Introduction (defines it)"
    assert len(lines) >= 2 and all("rules/greeting.xml:" in line or "scenario.toml:" in line for line in lines[1:])
    status, out, _ = call(capsys, "uses", study, "act", "R_Introduction", "--json")
    found = json.loads(out)["uses"]
    assert [f"{use['file']}:{use['line']}:{use['column']}" for use in found] == [
        line.partition(": ")[0] for line in lines
    ]
    assert found[0]["defines"] is True
    assert call(capsys, "uses", study, "event", "/W_close") == call(capsys, "uses", study, "event", "W_close")
    status, out, err = call(capsys, "uses", study, "act", "R_Introductio")
    assert (status, out) == (1, "") and err == "there is no act `R_Introductio`; did you mean `R_Introduction`?\n"
    assert call(capsys, "uses", study.parent / "none", "act", "x")[0] == 2


def test_rename_writes_every_file_and_back_again(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(study)
    status, out, err = call(capsys, "rename", study, "key", "person_near", "visitor_near", "--diff")
    assert status == 0 and '-  {"person_near": false},' in out and '+  {"visitor_near": false},' in out
    assert contents(study) == before
    status, out, err = call(capsys, "rename", study, "key", "person_near", "visitor_near")
    assert status == 0 and out.startswith("the memory key `person_near` is called `visitor_near` now, in ")
    assert "README.md" in err and "still has `person_near`" in err
    now = contents(study)
    assert now.keys() == before.keys()
    assert {name for name in now if now[name] != before[name]} >= {"memory.json", "session.jsonl"}
    assert load(study).scenario is not None
    status, out, _ = call(capsys, "rename", study, "key", "visitor_near", "person_near", "--json")
    said = json.loads(out)
    assert status == 0 and said["written"] is True and "memory.json" in said["files"]
    assert contents(study) == before


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("act", "R_Introduction", "R_Greeting"), "`R_Greeting` is taken: acts/greeting.xml, line 5"),
        (("act", "R_No", "R_Yes"), "there is no act `R_No`"),
        (("state", "Greeting", "Other"), "write RULE/STATE"),
    ],
)
def test_a_rename_that_cannot_be_writes_nothing(
    study: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], why: str
) -> None:
    before = contents(study)
    status, out, err = call(capsys, "rename", study, *arguments)
    assert status == 1 and out == "" and why in err and contents(study) == before
    status, out, err = call(capsys, "rename", study, *arguments, "--json")
    assert status == 1 and why in json.loads(out)["refused"]


def test_a_key_that_the_study_above_sets_is_changed_there_first(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    above, before = study.parent / "study.toml", contents(study)
    head = f'scenario = "{study.name}"\n[factors.f]\n'
    above.write_text(f"{head}levels.yes.memory = {{ person_near = true }}\n", "utf-8")
    assert f"{above.resolve()} sets `person_near`, too" in call(capsys, "uses", study, "key", "person_near")[2]
    status, _, err = call(capsys, "rename", study, "key", "person_near", "near")
    assert status == 1 and f"{above.resolve()} sets `person_near`, too" in err and contents(study) == before
    above.write_text(f"{head}levels.yes.memory = {{ near = true }}\n", "utf-8")
    assert call(capsys, "rename", study, "key", "person_near", "near")[0] == 0


def test_a_study_above_that_has_another_scenario_stands_in_no_way(
    study: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = 'scenario = "another"\n[factors.f]\nlevels.yes.memory = { person_near = true }\n'
    (study.parent / "study.toml").write_text(text, "utf-8")
    assert call(capsys, "rename", study, "key", "person_near", "near")[0] == 0


def test_a_study_with_errors_is_not_renamed(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (study / "memory.json").write_text("{", "utf-8")
    status, _, err = call(capsys, "rename", study, "act", "R_Introduction", "R_Intro")
    assert status == 1 and "memory.json:1:" in err and "they hide where names are used" in err


def test_nothing_is_written_while_somebody_has_the_study_open(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = contents(study)
    editor = Workspace(study)
    status, _, err = call(capsys, "rename", study, "act", "R_Introduction", "R_Intro")
    editor.close()
    assert status == 1 and "has this study open" in err and contents(study) == before
    assert call(capsys, "rename", study, "act", "R_Introduction", "R_Intro")[0] == 0


def test_fmt_lays_out_and_leaves_what_cannot_be_read(study: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call(capsys, "fmt", study, "--check") == (0, "8 files, all in the usual layout\n", "")
    shipped = contents(study)
    acts = study / "acts" / "greeting.xml"
    acts.write_bytes(acts.read_bytes().replace(b"  <", b"\t<").replace(b"<actionID>1", b"<actionID >1"))
    settings = study / "scenario.toml"
    settings.write_text(settings.read_text("utf-8").replace('robot = "floka"', 'robot="floka"  '), "utf-8")
    odd = contents(study)
    assert call(capsys, "fmt", study, "--check")[:2] == (
        1,
        "acts/greeting.xml: would change\nscenario.toml: would change\n",
    )
    status, out, _ = call(capsys, "fmt", study, "--diff")
    assert status == 0 and '-robot="floka"  \n+robot = "floka"\n' in out and contents(study) == odd
    status, out, _ = call(capsys, "fmt", study)
    assert (status, out) == (0, "acts/greeting.xml: formatted\nscenario.toml: formatted\n")
    assert contents(study) == shipped
    acts.write_bytes(b"<Dialogs>")
    status, out, err = call(capsys, "fmt", study)
    assert status == 1 and err.startswith("acts/greeting.xml stays as it is: ") and acts.read_bytes() == b"<Dialogs>"


def test_a_shipped_study_stays_as_it_is(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = call(capsys, "fmt", "lablinking")
    assert status == 0 and out.endswith(" files, all in the usual layout\n")
    status, _, err = call(capsys, "rename", "lablinking", "act", "R_Yes", "R_Ja")
    assert status == 1 and "comes with the program and stays as it is" in err
