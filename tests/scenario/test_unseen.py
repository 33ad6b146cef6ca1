"""Characters that nobody sees, names that look alike, files that git could not join: named, with place and remedy."""

from __future__ import annotations

from pathlib import Path
from unicodedata import normalize

import pytest
from lxml import etree

from rise_engine.base.nearest_name import did_you_mean, lookalike_note
from tests.scenario.folders import SPEECH, act, found, loaded, rule

RULE = '<InteractionRule name="R" initial="S">\n<State id="S">{}</State>\n</InteractionRule>'
BLANKS = ["\u00a0", "\u0085", "\u2028", "\u3000", "\u200b", "\u2003", "\ufeff"]


@pytest.mark.parametrize("blank", BLANKS, ids=ascii)
def test_a_blank_that_xml_does_not_know_between_tags(tmp_path: Path, blank: str) -> None:
    result = loaded(tmp_path, {"rules/r.xml": RULE.format(f"<onEntry/>\n {blank}<onExit/>")})
    (diagnostic,) = result.diagnostics
    assert (diagnostic.code, str(diagnostic.location)) == ("unexpected-text", "rules/r.xml:3:2")
    assert f"U+{ord(blank):04X}" in diagnostic.message and "delete it" in diagnostic.message


def test_its_place_behind_comments_and_as_an_entity(tmp_path: Path) -> None:
    stray = {
        "<!-- a -->\u00a0": "rules/r.xml:2:25",
        "&#xA0;": "rules/r.xml:2:15",
        "<![CDATA[\n\u00a0]]>": "rules/r.xml:3:1",
        "<onEntry/> <!-- a --> &#160;": "rules/r.xml:2:37",
        "<onEntry>\u00a0</onEntry>": "rules/r.xml:2:24",
    }
    for number, (text, location) in enumerate(stray.items()):
        result = loaded(tmp_path / str(number), {"rules/r.xml": RULE.format(text)})
        assert found(result) == [f"{location} unexpected-text"], text


@pytest.mark.parametrize(
    ("text", "location"),
    [
        ("?" + RULE, "1:1"),
        (RULE + "\n?", "4:1"),
        (RULE.replace("State id", "State?id"), "2:7"),
        (RULE.replace("id=", "id?="), "2:10"),
        (RULE.replace("name=", "name= ?"), "1:24"),
        (RULE.replace('" initial', '"?initial'), "1:26"),
        (RULE.replace("</State>", "</State?>"), "2:22"),
        (RULE.replace("<State", "<?State"), "2:2"),
    ],
)
@pytest.mark.parametrize("blank", ["\u00a0", "\u2028"], ids=ascii)
def test_a_blank_that_xml_does_not_know_within_a_tag_or_around_all(
    tmp_path: Path, blank: str, text: str, location: str
) -> None:
    result = loaded(tmp_path, {"rules/r.xml": text.replace("?", blank).format("")})
    named = [diagnostic for diagnostic in result.diagnostics if f"U+{ord(blank):04X}" in diagnostic.message]
    assert [str(diagnostic.location) for diagnostic in named] == [f"rules/r.xml:{location}"]
    assert len(result.errors) == 1


def test_beside_continue(tmp_path: Path) -> None:
    """The schema for editors knows blanks of XML only, and so do the checks."""
    speech = SPEECH.replace("<message>", "<onFailure>\u00a0continue</onFailure><message>")
    result = loaded(tmp_path, {"acts/a.xml": act(speech)})
    assert found(result) == ["acts/a.xml:2:42 wrong-value"]
    assert "U+00A0 (NO-BREAK SPACE)" in result.diagnostics[0].message


@pytest.mark.parametrize("character", ["\u200d", "\ufeff", "\U0001f600", "\u2c00"], ids=ascii)
@pytest.mark.parametrize("where", ["id{}", "State{}"])
def test_a_name_that_only_one_parser_accepts(tmp_path: Path, character: str, where: str) -> None:
    """libxml2 goes by the fifth edition of XML, expat by the fourth."""
    text = RULE.format("").replace(where.format(""), where.format(character))
    etree.fromstring(text.encode())
    result = loaded(tmp_path, {"rules/r.xml": text})
    (diagnostic,) = result.diagnostics
    assert diagnostic.code == "not-well-formed" and f"U+{ord(character):04X}" in diagnostic.message
    assert str(diagnostic.location) == f"rules/r.xml:2:{7 if where.startswith('State') else 10}"


def test_a_second_byte_order_mark(tmp_path: Path) -> None:
    result = loaded(tmp_path, {"rules/r.xml": "\ufeff\ufeff" + RULE.format("<foo/>")})
    assert "rules/r.xml:2:15 unknown-element" in found(result)


def test_lone_carriage_returns_end_no_line(tmp_path: Path) -> None:
    """Neither for the text editor nor for `git` are they one; the places of all parsers agree."""
    text = (
        "<InteractionRule name='R'\r initial='S'>\r\n<State id='S'>\r\r<onEntry>\r<foo/>\n<function a='ä\r\rb'\rx='1'/>"
    )
    result = loaded(tmp_path, {"rules/r.xml": text + "</onEntry></State></InteractionRule>"})
    assert found(result) == [
        "rules/r.xml:2:27 unknown-element",
        "rules/r.xml:3:11 unknown-attribute",
        "rules/r.xml:3:20 unknown-attribute",
    ]


def test_letters_of_several_bytes(tmp_path: Path) -> None:
    text = '<InteractionRule name="Grüße 😀" initial="Ä">\n<State id="Ä"><onEntry>ü<foo/></onEntry>😀</State>'
    assert found(loaded(tmp_path, {"rules/r.xml": text + "</InteractionRule>"})) == [
        "rules/r.xml:2:24 unexpected-text",
        "rules/r.xml:2:25 unknown-element",
        "rules/r.xml:2:41 unexpected-text",
    ]


# --- git ------------------------------------------------------------------------------------------------------------

CONFLICT = "<<<<<<< HEAD\n{}\n=======\n{}\n>>>>>>> other\n"


@pytest.mark.parametrize(
    ("file", "text", "line"),
    [
        ("rules/r.xml", RULE.format("\n" + CONFLICT.format("<onEntry/>", "<onExit/>")), 3),
        ("acts/a.xml", CONFLICT.format(act(SPEECH), act("")), 1),
        ("memory.json", "{\n" + CONFLICT.format('"a": 1', '"a": 2').replace("\n", "\r\n") + "}", 2),
        ("scenario.toml", CONFLICT.format('title = "a"', 'title = "b"').replace(" HEAD", ""), 1),
    ],
)
def test_a_merge_that_was_not_resolved(tmp_path: Path, file: str, text: str, line: int) -> None:
    result = loaded(tmp_path, {file: text})
    assert found(result) == [f"{file}:{line}:1 merge-conflict"]
    assert ">>>>>>>" in result.diagnostics[0].message and "keep one" in result.diagnostics[0].message


@pytest.mark.parametrize("file", ["rules/r.xml", "acts/a.xml", "memory.json", "scenario.toml", "texts/de.toml"])
def test_several_conflicts_are_one_finding_and_nothing_follows_from_it(tmp_path: Path, file: str) -> None:
    files = {
        "acts/a.xml": act(SPEECH, "R_Hello"),
        "rules/r.xml": RULE.format('<onEntry><function startCommunicationRobotAct="R_Hello"/>'
                                   '<function assignValue="score = score + 1"/></onEntry>'
                                   '<transition eventTopic="/go"/>'),
        "memory.json": '{"score": 1}',
        "scenario.toml": 'language = "en"\n[keys]\ng = { event = "/go" }\nh = { act = "R_Hello" }\n',
        "texts/de.toml": '[R_Hello]\n1 = { text = "Hallo", of = "Hello" }\n',
    }  # fmt: skip
    before = loaded(tmp_path / "before", files)
    assert before.errors == []
    files[file] = "\n" + CONFLICT.format("a", "b") + files[file] + "\n" + CONFLICT.format("c", "d") * 7
    result = loaded(tmp_path / "after", files)
    new = [each for each in found(result) if each not in found(before)]
    assert new == [f"{file}:2:1 merge-conflict"]
    lines = files[file][: files[file].index("\nc\n")].count("\n") + 1
    message = result.errors[0].message
    assert f"it has more of them, in line {lines}, {lines + 5}, {lines + 10}," in message
    assert message.endswith(", ...")


def test_only_the_first_mark_is_left(tmp_path: Path) -> None:
    result = loaded(tmp_path, {"rules/r.xml": RULE.format("\n<<<<<<< HEAD\n<onEntry/>")})
    assert found(result) == ["rules/r.xml:3:1 merge-conflict"]


def test_what_only_looks_like_one(tmp_path: Path) -> None:
    text = RULE.format("<!--\n<<<<<<< see below\n-->").replace("<State", "<!--\n=======\n--><State")
    assert loaded(tmp_path, {"rules/r.xml": text}).diagnostics == []


# --- names that look alike ------------------------------------------------------------------------------------------

WHOLE, APART = "Grün", normalize("NFD", "Grün")


def test_a_letter_with_an_accent_as_one_character_and_as_two(tmp_path: Path) -> None:
    body = f'<State id="S"><transition cond="a" target="{APART}"/></State><State id="{WHOLE}"/>'
    result = loaded(tmp_path, {"rules/r.xml": rule(body)})
    (message,) = [diagnostic.message for diagnostic in result.errors]
    assert "two characters, U+0075 (LATIN SMALL LETTER U) and U+0308 (COMBINING DIAERESIS) here" in message
    assert "as U+00FC (LATIN SMALL LETTER U WITH DIAERESIS) there; copy the name from there" in message


def test_also_the_names_of_acts_and_in_settings(tmp_path: Path) -> None:
    files = {"acts/a.xml": act(SPEECH, WHOLE), "scenario.toml": f'[keys]\n1 = {{ act = "{APART}" }}\n'}
    (message,) = [diagnostic.message for diagnostic in loaded(tmp_path, files).errors]
    assert "two characters" in message and "U+00FC" in message


@pytest.mark.parametrize(
    ("word", "known", "message"),
    [
        (WHOLE, APART, "U+0308"),
        ("Ende\u00a0A", "Ende A", "U+00A0 (NO-BREAK SPACE)"),
        ("Gruß\u200b", "Gruß", "U+200B (ZERO WIDTH SPACE)"),
        ("Stаte", "State", "U+0430 (CYRILLIC SMALL LETTER A)"),
        ("Grun", "Grün", ""),
        ("gruß", "Gruß", ""),
        ("State", "Stage", ""),
    ],
)
def test_what_makes_names_different(word: str, known: str, message: str) -> None:
    assert (message in lookalike_note(word, known)) and bool(lookalike_note(word, known)) == bool(message)
    assert did_you_mean(word, [known]).startswith(f"; did you mean `{known}`?")


def test_a_memory_key_in_two_characters(tmp_path: Path) -> None:
    files = {
        "memory.json": f'{{"{APART}": 1}}',
        "rules/r.xml": RULE.format(f'<transition cond="{APART} = 1" target="S"/>'),
    }
    first, second = loaded(tmp_path, files).diagnostics
    assert first.code == "unwritable-key" and f'write "{WHOLE}"' in first.message
    assert second.code == "condition" and "type it again as one character: `ü`" in second.message


def test_of_two_names_alike_the_same_one_is_named_whatever_order_they_have() -> None:
    names = ["Conversation_Over", "conversation_over", "conversation.over"]
    told = {
        did_you_mean("/conversation_over", set(each)) for each in (names, names[::-1], [*names, *map(str, range(99))])
    }
    assert told == {"; did you mean `Conversation_Over`?"}
