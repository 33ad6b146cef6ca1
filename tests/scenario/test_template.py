"""Separators in texts: `Thank you{", "name}!` says them only together with a value."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.scenario.speech.template import MemorySlot, MissingValueError, TemplateError, parse_template
from rise_tui.model.speech import complete_speech, fill_speech
from tests.scenario.folders import act, found, loaded


@pytest.mark.parametrize(
    ("text", "memory", "expected"),
    [
        ('Thank you very much{", "name}!', {"name": "Anna"}, "Thank you very much, Anna!"),
        ('Thank you very much{", "name}!', {}, "Thank you very much!"),
        ('Thank you very much{", "name}!', {"name": None}, "Thank you very much!"),
        ('Thank you very much{", "name}!', {"name": ""}, "Thank you very much!"),
        ('Thank you very much{", "name}!', {"name": " "}, "Thank you very much!"),
        ('{name", "}welcome!', {"name": "Anna"}, "Anna, welcome!"),
        ('{name", "}welcome!', {}, "welcome!"),
        ('Hi{" "name"!"} Well', {"name": "Bo"}, "Hi Bo! Well"),
        ('Hi{" "name"!"} Well', {}, "Hi Well"),
        ('Hi{" "name| there}', {"name": "Bo"}, "Hi Bo"),
        ('Hi{" "name| there}', {}, "Hi there"),
        ('Hi{" "name| there}', {"name": ""}, "Hi there"),
        ('{ "a " n " b" }', {"n": 3.0}, "a 3 b"),
        ('{", "n}', {"n": 0}, ", 0"),
        ('{", "n}', {"n": False}, ", false"),
        ('{" {|} "a.b}', {"a": {"b": "x"}}, " {|} x"),
        ('{""name}', {}, ""),
        ('{{", "name}}', {"name": "x"}, '{", "name}'),
        ('{name|"you"}', {}, '"you"'),
        ("{name|}!", {}, "!"),
    ],
)
def test_a_separator_is_said_only_with_a_value(text: str, memory: dict[str, Any], expected: str) -> None:
    assert parse_template(text).fill(memory) == expected
    assert fill_speech(text, memory).text == expected.strip(), "the console says the same"


@pytest.mark.parametrize(
    ("text", "column", "message"),
    [
        ('Hi {", name}', 5, "has no closing quotation mark"),
        ('Hi {name", }', 9, "has no closing quotation mark"),
        ('Hi {", "}', 4, "one key"),
        ('Hi {"a" "b" name}', 4, "one key"),
        ('Hi {"a" name other}', 4, "one key"),
        ('Hi {", "name', 4, "without its `}`"),
        ("Hi {„, “name}", 5, "`„` is a typographic quotation mark"),
        ("Hi {name”, ”}", 9, "`”` is a typographic quotation mark"),
        ("Hi {, name}", 4, "does not name a memory key"),
    ],
)
def test_what_is_malformed_is_explained(text: str, column: int, message: str) -> None:
    with pytest.raises(TemplateError) as error:
        parse_template(text)
    assert message in str(error.value) and error.value.column == column
    assert fill_speech(text, {}).problem == str(error.value)


PIECES = st.text(alphabet=' ,.!ab"{}|“1', max_size=30)


@given(PIECES)
def test_any_text_is_read_or_refused_at_a_place_within_it(text: str) -> None:
    try:
        template = parse_template(text)
    except TemplateError as error:
        assert 1 <= error.column <= len(text)
    else:
        assert "".join(p if isinstance(p, str) else "" for p in template.parts).count("{") <= text.count("{")
        try:
            template.fill({})
        except MissingValueError as missing:
            assert missing.key in {slot.key for slot in template.slots}


@given(
    st.text(alphabet=", .!{}|x", max_size=5),
    st.text(alphabet=", .!{}|x", max_size=5),
    st.none() | st.text("ab ", max_size=3),
)
def test_what_is_written_comes_back(before: str, after: str, fallback: str | None) -> None:
    end = "" if fallback is None else f"|{fallback}"
    part = parse_template(f'{{"{before}"key.0"{after}"{end}}}').parts[0]
    assert part == MemorySlot("key.0", fallback or "", before, after)


def test_the_check_knows_separators(tmp_path: Path) -> None:
    body = (
        '<Speech><actionID>1</actionID><message>Hi{", "name}{", "nme}{" "person.nam}</message></Speech>\n'
        '<Wait><actionID>2</actionID><duration>{" "name}</duration></Wait>\n'
        '<Speech><actionID>3</actionID><message>Hi {", name}</message></Speech>'
    )
    result = loaded(tmp_path, {"acts/a.xml": act(body), "memory.json": '{"name": null, "person": {"name": 1}}'})
    assert found(result) == [
        "acts/a.xml:2:52 unset-key",
        "acts/a.xml:2:61 unset-key",
        "acts/a.xml:3:39 wrong-type",
        "acts/a.xml:4:44 template",
    ]
    assert "did you mean `name`?" in result.diagnostics[0].message
    assert "only for texts" in result.diagnostics[2].message


@pytest.mark.parametrize(
    ("typed", "expected"),
    [('Thanks{", "pa', 'Thanks{", "participant}'), ("Thanks {pa", "Thanks {participant}"), ('Thanks{", ', "")],
)
def test_the_say_line_completes_a_key_behind_a_separator(typed: str, expected: str) -> None:
    assert complete_speech(typed, (), (), ["participant"]) == expected
