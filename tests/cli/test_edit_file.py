"""The commands edit and new."""

from __future__ import annotations

import json
import os
import pty
import re
import shutil
from pathlib import Path

import msgspec
import pytest
from click.testing import CliRunner, Result

from rise_engine.author.edit.workspace import Workspace
from rise_engine.cli.program import main
from rise_engine.cli.scenario.edit_file import kinds_of_edits, read_edits
from rise_engine.scenario.loader import load
from rise_engine.scenario.shipped_studies import blank_study
from tests.author.edit.samples import SCENARIOS
from tests.forked import Forked

SPEECH = "acts/greeting.xml"
SAY = {"edit": "set_parameter", "act": "R_Introduction", "action": "1", "parameter": "message", "value": "I am Floka."}
_CALL = {"statement": "call", "function": "assignValue", "argument": "a = 1"}
BRANCH = {
    "edit": "add_statement",
    "at": {"rule": "Greeting", "state": "Nobody", "place": "onEntry"},
    "statement": {"statement": "if", "branches": [{"condition": "person_near", "statements": [_CALL]}]},
}


@pytest.fixture(autouse=True)
def _own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    to = tmp_path / "greeting"
    shutil.copytree(SCENARIOS / "greeting", to)
    return to


def _edit(folder: Path, edits: object, *options: str) -> Result:
    return CliRunner().invoke(main, ["edit", str(folder), "-", *options], input=json.dumps(edits))


def _disk(folder: Path) -> dict[str, bytes]:
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_all_edits_of_a_file_are_made(folder: Path) -> None:
    file = folder.parent / "edits.json"
    file.write_text(json.dumps([SAY, BRANCH, {"edit": "set_start_value", "key": "a", "value": [1, None]}]), "utf-8")
    ran = CliRunner().invoke(main, ["edit", str(folder), str(file)])
    assert ran.exit_code == 0, ran.output
    assert ran.stdout.startswith("R_Introduction 1 says “I am Floka.” (was “My name is Floka")
    assert len(ran.stdout.splitlines()) == 3
    scenario = load(folder).scenario
    assert scenario is not None
    assert scenario.memory["a"] == [1, None]
    assert b"I am Floka." in _disk(folder)[SPEECH]
    assert Workspace(folder).draft is None


def test_a_dry_run_shows_the_diff_and_writes_nothing(folder: Path) -> None:
    before = _disk(folder)
    ran = _edit(folder, SAY, "--dry-run")
    assert ran.exit_code == 0
    assert "+    <message>I am Floka.</message>\n" in ran.stdout
    assert _disk(folder) == before


def test_everything_that_cannot_be_made_is_said(folder: Path) -> None:
    before = _disk(folder)
    ran = _edit(folder, [{**SAY, "act": "R_Introductoin"}, SAY, {"edit": "remove_start_value", "key": "nobody"}])
    assert ran.exit_code == 1
    first, second, last = ran.stderr.splitlines()
    assert first.startswith("-: edit 1:")
    assert "R_Introduction" in first
    assert second.startswith("-: edit 3:")
    assert last == "nothing was written"
    assert ran.stdout == ""
    assert _disk(folder) == before


def test_a_study_with_errors_is_not_written(folder: Path) -> None:
    before = _disk(folder)
    ran = _edit(folder, {**SAY, "act": "R_Smile", "parameter": "duration", "value": "soon"}, "--json")
    assert ran.exit_code == 1
    told = json.loads(ran.stdout)
    assert [each["severity"] for each in told["findings"]] == ["error"]
    assert told["findings"][0]["place"].startswith("acts/signals.xml:")
    assert told["written"] == []
    assert _disk(folder) == before


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('[{"edit": }]', "-:1:11: "),
        ("[1]", "-: edit 1: an edit is an object"),
        ('[{"edit": "set_paramter"}]', "did you mean `set_parameter`"),
        ('[{"edit": "copy_act", "act": "R_Nod", "nam": "R_No"}]', "has no field `nam`; did you mean `name`"),
        ('[{"edit": "copy_act", "act": "R_Nod"}]', "missing required field `name`"),
        ('[{"edit": "copy_act", "act": 7, "name": "R_No"}]', "Expected `str`, got `int`"),
    ],
)
def test_files_that_hold_no_edits(folder: Path, text: str, told: str) -> None:
    ran = CliRunner().invoke(main, ["edit", str(folder), "-"], input=text)
    assert ran.exit_code == 2
    assert told in ran.stderr


def test_an_open_editor_and_its_draft_are_left_alone(folder: Path) -> None:
    before = _disk(folder)
    editor = Workspace(folder)
    ran = _edit(folder, SAY)
    assert ran.exit_code == 1
    assert "here you can only look" in ran.stderr
    assert _disk(folder) == before
    editor.close()


def test_a_blank_study_can_be_checked_and_run(tmp_path: Path) -> None:
    to = tmp_path / "mine"
    title = 'Ä "first" study\\\x7f'
    ran = CliRunner().invoke(main, ["new", str(to), "--template", "blank", "--title", title])
    assert ran.exit_code == 0, ran.output
    loaded = load(to)
    assert loaded.diagnostics == []
    assert loaded.scenario is not None
    assert loaded.scenario.title == title
    assert set(_disk(to)) == set(blank_study("", ""))
    played = CliRunner().invoke(main, ["run", str(to), "--rule", "Main", "--speed", "max"])
    assert played.exit_code == 0, played.output
    again = CliRunner().invoke(main, ["new", str(to), "--template", "blank"])
    assert again.exit_code == 1
    assert "is not empty" in again.stderr


def test_a_copied_study_has_the_page_for_language_models(tmp_path: Path) -> None:
    to = tmp_path / "mine"
    assert CliRunner().invoke(main, ["new", str(to), "--template", "greeting"]).exit_code == 0
    page = (to / "AGENTS.md").read_text("utf-8")
    named = set(re.findall(r"`rise-engine (\w+)", page))
    assert named <= set(main.list_commands(None))  # type: ignore[arg-type]
    reference = SCENARIOS.parent / "docs" / "reference"
    assert all((reference / file).exists() for file in re.findall(r"`(\w+\.md)`", page))


def test_new_refuses_what_makes_no_sense(tmp_path: Path) -> None:
    for args in ([], [str(tmp_path / "a")], [str(tmp_path / "a"), "--template", "greeting", "--title", "x"]):
        assert CliRunner().invoke(main, ["new", *args]).exit_code == 2
    unknown = CliRunner().invoke(main, ["new", str(tmp_path / "a"), "--template", "blank", "--robot", "peper"])
    assert unknown.exit_code == 2
    assert "pepper" in unknown.stderr
    assert not (tmp_path / "a").exists()


def test_the_page_of_edits_has_every_edit_and_its_fields() -> None:
    page = (SCENARIOS.parent / "docs" / "reference" / "edits.md").read_text("utf-8")
    for name, kind in kinds_of_edits().items():
        row = next(line for line in page.splitlines() if line.startswith(f"| `{name}` |"))
        fields = re.findall(r"(\w+)(\??)(?: \([^)]*\))?(?:, |$)", row.split(" | ")[1])
        assert fields == [(each.encode_name, "" if each.required else "?") for each in msgspec.structs.fields(kind)], (
            name
        )


def test_the_examples_on_the_page_of_edits(folder: Path) -> None:
    page = (SCENARIOS.parent / "docs" / "reference" / "edits.md").read_text("utf-8")
    first, statements = re.findall(r"```json\n(.*?)```", page, re.DOTALL)
    ran = _edit(folder, json.loads(first), "--dry-run")
    assert ran.exit_code == 0, ran.output
    at = {"rule": "Greeting", "state": "Nobody", "place": "onEntry"}
    for line in statements.splitlines():
        read_edits(json.dumps({"edit": "add_statement", "at": at, "statement": json.loads(line)}), "example")


def test_new_asks_in_a_terminal(tmp_path: Path) -> None:
    ours, theirs = pty.openpty()
    os.write(ours, b"mine\nblank\nMy study\npepper\n")
    ran = Forked("new", stdin=theirs, cwd=tmp_path)
    _, errors = ran.communicate()
    os.close(ours)
    os.close(theirs)
    assert ran.returncode == 0, errors
    scenario = load(tmp_path / "mine").scenario
    assert scenario is not None
    assert (scenario.title, scenario.robot.name) == ("My study", "pepper")


@pytest.mark.parametrize(
    ("path", "value", "told"),
    [
        (["check"], [{"id": "evil", "run": ["/bin/sh", "-c", "id"]}], "by the check evil: ['/bin/sh', '-c', 'id']"),
        (["recording", "sync", "play"], ["sh", "{file}"], "a recorder, sync: "),
    ],
)
def test_edits_that_let_a_study_start_programs_are_asked_for(
    folder: Path, path: list[str], value: object, told: str
) -> None:
    study = folder
    (study / "study.toml").write_text('title = "T"\nid = "t"\nseed = 1\nn = 1\nscenario = "."\n')
    edit = {"edit": "set_setting", "file": "study.toml", "path": path, "value": value}
    before = _disk(study)
    ran = _edit(study, [edit])
    assert ran.exit_code == 1 and _disk(study) == before
    assert "error: the study would then start a" in ran.stderr and told in ran.stderr
    assert "add --allow-programs" in ran.stderr
    ran = _edit(study, [edit], "--allow-programs")
    assert ran.exit_code == 0, ran.output
    assert _disk(study) != before
    unchanged = {"edit": "set_setting", "file": "study.toml", "path": ["title"], "value": "Another"}
    assert _edit(study, [unchanged]).exit_code == 0, "what it starts already is no news"
