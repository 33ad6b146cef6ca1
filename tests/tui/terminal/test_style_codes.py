from __future__ import annotations

import pyte
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.color import ColorSystem
from rich.control import Control
from rich.style import Style

from rise_tui.rendering.cell_buffer import shorten_styles

COLOURS = (None, "red", "bright_blue", "color(246)", "color(23)", "#102030", "default")
STYLES = st.builds(
    Style,
    color=st.sampled_from(COLOURS),
    bgcolor=st.sampled_from(COLOURS),
    bold=st.booleans(),
    italic=st.booleans(),
    underline=st.booleans(),
    reverse=st.booleans(),
)
PIECES = st.lists(
    st.tuples(st.sampled_from(["a", "bc ", "  ", " ", "─┤", "x1m"]), STYLES, st.none() | st.integers(0, 30)), max_size=9
)


def shown(codes: str) -> list[object]:
    """What a terminal makes of it; the colour of a blank counts only where it is seen."""
    screen = pyte.Screen(40, 2)
    pyte.Stream(screen).feed(codes + "|")  # behind it nothing must be left of a style
    cells = [screen.buffer[0][column] for column in range(40)]
    return [
        cell._replace(fg="", bold=False, italics=False)
        if cell.data == " " and not (cell.reverse or cell.underscore)
        else cell
        for cell in cells
    ]


@given(PIECES, st.sampled_from([ColorSystem.STANDARD, ColorSystem.EIGHT_BIT, ColorSystem.TRUECOLOR]))
def test_it_looks_the_same(pieces: list[tuple[str, Style, int | None]], system: ColorSystem) -> None:
    codes = "".join(
        ("" if column is None else Control.move_to(column, 0).segment.text) + style.render(text, color_system=system)
        for text, style, column in pieces
    )
    short = shorten_styles(codes)
    assert shown(short) == shown(codes)
    assert len(short) <= len(codes) + len("\x1b[0m")


@pytest.mark.parametrize(
    ("codes", "short"),
    [
        ("\x1b[1;38;5;9;48;5;2mab\x1b[0m\x1b[1;38;5;9;48;5;2mc\x1b[0m", "\x1b[1;38;5;9;48;5;2mabc\x1b[0m"),
        ("\x1b[38;5;9;48;5;2ma\x1b[0m\x1b[38;5;7;48;5;2m  \x1b[0m", "\x1b[38;5;9;48;5;2ma  \x1b[0m"),
        ("\x1b[38;5;9;48;5;2ma\x1b[0m\x1b[38;5;7;48;5;2mb\x1b[0m", "\x1b[38;5;9;48;5;2ma\x1b[38;5;7mb\x1b[0m"),
        ("\x1b[1;31ma\x1b[0m\x1b[31mb\x1b[0m", "\x1b[1;31ma\x1b[0;31mb\x1b[0m"),
        ("plain", "plain"),
        ("", ""),
    ],
)
def test_only_what_changes_is_written(codes: str, short: str) -> None:
    assert shorten_styles(codes) == short
