"""`rise-engine convert to-bml` and `from-bml`, as somebody types them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import Result
from lxml import etree

from rise_engine.scenario.loader import load
from tests.commands import typed
from tests.exchange.bml.samples import parts

HELLO = """<bml xmlns="http://www.bml-initiative.org/bml/bml-1.0" id="hello" composition="APPEND">
  <required><speech id="s1"><text>Hello <sync id="m"/> there.</text></speech></required>
  <gazeShift id="z" target="visitor" start="s1:end + 0.5" end="z:start+1"/>
</bml>
"""
NAMES = "[targets]\nvisitor = { x = 1.5, y = 0, z = 1.2 }\n"


def run(*arguments: str | Path) -> Result:
    return typed("convert", *arguments)


def everything(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def files(tmp_path: Path) -> Path:
    (tmp_path / "hello.xml").write_text(HELLO, "utf-8")
    (tmp_path / "names.toml").write_text(NAMES, "utf-8")
    return tmp_path


def test_a_study_goes_out_and_comes_in_again(tmp_path: Path) -> None:
    out = run("to-bml", "scenarios/lab_opening", "-o", tmp_path / "blocks")
    assert out.exit_code == 0 and "blocks of BML 1.0" in out.stdout
    study = tmp_path / "study"
    study.mkdir()
    (study / "memory.json").write_bytes(Path("scenarios/lab_opening/memory.json").read_bytes())
    robot = load("scenarios/lab_opening").robot.name
    (study / "scenario.toml").write_text(f'robot = "{robot}"', "utf-8")
    back = run("from-bml", *sorted((tmp_path / "blocks").iterdir()), "--into", study)
    assert back.exit_code == 0, back.output
    before, after = load("scenarios/lab_opening").scenario, load(study).scenario
    assert before is not None and after is not None
    assert {name: parts(act) for name, act in after.acts.items()} == {
        name: parts(act) for name, act in before.acts.items()
    }
    types = {
        name: settings.calling_type for name, settings in before.act_settings.items() if settings.calling_type == "None"
    }
    assert {name: settings.calling_type for name, settings in after.act_settings.items()} == types


def test_one_act_is_printed_and_its_losses_are_told() -> None:
    found = run("to-bml", "scenarios/greeting", "--act", "R_Introduction")
    assert found.exit_code == 0
    assert "acts/greeting.xml:47:3: lost: `R_Introduction`, action 5: it begins when several have ended" in found.stderr
    assert etree.fromstring(found.stdout.encode()).get("id") == "R_Introduction"


def test_with_strict_nothing_is_written(files: Path) -> None:
    out = run("to-bml", "scenarios/greeting", "--strict", "-o", files / "blocks")
    assert out.exit_code == 1 and not (files / "blocks").exists()
    assert re.search(r"\d+ things lost, and --strict allows none; nothing was written", out.stderr)
    exact = run("to-bml", "scenarios/greeting", "--act", "R_Nod", "--strict", "-o", files / "nod.xml")
    assert exact.exit_code == 0 and (files / "nod.xml").is_file()
    back = run("from-bml", files / "hello.xml", "--names", files / "names.toml", "--into", files / "study", "--strict")
    assert back.exit_code == 1 and not (files / "study").exists()
    assert "hello.xml:2:41: lost: the mark `m`" in back.stderr and "1 thing lost, and --strict" in back.stderr


def test_an_error_writes_nothing_and_tells_all(files: Path) -> None:
    (files / "other.xml").write_text(HELLO.replace("visitor", "vistor").replace("s1:end", "s1:m"), "utf-8")
    found = run(
        "from-bml", files / "hello.xml", files / "other.xml", "--names", files / "names.toml", "--into", files / "s"
    )
    assert found.exit_code == 1 and not (files / "s").exists()
    assert "other.xml:3:29: error bml-name: `vistor` has no place here; did you mean `visitor`?" in found.stderr
    assert "other.xml:3:44: error bml-time: `m` is a mark in the words of `s1`" in found.stderr
    assert "2 errors; nothing was written" in found.stderr


def test_acts_come_into_a_new_folder_and_into_a_study_that_is_there(files: Path) -> None:
    made = run("from-bml", files / "hello.xml", "--names", files / "names.toml", "--into", files / "new")
    assert made.exit_code == 0, made.output
    study = load(files / "new").scenario
    assert study is not None and [action.id for action in study.acts["hello"].actions] == ["s1", "wait_1", "z"]
    before = everything(files / "new")
    again = run("from-bml", files / "hello.xml", "--names", files / "names.toml", "--into", files / "new")
    assert again.exit_code == 1 and "there is an act `hello` in the scenario already" in again.stderr
    assert everything(files / "new") == before
    (files / "new/scenario.toml").write_text('title = "Mine" # no line end', "utf-8")
    (files / "second.xml").write_text(HELLO.replace('"hello" composition="APPEND"', '"second"'), "utf-8")
    more = run("from-bml", files / "second.xml", "--names", files / "names.toml", "--into", files / "new")
    assert more.exit_code == 0
    study = load(files / "new").scenario
    assert study is not None and study.title == "Mine" and study.act_settings["second"].calling_type == "None"


def test_what_cannot_be_named_is_a_wrong_use(files: Path) -> None:
    for arguments, sentence in (
        (["to-bml", "scenarios/greeting"], "add -o FOLDER"),
        (["to-bml", "scenarios/greeting", "--act", "R_Nood"], "R_Nod"),
        (["to-bml", "scenarios/greeting", "--act", "R_Nod", "-o", files / "hello.xml"], "already; name a new one"),
        (["to-bml", files / "gone"], "there is no folder"),
    ):
        found = run(*arguments)
        assert found.exit_code == 2 and sentence in found.stderr
    gone = run("from-bml", files / "gone.xml", "--into", files / "new")
    assert gone.exit_code == 1 and "gone.xml:1:1: error unreadable" in gone.stderr


def test_mistakes_in_names_are_told_with_their_place(files: Path) -> None:
    names = (
        '[targets]\nvisitor = { x = 1, y = "0", z = 1 }\n[head]\nNOD = "head_nodd"\nBOW = { Speech = "x" }\n[arms]\n'
    )
    (files / "names.toml").write_text(names, "utf-8")
    found = run("to-bml", "scenarios/greeting", "--act", "R_Nod", "--names", files / "names.toml")
    assert found.exit_code == 1
    told = [line.partition("names.toml:")[2].partition(":")[0] for line in found.stderr.splitlines()[:-1]]
    assert told == ["2", "4", "5", "6"]
    assert "did you mean `head_nod`?" in found.stderr


def test_the_schema_knows_what_is_written() -> None:
    printed = typed("schema", "--kind", "bml")
    schema = etree.RelaxNG(etree.fromstring(printed.stdout.encode()))
    block = run("to-bml", "scenarios/greeting", "--act", "R_Introduction").stdout
    assert schema.validate(etree.fromstring(block.encode()))
    assert not schema.validate(etree.fromstring(block.replace("<wait ", "<weit ").encode()))
