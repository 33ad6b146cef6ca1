"""Edits of start values and settings, planned on a study, and what they change in a memory file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.author.edit.edits import Edit, RemoveStartValue, RenameSetting, SetSetting, SetStartValue
from rise_engine.author.edit.memory import edit_memory_text, memory_file_text
from rise_engine.author.edit.plan import EditRefused, Files, Plan, StudyState, apply_plan
from rise_engine.author.edit.planning import plan as plan_edit
from rise_engine.base.json_codec import json_equal
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


# --- a memory file ----------------------------------------------------------------------------------------------------


AUTHORED = """\
{"WorkingMemory":
[

  {"task":   1.50},
  { "side" : "left" , "seat":2},

  {"texts": {"hello": "Hi \\u00e9", "list": [1,  2, {"x":  null}]}},
  {"last": true}
]
}
"""
PLAIN = '{"task": 1.50,\r\n\r\n "side": "left", "seat": 2,\t"texts": {"hello": "Hi"}\r\n}'


def memory_of(text: str) -> dict[str, Any]:
    found = json.loads(text)
    if "WorkingMemory" not in found:
        return dict(found)
    return {key: value for entry in found["WorkingMemory"] for key, value in entry.items()}


@pytest.mark.parametrize(
    ("text", "changed", "lines"),
    [
        (AUTHORED, {"side": "right"}, {'  { "side" : "left"': '  { "side" : "right"'}),
        (AUTHORED, {"seat": 3.0}, {'"seat":2}': '"seat":3.0}'}),
        (AUTHORED, {"texts": {"hello": "Hi é", "list": [1, 2, {"x": 5}]}}, {'{"x":  null}': '{"x":  5}'}),
        (AUTHORED, {"texts": {"hello": "Hi é"}}, {', "list": [1,  2, {"x":  null}]}': "}"}),
        (AUTHORED, {"new": [1]}, {'  {"last": true}': '  {"last": true},\n  {"new": [1]}'}),
        (AUTHORED, {"last": ...}, {',\n  {"last": true}': ""}),
        (AUTHORED, {"task": ...}, {'  {"task":   1.50},\n': ""}),
        (AUTHORED, {"seat": ...}, {' , "seat":2}': "}"}),
        (AUTHORED, {"side": ..., "seat": ...}, {'  { "side" : "left" , "seat":2},\n': ""}),
        (AUTHORED, {"last": ..., "new": 1}, {'{"last": true}': '{"new": 1}'}),
        (PLAIN, {"side": "right", "new": 1}, {'"left"': '"right"', '"Hi"}': '"Hi"},\t"new": 1'}),
        (PLAIN, {"texts": {"hello": "Ho", "bye": ""}}, {'"Hi"}': '"Ho", "bye": ""}'}),
        ('{"WorkingMemory": []}', {"a": 1}, {"[]": '[{"a": 1}]'}),
        ("{}", {"a": 1, "b": 2}, {"{}": '{\n  "a": 1,\n  "b": 2\n}'}),
        ('{\n  "a": 1\n}\n', {"b": 2}, {"1": '1,\n  "b": 2'}),
        ('{"a": 1, "b": 2}', {"a": ..., "b": ...}, {'"a": 1, "b": 2': ""}),
        ('{\n "a": 1,\n\n "b": 2,\n "c": 3\n}', {"b": ...}, {'\n "b": 2,\n': "\n"}),
        ('{\r "a": 1,\r\r "b": 2\r}', {"c": 3}, {'"b": 2': '"b": 2,\r "c": 3'}),
    ],
)
def test_only_what_changed_is_written_anew(text: str, changed: dict[str, Any], lines: dict[str, str]) -> None:
    before = memory_of(text)
    now = {key: value for key, value in (before | changed).items() if value is not ...}
    expected = text
    for old, new in lines.items():
        assert expected.count(old) == 1, old
        expected = expected.replace(old, new)
    assert edit_memory_text(text, before, now) == expected


values = st.recursive(
    st.none() | st.booleans() | st.integers(-9, 9) | st.floats(-2, 2, width=16) | st.text('aé"\\\n', max_size=3),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text("xy", min_size=1, max_size=2), inner, max_size=3)
    ),
    max_leaves=6,
)
memories = st.dictionaries(st.text("abcd", min_size=1, max_size=2), values, max_size=5)


@pytest.mark.slow
@given(memories, memories, st.booleans(), st.sampled_from([None, 1, "\t"]))
def test_whatever_changes_is_what_is_read_again(
    before: dict[str, Any], now: dict[str, Any], listed: bool, indent: int | str | None
) -> None:
    document = {"WorkingMemory": [{key: value} for key, value in before.items()]} if listed else before
    text = json.dumps(document, indent=indent)
    assert edit_memory_text(text, before, before) == text
    assert json_equal(memory_of(edit_memory_text(text, before, now)), now)


def test_what_somebody_else_has_changed_in_the_file_meanwhile_stays() -> None:
    assert (
        edit_memory_text('{"a": 1, "b": 7, "c": 3}', {"a": 1, "b": 2}, {"a": 5, "b": 2}) == '{"a": 5, "b": 7, "c": 3}'
    )


@given(st.dictionaries(st.text("abc", min_size=1, max_size=3), values, max_size=5))
def test_any_memory_is_valid_json(memory: dict[str, Any]) -> None:
    merged: dict[str, Any] = {}
    for entry in json.loads(memory_file_text(memory))["WorkingMemory"]:
        merged |= entry
    assert merged == memory and list(merged) == list(memory)
