"""Edits of start values and settings, planned on a study."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from rise_engine.author.edit.edits import Edit, RemoveStartValue, RenameSetting, SetSetting, SetStartValue
from rise_engine.author.edit.plan import EditRefused, Files, Plan, StudyState, apply_plan
from rise_engine.author.edit.planning import plan as plan_edit
from rise_engine.scenario.loader import LoadResult


def plan(files: Files, edit: Edit) -> Plan:
    return plan_edit(edit, StudyState(files, LoadResult(None, []), Path("study")))


def changed(files: dict[str, bytes], edit: Edit) -> tuple[Files, Plan]:
    planned = plan(files, edit)
    return apply_plan(files, planned), planned


MEMORY_TEXT = '\ufeff{"WorkingMemory":\r\n[\r\n  {"name": "Jürgen"},\r\n\r\n  {"n": 1.50}\r\n]\r\n}\r\n'


@pytest.mark.parametrize(
    ("edit", "old", "new", "says"),
    [
        (SetStartValue("name", "Ada"), '"Jürgen"', '"Ada"', 'name begins as "Ada" (was "Jürgen")'),
        (SetStartValue("n", 1.5), "", "", ""),
        (SetStartValue("x", [1]), "1.50}", '1.50},\r\n  {"x": [1]}', "x begins as [1] (new key)"),
        (RemoveStartValue("n"), ',\r\n\r\n  {"n": 1.50}', "", "n has no start value any more (was 1.5)"),
    ],
)
def test_a_start_value_is_changed_in_its_line(edit: Edit, old: str, new: str, says: str) -> None:
    after, planned = changed({"memory.json": MEMORY_TEXT.encode()}, edit)
    assert after["memory.json"].decode() == MEMORY_TEXT.replace(old, new) if old else MEMORY_TEXT
    assert planned.says == ((says,) if old else ()) and len(planned.splices) == (1 if old else 0)


def test_a_study_without_memory_gets_a_file_where_it_names_it() -> None:
    after, planned = changed({"scenario.toml": b'memory = "start/values.json"\n'}, SetStartValue("a b", None))
    assert after["start/values.json"] == b'{"WorkingMemory":\n[\n  {"a b": null}\n]\n}\n'
    assert planned.noticed == ("the key `a b` cannot be written in a condition: use letters, digits, `_` and dots",)
    assert changed({"memory.json": b" \n"}, SetStartValue("a", 1))[0]["memory.json"].startswith(b'{"WorkingMemory"')


@pytest.mark.parametrize(
    ("files", "edit", "why"),
    [
        ({"memory.json": b'{"side": 1}'}, RemoveStartValue("sode"), "did you mean `side`"),
        ({}, RemoveStartValue("a"), "has no start value in memory.json"),
        ({"memory.json": b'{"a": 1,,}'}, SetStartValue("a", 2), "memory.json: line 1: "),
        ({"memory.json": b'{"a": 1, "a": 2}'}, SetStartValue("a", 2), "is in it twice"),
        ({"memory.json": b"\xff"}, SetStartValue("a", 2), "memory.json is not UTF-8; save it as UTF-8 first"),
        ({}, SetStartValue(" ", 2), "cannot be empty"),
        ({}, SetStartValue("a", float("nan")), "cannot be the start value of `a`"),
        ({}, SetStartValue("a", 2**63), "more than 64 bits"),
        ({"tables/items.csv": b"a\n"}, SetStartValue("items.x", 2), "`items` is a table of this study"),
        ({"scenario.toml": b"a = \n"}, SetSetting(("a",), 2), "scenario.toml: it is not TOML"),
        ({"scenario.toml": b"a = 1\n"}, SetSetting(("a",), {"b": None}), "TOML file has no null"),
        ({"scenario.toml": b"a = 1\n"}, SetSetting(("a", "b"), 1), "`a` has no place for `b`"),
        ({"scenario.toml": b"a = [1]\n"}, SetSetting(("a", "3"), 1), "`a` has no place for `3`"),
        ({"scenario.toml": b"a = 1\n"}, SetSetting(("b",), None), "there is no `b`"),
        ({}, SetSetting(("b",), None), "there is no file scenario.toml"),
        ({}, SetSetting(("b",), 1, "memory.json"), "`memory.json` is not a name for this file: it has to end in .toml"),
        ({}, SetSetting((), 1), "say which entry is meant"),
        ({}, RenameSetting(("b",), "c"), "there is no file scenario.toml"),
        ({"scenario.toml": b"a = 1\nb = 1"}, RenameSetting(("a",), "b"), "`b` is there already"),
    ],
)
def test_what_cannot_be_is_refused_with_the_reason(files: dict[str, bytes], edit: Edit, why: str) -> None:
    with pytest.raises(EditRefused, match=why.replace("(", r"\(")):
        plan(files, edit)


def test_settings_say_what_they_do() -> None:
    files = {"scenario.toml": "# Gespräch\n\n[keys]\nn = { rule = 'Next' } # weiter\n".encode()}
    after, planned = changed(files, SetSetting(("keys", "n", "label"), "Größe"))
    assert (
        after["scenario.toml"].decode() == "# Gespräch\n\n[keys]\nn = { rule = 'Next', label = \"Größe\" } # weiter\n"
    )
    assert planned.says == ('key n: label is "Größe" (new)',)
    after, planned = changed(files, SetSetting(("keys", "n"), None))
    assert after["scenario.toml"].decode() == "# Gespräch\n"
    assert planned.noticed == ("the comment in scenario.toml, line 4, is removed with it: # weiter",)
    after, planned = changed(files, RenameSetting(("keys", "n"), "ü"))
    assert after["scenario.toml"].decode().endswith("\"ü\" = { rule = 'Next' } # weiter\n")
    assert planned.says == ("key n is called ü now",)
    after, planned = changed(files, SetSetting(("language",), "de", "study.toml"))
    assert after["study.toml"] == b'language = "de"\n' and planned.written


def test_a_value_that_stays_is_no_change() -> None:
    files: dict[str, Any] = {"scenario.toml": b"a = 0x10\n"}
    assert plan(files, SetSetting(("a",), 16)).splices == ()
    assert apply_plan(files, plan(files, SetSetting(("a",), 16.0)))["scenario.toml"] == b"a = 16.0\n"


def test_a_key_that_is_another_one_is_pressed_in_tests_of_the_study() -> None:
    files = {
        "scenario.toml": b'[keys]\nn = { rule = "Next" }\n',
        "tests/a.jsonl": b'{"test": "n"}\r\n{"key" : "n"}\r\n{"key": "m"}\r\nn\r\n',
        "session.jsonl": b'{"key": "n"}\n',
    }
    after, _ = changed(files, RenameSetting(("keys", "n"), "k"))
    assert after["tests/a.jsonl"] == b'{"test": "n"}\r\n{"key" : "k"}\r\n{"key": "m"}\r\nn\r\n'
    assert after["session.jsonl"] == files["session.jsonl"]
