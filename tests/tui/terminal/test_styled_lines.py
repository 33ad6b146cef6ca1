"""Painting a line: every character in its place and its role, in as few pieces as can be."""

from __future__ import annotations

from itertools import pairwise

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.style import Style
from textual.app import App
from textual.strip import Strip

from rise_tui.rendering import themes
from rise_tui.rendering.text import StyledLine, TextRole, clean, plain_text
from rise_tui.widgets.lines import CURSOR_BACKGROUND, STYLE_SPECS, UNFOCUSED_CURSOR_BACKGROUND, StyledLines

TEXTS = st.text(st.sampled_from("ab  é日\n\x1b"), max_size=6)
LINES = st.lists(st.tuples(TEXTS, st.sampled_from(sorted(STYLE_SPECS))), max_size=6).map(tuple)
GROUNDS = st.sampled_from(["", CURSOR_BACKGROUND, UNFOCUSED_CURSOR_BACKGROUND])


def looks(strip: Strip) -> list[tuple[str, Style]]:
    """Each character and how it looks; of a blank only what can be seen of it."""
    found = []
    for segment in strip:
        style = segment.style
        assert style is not None
        bare = style.reverse or style.underline
        blank = style if bare else Style(bgcolor=style.bgcolor)
        found += [(each, blank if each == " " else style) for each in segment.text]
    return found


@pytest.fixture(scope="module", params=["dark", "mono"])
def widget(request: pytest.FixtureRequest) -> StyledLines:
    """It has its colours from an app, and need not be anywhere in it."""

    class Alone(StyledLines):
        @property
        def app(self) -> App[None]:
            return app

    class Themed(App[None]):
        def get_theme_variable_defaults(self) -> dict[str, str]:
            return themes.DARK.variables

    app = Themed()
    for theme in themes.THEMES:
        app.register_theme(theme)
    app.theme = themes.full_name(request.param)
    return Alone()


@example(line=(("a", "plain"), ("", "alarm"), ("b", "plain")), width=9, ground="")
@given(line=LINES, width=st.integers(0, 40), ground=GROUNDS)
def test_a_painted_line(widget: StyledLines, line: StyledLine, width: int, ground: str) -> None:
    strip = widget.to_strip(line, width, ground)
    shown = "".join(segment.text for segment in strip)
    assert cell_len(shown) == strip.cell_length == width
    text = clean(plain_text(line))
    if cell_len(text) <= width:
        assert shown == text + " " * (width - cell_len(text))
        one_by_one = [
            each
            for text, role in line
            for each in looks(widget.to_strip(((text, role),), cell_len(clean(text)), ground))
        ]
        assert looks(strip)[: len(text)] == one_by_one
        assert all(segment.text for segment in strip)
        assert all(one.style != other.style for one, other in pairwise(strip))


@pytest.mark.parametrize("role", ["alarm", "call"])
def test_what_must_be_seen_looks_the_same_under_the_cursor(widget: StyledLines, role: TextRole) -> None:
    line: StyledLine = (("stop not confirmed", role),)
    assert looks(widget.to_strip(line, 18, CURSOR_BACKGROUND)) == looks(widget.to_strip(line, 18))
    assert looks(widget.to_strip((("x", "plain"),), 1, CURSOR_BACKGROUND)) != looks(
        widget.to_strip((("x", "plain"),), 1)
    )
