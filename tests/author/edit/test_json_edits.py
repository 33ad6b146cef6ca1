"""Changes of a memory file: what is asked for, and nothing else in it."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.author.edit.memory import edit_memory_text, memory_file_text
from rise_engine.base.json_codec import json_equal

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
