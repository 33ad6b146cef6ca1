"""Typographic quotation marks and blanks of other widths are named, where they stand, with what to write instead."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.commands import typed
from tests.scenario.folders import act, found, in_state, loaded

MEMORY = '{"a": 1}'
RULE = '<InteractionRule name=“R” initial="S"><State id="S"/></InteractionRule>'
# A file, its text, and at which location which character is named.
CASES: list[tuple[str, str, str, str]] = [
    ("scenario.toml", "title = “Hallo”\n", "1:9 toml-syntax", "`“`"),
    ("scenario.toml", 'title = „Hallo“\nmode = "debug"\n', "1:9 toml-syntax", "`„`"),
    ("scenario.toml", "title = «Salut»\n", "1:9 toml-syntax", "`«`"),
    ("scenario.toml", 'title = "Hallo”\n', "1:15 toml-syntax", "`”`"),
    ("scenario.toml", "title = 'Hallo’\nmode = 'debug'", "1:15 toml-syntax", "`’`"),
    ("scenario.toml", "[study]\nconditions = [‘A’]\n", "2:15 toml-syntax", "`‘`"),
    ("scenario.toml", '[keys]\n“1” = { event = "a" }\n', "2:1 toml-syntax", "`“`"),
    ("scenario.toml", 'title\u00a0= "x"\n', "1:6 toml-syntax", "U+00A0 (NO-BREAK SPACE)"),
    ("scenario.toml", 'title =\u202f"x"\n', "1:8 toml-syntax", "U+202F (NARROW NO-BREAK SPACE)"),
    ("memory.json", "{“a”: 1}", "1:2 json-syntax", "`“`"),
    ("memory.json", '{"a": “x”}', "1:7 json-syntax", "`“`"),
    ("memory.json", '{"a": ’x’}', "1:7 json-syntax", "`’`"),
    ("memory.json", '{"a”: 1}', "1:4 json-syntax", "`”`"),
    ("memory.json", '{"a":\u00a01}', "1:6 json-syntax", "U+00A0 (NO-BREAK SPACE)"),
    ("memory.json", '\u00a0{"a": 1}', "1:1 json-syntax", "U+00A0 (NO-BREAK SPACE)"),
    ("memory.json", '{"a": 1,\u2003"b": 1}', "1:9 json-syntax", "U+2003 (EM SPACE)"),
    ("rules/r.xml", RULE, "1:23 quotes", "`“`"),
    ("rules/r.xml", RULE.replace("“", '"'), "1:25 quotes", "`”`"),
    ("rules/r.xml", RULE.replace("”", '"'), "1:23 quotes", "`“`"),
    ("rules/r.xml", RULE.replace("“", "‚").replace("”", "‘"), "1:23 quotes", "`‚`"),
    ("rules/r.xml", in_state("<if cond=“a &lt; 3 && b”/>").replace("b", "a"), "3:19 quotes", "`“`"),
    ("rules/r.xml", in_state('<if cond="a = ‘x’"/>'), "3:24 condition", "`‘`"),
    ("rules/r.xml", in_state('<if cond="a = \'x’"/>'), "3:26 condition", "`’`"),
    ("rules/r.xml", in_state('<if cond="a\u00a0= 3"/>'), "3:21 odd-blank", "U+00A0 (NO-BREAK SPACE)"),
    ("rules/r.xml", in_state('<function assignValue="a = “x”"/>'), "3:37 assignment", "`“`"),
    ("rules/r.xml", in_state('<function assignValue="{“a”: 1}"/>'), "3:34 assignment", "`“`"),
    ("scenario.toml", '[keys]\na = { set = "a = ’x’" }\n', "2:18 assignment", "`’`"),
]


@pytest.mark.parametrize(("file", "text", "location", "named"), CASES)
def test_it_is_named_where_it_stands(tmp_path: Path, file: str, text: str, location: str, named: str) -> None:
    files: dict[str, str | bytes] = {"memory.json": MEMORY, file: text}
    result = loaded(tmp_path, files)
    assert found(result)[0] == f"{file}:{location}", result.diagnostics
    assert len(result.diagnostics) == 1
    message = result.diagnostics[0].message
    assert named in message and "write" in message


def test_in_texts_they_are_letters_like_others(tmp_path: Path) -> None:
    result = loaded(
        tmp_path,
        {
            "scenario.toml": 'title = "„Hallo“\u00a0du"\n',
            "memory.json": '{"a": "“x”\u00a0’"}',
            "acts/a.xml": act("<Speech><actionID>1</actionID><message>„Hallo“\u00a0du</message></Speech>"),
            "rules/r.xml": in_state("<if cond=\"a = '“x”\u00a0y'\"/>"),
        },
    )
    assert found(result) == []
    assert not any("looks like a blank" in diagnostic.message for diagnostic in result.diagnostics)


def test_on_the_command_line() -> None:
    memory = typed("eval", "a", "--memory", "{“a”: 1}")
    assert memory.exit_code == 2 and "`“` is a typographic quotation mark" in memory.output
    condition = typed("eval", "a = ‘x’")
    assert condition.exit_code == 1 and "`‘` is a typographic quotation mark" in condition.output


def test_with_the_marks_mended_the_rest_is_checked(tmp_path: Path) -> None:
    result = loaded(tmp_path, {"rules/r.xml": RULE.replace('"S"/>', '"S"/><x/>')})
    assert found(result) == ["rules/r.xml:1:23 quotes", "rules/r.xml:1:54 unknown-element"]


def test_another_straight_mark_is_not_taken_for_one(tmp_path: Path) -> None:
    result = loaded(tmp_path, {"rules/r.xml": in_state("<if cond=\"a = 'x' and a = <\"/>")})
    assert all(diagnostic.message for diagnostic in result.diagnostics)
    assert not any("typographic" in diagnostic.message for diagnostic in result.diagnostics)
