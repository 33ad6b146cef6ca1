from __future__ import annotations

import pytest
from rich.cells import cell_len

from rise_tui.rendering.text import (
    align_at_both_ends,
    clean,
    crop,
    fit,
    format_age,
    format_clock,
    format_duration,
    format_seconds,
    format_value,
    line_width,
    parse_typed_value,
    plain_text,
    quoted,
)


@pytest.mark.parametrize(
    ("text", "value", "kind"),
    [
        ("3", 3, "integer"),
        (" 3 ", 3, "integer"),
        ("-0.5e3", -500.0, "number"),
        ("true", True, "boolean"),
        ("True", "True", "string"),
        ("null", None, "null"),
        ("", "", "string"),
        ("the fork", "the fork", "string"),
        ('"5"', "5", "string"),
        ("NaN", "NaN", "string"),
        ("Infinity", "Infinity", "string"),
        ("1e999", "1e999", "string"),
        ("[1, null]", [1, None], "array"),
        ("{}", {}, "object"),
        ('{"a": 1, "a": 2}', '{"a": 1, "a": 2}', "string"),
        ("[" * 100_000, "[" * 100_000, "string"),
    ],
)
def test_the_type_of_a_typed_text(text: str, value: object, kind: str) -> None:
    assert parse_typed_value(text)[:2] == (value, kind)


@pytest.mark.parametrize("text", ["{", '{"a": }', '"abc', "[1,]", '{"a": 1, "a": 2}'])
def test_what_looks_like_json_and_is_none_says_so(text: str) -> None:
    assert parse_typed_value(text)[2].startswith("not JSON")


@pytest.mark.parametrize(
    "value", [None, True, 3, 2.5, "fork", "5", "true", "", " x ", "null", '"', [1, "a"], {"a": {"b": 1}}, "a\nb"]
)
def test_what_is_shown_for_editing_reads_back_as_the_same_value(value: object) -> None:
    assert parse_typed_value(format_value(value))[0] == value


@pytest.mark.parametrize(
    "text",
    [
        "short",
        "exactly ten",
        "much longer than the cell",
        "日本語のとても長い文章です",
        "a\x1b[31mb",
        "e\u0301" * 20,
        "",
    ],
)
@pytest.mark.parametrize("width", [0, 1, 2, 7, 11, 12])
def test_a_cell_is_exactly_as_wide_as_it_should_be(text: str, width: int) -> None:
    assert cell_len(fit(text, width)) == width
    assert cell_len(fit(text, width, right=True)) == width


def test_nothing_that_a_file_contains_can_move_the_cursor_or_hide() -> None:
    assert clean("a\x1b[2Jb\r\n\u202ec\x00") == "a·[2Jb·⏎·c·"


def test_lines_are_cropped_and_spread() -> None:
    line = (("left part", "plain"), (" and more", "muted"))
    assert plain_text(crop(line, 12)) == "left part a…"
    assert line_width(align_at_both_ends(line, (("right", "plain"),), 14)) == 14
    assert plain_text(align_at_both_ends((("a", "plain"),), (("b", "plain"),), 5)) == "a   b"


@pytest.mark.parametrize(
    ("value", "text"),
    [(0, "0.0"), (6.44, "6.4"), (59.94, "59.9"), (59.96, "1:00"), (185, "3:05"), (3727, "1:02:07"), (-1, "0.0")],
)
def test_durations(value: float, text: str) -> None:
    assert format_seconds(value) == text


def test_times() -> None:
    assert format_clock(872.15) == "00:14:32"
    assert format_clock(872.15, tenths=True) == "00:14:32.1"
    assert [format_age(value) for value in (0, 59, 60, 3599, 7200)] == ["0 s", "59 s", "1 min", "59 min", "2 h"]
    assert format_duration(6.4) == "6.4 s" and format_duration(61) == "1:01"


@pytest.mark.parametrize(
    ("text", "shown"),
    [("Hello.", "“Hello.”"), ("“Yes?”, she said.", "“Yes?”, she said."), ("„Ja?“", "„Ja?“"), ("", "“”")],
)
def test_words_that_bring_their_own_quotation_marks_get_no_second_ones(text: str, shown: str) -> None:
    assert quoted(text) == shown
