"""Words that are to go, in every way in which they can be written."""

from __future__ import annotations

import json
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.base.words import WordError, Words, parse_replacement


def words(*replacements: str, whole: bool = False, case: bool = False) -> Words:
    return Words(map(parse_replacement, replacements), whole_words=whole, match_case=case)


@pytest.mark.parametrize(
    "text",
    [
        "Müller",
        "MÜLLER",
        "müller",
        "Mu\u0308ller",
        r"M\u00fcller",
        r"M\u00FCller",
        r"M\\u00fcller",
        "M&#252;ller",
        "M&#xFC;ller",
        "M&uuml;ller",
    ],
)
def test_every_way_to_write_it(text: str) -> None:
    assert words("Müller=NAME1").replace(f"Frau {text}!") == "Frau NAME1!"


def test_characters_beyond_the_first_plane() -> None:
    assert words("😀x=N1").replace(json.dumps("a😀x")) == '"aN1"'


def test_the_longest_comes_first_and_blanks_are_any_blanks() -> None:
    found = words("Anna=A1", "Anna Berg=A2", "Berg=A3")
    assert found.replace("Anna  Berg, Anna\u00a0Berg, Anna\nBerg, Anna, Berg") == "A2, A2, A2, A1, A3"


def test_within_longer_words() -> None:
    assert words("Anna=A1").replace("Annas ANNALENA") == "A1s A1LENA"
    found = words("Anna=A1", whole=True)
    text = "Anna, Annas, R_Anna, (anna) \\nAnna"
    assert found.replace(text) == "A1, Annas, R_Anna, (A1) \\nA1"
    assert found.longer_words("Anna, Annas, R_Anna") == ["Annas", "R_Anna"]


def test_case_can_be_kept() -> None:
    assert words("Will=W1", case=True).replace("Will says: I will") == "W1 says: I will"


@pytest.mark.parametrize(
    ("given", "part"),
    [
        ("Maria", "write --replace Maria=NAME1"),
        ("=NAME1", "no word before"),
        ("  =NAME1", "no word before"),
        ("A=NAME1", "one character only"),
        ("..=NAME1", "no letter and no digit"),
        ("Maria=", "cannot be a replacement"),
        ("Maria=Frau Ä", "cannot be a replacement"),
    ],
)
def test_what_cannot_be_replaced(given: str, part: str) -> None:
    with pytest.raises(WordError, match=part):
        parse_replacement(given)


def test_words_that_contradict_one_another() -> None:
    with pytest.raises(WordError, match="both 'A1' and 'A2'"):
        words("Anna=A1", "anna=A2")
    with pytest.raises(WordError, match="contains a word to replace"):
        words("Anna=Maria1", "Maria=X1")
    with pytest.raises(WordError, match="name the words to replace"):
        words()


def test_what_is_left_over_makes_no_word() -> None:
    with pytest.raises(WordError, match="make up one of the words"):
        words("bN1=XX", "aab=N1").replace("baab")


def test_keys_of_objects() -> None:
    found = words("Anna=A1")
    assert found.replace_in({"Anna": ["anna", 1], "b": {"x Anna": None}}) == {"A1": ["A1", 1], "b": {"x A1": None}}
    with pytest.raises(WordError, match="the same"):
        found.replace_in({"Anna": 1, "A1": 2})


LETTERS = st.text(st.sampled_from("abzäßéüøşİıΣжйﬁ漢😀'-"), min_size=2, max_size=6).filter(
    lambda word: any(map(str.isalnum, word))
)


@given(LETTERS, st.text(max_size=5), st.text(max_size=5), st.integers(0, 3))
def test_nothing_is_left_however_it_was_encoded(word: str, before: str, after: str, depth: int) -> None:
    found = words(f"{word}=QX9")
    for form in ("NFC", "NFD"):
        text = before + unicodedata.normalize(form, word) + after
        for _ in range(depth):
            text = json.dumps(text)
        replaced = found.replace(text)
        assert not found.find(replaced)
        assert unicodedata.normalize(form, word) not in replaced
