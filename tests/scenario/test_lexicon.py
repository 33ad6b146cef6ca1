"""The language of a study, and lexicon.toml: how a robot says a word (docs/reference/scenario.md)."""

from __future__ import annotations

from pathlib import Path

import pytest

from rise_engine.scenario.loader import load
from rise_engine.scenario.model import LexiconTable
from rise_engine.scenario.reading.lexicon import MAX_LENGTH, MAX_WORDS
from rise_engine.scenario.serialization import decode_scenario, encode_scenario
from rise_engine.scenario.speech.languages import language_problem

from .folders import SPEECH, act, folder, found, loaded

ENGLISH = 'language = "en"\n'
GERMAN = SPEECH.replace("</message>", "</message><language>de-AT</language>")


def findings(path: Path, lexicon: str, toml: str = ENGLISH, speech: str = SPEECH) -> list[str]:
    files: dict[str, str | bytes] = {"scenario.toml": toml, "acts/a.xml": act(speech), "lexicon.toml": lexicon}
    return found(loaded(path, files))


def test_words_are_read_by_language_and_robot(tmp_path: Path) -> None:
    lexicon = (
        '[en]\n"Rise" = "rize"\n"Neo-  Lab" = "neo lab"\n[en.pepper]\nRISE = "rice"\n[de]\n"Gru\u0308n" = " gruen "\n'
    )
    files: dict[str, str | bytes] = {
        "scenario.toml": ENGLISH,
        "acts/a.xml": act(SPEECH + GERMAN.replace("1<", "2<")),
        "lexicon.toml": lexicon,
    }
    scenario, warnings = loaded(tmp_path, files)
    assert scenario is not None and warnings == []
    assert scenario.language == "en"
    assert scenario.lexicon == (
        LexiconTable("en", "", {"Rise": "rize", "Neo- Lab": "neo lab"}),
        LexiconTable("en", "pepper", {"RISE": "rice"}),
        LexiconTable("de", "", {"Gr\u00fcn": "gruen"}),
    )
    again = decode_scenario(encode_scenario(scenario))
    assert again.lexicon == scenario.lexicon and again.language == "en"


def test_a_copy_is_the_same_study_and_another_lexicon_another_one(tmp_path: Path) -> None:
    files: dict[str, str | bytes] = {"scenario.toml": ENGLISH, "acts/a.xml": act(SPEECH)}
    without = loaded(tmp_path / "a", files).scenario
    read = load(folder(tmp_path / "b", {**files, "lexicon.toml": '[en]\nRise = "rize"\n'}))
    copy = load(folder(tmp_path / "c", dict(read.files)))
    assert without is not None and read.scenario is not None and copy.scenario is not None
    assert "lexicon.toml" in read.files and copy.scenario.lexicon == read.scenario.lexicon
    assert copy.scenario.hash == read.scenario.hash != without.hash


@pytest.mark.parametrize(
    ("lexicon", "expected"),
    {
        "nothing": ("", []),
        "comments": ("# words\n", []),
        "a word without language": ('Rise = "rize"\n', ["1:1 wrong-type"]),
        "no language": ('[english]\nRise = "rize"\n', ["1:2 unknown-language"]),
        "one language twice": ('[en]\nRise = "rize"\n[EN]\nRISE = "rize"\n', ["3:2 duplicate-key"]),
        "no text": ("[en]\nRise = 5\n", ["2:8 wrong-type"]),
        "a list": ('[en]\nRise = ["rize"]\n', ["2:8 wrong-type"]),
        "said by nobody": ('[en]\nRise = " "\n', ["2:8 missing-value"]),
        "no word": ('[en]\n" " = "rize"\n', ["2:7 missing-value"]),
        "twice for TOML": ('[en]\nRise = "rize"\nRise = "rice"\n', ["3:1 duplicate-key"]),
        "twice for the ear": ('[en]\n"Rise up" = "a"\n"Rise  up" = "b"\n', ["3:1 duplicate-key"]),
        "twice in Unicode": ('[en]\n"f\u00fcr" = "a"\n"fu\u0308r" = "b"\n', ["3:1 duplicate-key"]),
        "once for each robot": ('[en]\nRise = "a"\n[en.nao]\nRise = "b"\n[en.pepper]\nRise = "c"\n', []),
        "a robot that there is not": ('[en.peper]\nRise = "a"\n', ["1:5 no-effect"]),
        "a point without quotation marks": ('[en]\ne.g = "for example"\n', ["2:1 no-effect"]),
        "said as it is written": ('[en]\nRise = "Rise"\n', ["2:1 no-effect"]),
        "tables in a robot": ('[en.nao.x]\nRise = "a"\n', ["1:9 wrong-type"]),
        "too long": (f'[en]\nRise = "{"a" * (MAX_LENGTH + 1)}"\n', ["2:8 out-of-range"]),
        "as long as may be": (f'[en]\nRise = "{"a" * MAX_LENGTH}"\n', []),
        "too many": ("[en]\n" + "".join(f'w{n} = "a"\n' for n in range(MAX_WORDS + 1)), ["1:1 too-large"]),
        "as many as may be": ("[en]\n" + "".join(f'w{n} = "a"\n' for n in range(MAX_WORDS)), []),
        "not TOML": ("[en]\nRise = rize\nRISE = 5\n", ["2:8 toml-syntax", "3:8 wrong-type"]),
        "another language besides": ('[de]\nRise = "Reis"\n[en]\nRise = "rize"\n[fr]\nRise = "raïse"\n', []),
        "another language": ('[fr]\nRise = "raïse"\n', ["1:2 no-effect"]),
        "a region of another country": ('[en-US]\nRise = "rize"\n', ["1:2 no-effect"]),
    }.values(),
)
def test_what_is_found(tmp_path: Path, lexicon: str, expected: list[str]) -> None:
    assert findings(tmp_path, lexicon) == [f"lexicon.toml:{each}" for each in expected]


@pytest.mark.parametrize(
    ("toml", "speech", "expected"),
    [
        (ENGLISH, SPEECH, []),
        ('language = "en-GB"\n', SPEECH, []),
        ("", SPEECH, ["lexicon.toml:1:2 no-effect"]),
        ('language = "de"\n', SPEECH, ["lexicon.toml:1:2 no-effect"]),
        ("", GERMAN, ["lexicon.toml:1:2 no-effect"]),
        ("", GERMAN.replace("de-AT", "en"), []),
        ("", GERMAN.replace("de-AT", "{tongue|de}"), []),  # nobody can know
    ],
)
def test_a_language_in_which_nothing_is_said(tmp_path: Path, toml: str, speech: str, expected: list[str]) -> None:
    assert findings(tmp_path, '[en]\nRise = "rize"\n', toml, speech) == expected


def test_the_sentences_say_what_to_write(tmp_path: Path) -> None:
    def told(lexicon: str, toml: str = ENGLISH) -> str:
        files: dict[str, str | bytes] = {"scenario.toml": toml, "acts/a.xml": act(SPEECH), "lexicon.toml": lexicon}
        return loaded(tmp_path, files).diagnostics[0].message

    assert told('[en.peper]\na = "b"\n') == ("there is no robot `peper`, so no robot says this; did you mean `pepper`?")
    assert told('[en]\nDr.Smith = "b"\n').endswith("a word with a point in it needs quotation marks")
    assert told('[en]\na = "b"\n', "") == (
        'nothing in this study is said in `en`. scenario.toml sets the language of the acts: language = "en"'
    )
    assert (
        told('a = "b"\n')
        == 'a word belongs under its language; write "WORD" = "how it is said", under its language: [en]'
    )


@pytest.mark.parametrize(
    ("written", "expected"),
    [
        ('"en"', []),
        ('"de-AT"', []),
        ('"zh-Hant-TW"', []),
        ('"sl-rozaj-biske"', []),
        ('"en-a-bbb-x-lab"', []),
        ('"gsw"', []),
        ('""', ["1:12 unknown-language"]),
        ('"english"', ["1:12 unknown-language"]),
        ('"en_US"', ["1:12 unknown-language"]),
        ('"xx"', ["1:12 unknown-language"]),
        ('"en US"', ["1:12 unknown-language"]),
        ("5", ["1:12 wrong-type"]),
    ],
)
def test_the_language_of_a_study(tmp_path: Path, written: str, expected: list[str]) -> None:
    result = loaded(tmp_path, {"scenario.toml": f"language = {written}\n"})
    assert found(result) == [f"scenario.toml:{each}" for each in expected]
    if not expected:
        assert result.scenario is not None and result.scenario.language == written.strip('"')


def test_no_language_is_a_language_too(tmp_path: Path) -> None:
    scenario = loaded(tmp_path, {"scenario.toml": ""}).scenario
    assert scenario is not None and scenario.language == "" and scenario.lexicon == ()


@pytest.mark.parametrize(
    ("tag", "problem"),
    [
        ("German", "`German` is not a language tag; write de"),
        ("dk", "`dk` is not a language tag; write da"),
        ("en_GB", "`en_GB` is not a language tag; write en-GB"),
        ("e", "`e` is not a language tag; write it as in en, de or pt-BR (BCP 47)"),
        ("no-Such-Thing-", "`no-Such-Thing-` is not a language tag; write it as in en, de or pt-BR (BCP 47)"),
    ],
)
def test_what_is_said_of_a_tag(tag: str, problem: str) -> None:
    assert language_problem(tag) == problem


def test_a_finding_that_is_meant_can_be_silenced(tmp_path: Path) -> None:
    lexicon = '# check: allow no-effect: our other lab has it\n[en.reachy]\nRise = "rize"\n'
    assert findings(tmp_path, lexicon) == []
