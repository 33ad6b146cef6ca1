"""Rename reaches what a study says of its exploration, in all ways in which that can be written."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from rise_engine.author.edit.edits import NameKind, Rename, SetSetting, SetStartValue
from rise_engine.author.edit.plan import EditRefused, StudyState, apply_plan
from rise_engine.author.edit.planning import plan
from rise_engine.author.edit.remedies import remedies
from rise_engine.scenario.loader import load
from tests.author.edit.guard import BeyondTheEdit, check_guard
from tests.scenario.folders import SPEECH, act, folder, rule

ACTS = f"<Dialogs>{act(SPEECH, 'R_Nod')}{act(SPEECH, 'R_Wave')}</Dialogs>"
RULES = rule(
    '<State id="Nobody"><transition cond="near" target="Greet"/></State>'
    '<State id="Greet"><onEntry><function startCommunicationRobotAct="R_Nod"/></onEntry></State>',
    "Main",
    "Nobody",
)
TOML = r"""
[explore]
end = "Main"
tries = { near = [2], "who" = [near_is_no_key, "near"] }
[always]
"Main, R_Nod, near" = "not (runs('R_Nod') and waits(\"R_Nod\")) or near"
literal = 'in("Main", "Greet") or who = "near" or who = "Greet"'
lines = '''
near and
  in("Main", 'Greet')'''
escaped = "in('M\u0061in', \"Gr\u0065et\") or n\u0065ar"
[eventually]
"R_Nod comes" = { after = "in('Main', 'Greet')", then = "runs('R_Nod')", unless = "near = 2" }
""".replace("near_is_no_key", '"x"')
FILES: dict[str, str | bytes] = {
    "acts/a.xml": ACTS,
    "rules/r.xml": RULES,
    "scenario.toml": TOML,
    "memory.json": '{"near": false, "who": "x"}',
}


def state_of(path: Path, toml: str = TOML) -> StudyState:
    files = {**FILES, "scenario.toml": toml}
    contents = {name: text.encode() if isinstance(text, str) else text for name, text in files.items()}
    loaded = load(folder(path, files))
    return StudyState(contents, loaded, path)


def renamed(state: StudyState, kind: NameKind, old: str, new: str) -> StudyState:
    planned = plan(Rename(kind, old, new), state)
    files = apply_plan(state.files, planned)
    now = StudyState(files, load(state.folder, held=files), state.folder)
    assert now.checked.scenario is not None, now.checked.errors
    check_guard([Rename(kind, old, new)], state, now)
    return now


def toml_of(state: StudyState) -> str:
    return state.files["scenario.toml"].decode()


def test_an_act(tmp_path: Path) -> None:
    now = renamed(state_of(tmp_path), "act", "R_Nod", "Yes")
    lines = toml_of(now).splitlines()
    assert r""""Main, R_Nod, near" = "not (runs('Yes') and waits(\"Yes\")) or near" """.strip() in lines
    assert """"R_Nod comes" = { after = "in('Main', 'Greet')", then = "runs('Yes')", unless = "near = 2" }""" in lines
    assert toml_of(now).count("R_Nod") == 2


def test_a_rule_a_state_and_a_key(tmp_path: Path) -> None:
    state = state_of(tmp_path)
    rules = tomllib.loads(toml_of(renamed(state, "rule", "Main", "Door")))
    assert rules["explore"]["end"] == "Door"
    assert rules["always"]["escaped"] == "in('Door', \"Greet\") or near"
    assert rules["always"]["lines"] == "near and\n  in(\"Door\", 'Greet')"
    states = tomllib.loads(toml_of(renamed(state, "state", "Main/Greet", "Hello")))
    assert states["always"]["literal"] == 'in("Main", "Hello") or who = "near" or who = "Greet"'
    assert states["always"]["escaped"] == "in('Main', \"Hello\") or near"
    assert states["eventually"]["R_Nod comes"]["after"] == "in('Main', 'Hello')"
    keys = tomllib.loads(toml_of(renamed(state, "key", "near", "close")))
    assert keys["explore"]["tries"] == {"close": [2], "who": ["x", "near"]}
    assert keys["always"]["literal"] == 'in("Main", "Greet") or who = "near" or who = "Greet"'
    assert keys["always"]["escaped"] == "in('Main', \"Greet\") or close"
    assert keys["eventually"]["R_Nod comes"]["unless"] == "close = 2"


@pytest.mark.parametrize("new", ['Zq "main"', "Zq\\n", "Ä & Ö", "Zq, so"])
@pytest.mark.parametrize(("kind", "old"), [("act", "R_Nod"), ("rule", "Main"), ("state", "Main/Greet")])
def test_a_name_is_quoted_as_the_condition_and_the_file_want_it(
    tmp_path: Path, kind: NameKind, old: str, new: str
) -> None:
    state = state_of(tmp_path, TOML.replace("escaped = ", "# escaped = "))
    now = renamed(state, kind, old, new)
    owner, _, alone = old.rpartition("/")
    full = f"{owner}/{new}" if owner else new
    uses, before = now.checked.uses.of(kind, full), state.checked.uses.of(kind, old)
    assert len(uses) == len(before) > 3
    again = renamed(now, kind, full, alone)
    assert again.files == state.files


def test_what_a_literal_text_cannot_have_is_refused(tmp_path: Path) -> None:
    with pytest.raises(EditRefused, match="write this text in \" marks first; it is in ' marks"):
        plan(Rename("rule", "Main", "Zq's"), state_of(tmp_path))
    basic = state_of(tmp_path, "[always]\na = \"in('Main', 'Greet')\"")
    assert toml_of(renamed(basic, "rule", "Main", "Zq's")) == "[always]\na = \"in('Zq\\\\'s', 'Greet')\""


def test_an_edit_of_something_else_changes_no_property(tmp_path: Path) -> None:
    state = state_of(tmp_path)
    other = state_of(tmp_path / "other", TOML.replace("near = 2", "near = 3"))
    with pytest.raises(BeyondTheEdit, match="settings properties"):
        check_guard([SetStartValue("near", True)], state, other)
    check_guard([SetSetting(("eventually", "R_Nod comes", "unless"), "near = 3")], state, other)


def test_remedies_of_what_is_named_wrong(tmp_path: Path) -> None:
    toml = "[explore]\nend = \"Mian\"\nfault = 1\n[always]\na = \"runs('R_Nodd') or in('Main', 'Greeet')\"\n"
    state = state_of(tmp_path, toml)
    assert len(state.checked.diagnostics) == 4
    for finding in state.checked.diagnostics:
        likely = remedies(finding, state)[0]
        now = load(state.folder, held=apply_plan(state.files, plan(likely.edit, state)))
        assert len(now.diagnostics) == 3, (likely.title, now.diagnostics)
