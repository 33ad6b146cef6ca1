"""A condition while it is typed."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.expression import Expression, ExpressionError
from rise_tui.editor.model.fields import FieldNote
from rise_tui.editor.model.study_names import condition_notes, suggest_ending
from tests.tui.editor.small_study import small_study

NAMES = small_study()


def notes(text: str) -> list[FieldNote]:
    return condition_notes(text, NAMES)


def test_an_unfinished_condition_is_read_as_far_as_it_goes() -> None:
    assert notes("step < 4 and not ") == [
        ("info", "so far read as step < 4; step is 0 at the start: true"),
    ]


def test_brackets_are_shown_where_they_say_more_than_the_text() -> None:
    assert notes("step < 4 and not happy or mood") == [
        ("info", "read as ((step < 4) and (not happy)) or mood"),
        ("info", "happy is false, mood is not set, step is 0 at the start: true"),
    ]
    assert notes("step = 1") == [("info", "step is 0 at the start: false")]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("true", ("info", "always true")),
        ("rand(6) > 3", ("info", "chance decides each time")),
        ("session.speaking", ("info", "`session.speaking` is known when a session runs")),
        ("words[0].word = 'a'", ("info", "words[0].word is “a” at the start: true")),
    ],
)
def test_what_is_said(text: str, expected: tuple[str, str]) -> None:
    assert expected in notes(text)


def test_what_cannot_be_worked_out_says_why_in_a_sentence() -> None:
    (note,) = (note for note in notes("items[5] = 1"))
    assert note.text.startswith("these values give no result: `items` has the entries 0 to 1, and no 5")


@pytest.mark.parametrize(
    ("text", "ending"),
    [
        ("step < 4 and not hap", "py"),
        ("pau", "se_ms"),
        ("step sta", "rts with"),
        ("leng", "th("),
        ("'hap", ""),
        ("", ""),
    ],
)
def test_the_word_that_is_begun_is_completed(text: str, ending: str) -> None:
    assert suggest_ending(text, [key.value for key in NAMES.key_choices()]) == ending


@given(st.text(st.sampled_from("abstep<>=!()[]'\" 0123.andortuhpy,"), max_size=30))
def test_a_reading_agrees_with_the_parser(text: str) -> None:
    found = notes(text)
    try:
        expression = Expression.parse(text.strip())
    except ExpressionError:
        assert all(note.text.startswith("so far read as") for note in found)
    else:
        assert found and Expression.parse(expression.with_all_brackets)
