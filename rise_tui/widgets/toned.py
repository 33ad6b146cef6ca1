"""How the tones of `rise_tui.text` look: one place where meaning becomes colour, by theme variables only.

Tones and grounds have attributes besides colours (`rise-<name>-style`): all that a theme without colours has.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from rich.segment import Segment
from rich.style import Style
from textual.color import Color
from textual.strip import Strip
from textual.widget import Widget

from rise_tui.text import Line, Tone, cells, clean


class Look(NamedTuple):
    """Names of theme variables."""

    color: str
    background: str = ""
    """Empty: that of the widget."""


LOOKS: dict[Tone, Look] = {
    "plain": Look("foreground"),
    "strong": Look("foreground"),
    "muted": Look("rise-muted"),
    "accent": Look("primary"),
    "key": Look("primary"),
    "wait": Look("warning"),
    "fault": Look("error"),
    "alarm": Look("rise-on-alarm", "error"),
    "call": Look("rise-on-alarm", "warning"),
    "match": Look("foreground"),
}
CURSOR, CURSOR_AWAY = "rise-cursor", "rise-cursor-away"
"""The background of the cursor's row, where the keys go and where they do not."""


class Toned(Widget):
    """A widget that paints lines of toned text.

    The looks are not component classes: Textual works out each of those for each widget whenever it styles it, which
    was a third of the time that a console took to appear.
    """

    _styles_of_tones: dict[Tone, Style] | None = None

    def notify_style_update(self) -> None:
        """The theme or a class changed."""
        self._styles_of_tones = None
        super().notify_style_update()

    def style_of(self, tone: Tone) -> Style:
        known = self._styles_of_tones
        if known is None:
            known = self._styles_of_tones = {}
        style = known.get(tone)
        if style is None:
            look, variables = LOOKS[tone], self.app.theme_variables
            background = _color(variables[look.background]) if look.background else self.background_colors[1]
            color = _color(variables[look.color])
            style = Style(color=color.rich_color, bgcolor=background.rich_color) + self.styles.text_style
            known[tone] = style = style + _attributes(variables.get(f"rise-{tone}-style", "none"))
        return style

    def _ground(self, background: str) -> Style | None:
        """What a row's background adds to the style of its text."""
        if not background:
            return None
        variables = self.app.theme_variables
        color = _color(variables[background]).rich_color
        return Style(bgcolor=color) + _attributes(variables.get(f"{background}-style", "none"))

    def paint(self, line: Line, width: int, background: str = "") -> Strip:
        """A line in exactly `width` cells, on the background that a theme variable names."""
        ground = self._ground(background)
        fill = self.style_of("plain")
        if ground is not None:
            fill += ground
        pieces: list[tuple[str, Style]] = []
        for text, tone in line:
            style = self.style_of(tone)
            if ground is not None and tone not in ("alarm", "call"):
                style += ground
            text = clean(text)
            if pieces:
                before, last = pieces[-1]
                # A change of style costs the terminal 40 bytes, and a blank looks the same in every color of text.
                if style == last or (not text.strip(" ") and _blank(style) == _blank(last)):
                    pieces[-1] = before + text, last
                    continue
            pieces.append((text, style))
        if pieces and _blank(pieces[-1][1]) == _blank(fill):
            fill = pieces[-1][1]
        rest = width - sum(cells(text) for text, _ in pieces)
        if rest > 0 and pieces and pieces[-1][1] == fill:
            pieces[-1] = pieces[-1][0] + " " * rest, fill
        elif rest > 0:
            pieces.append((" " * rest, fill))
        segments = [Segment(text, style) for text, style in pieces]
        return Strip(segments, width) if rest >= 0 else Strip(segments).adjust_cell_length(width, fill)


@lru_cache(64)
def _color(value: str) -> Color:
    return Color.parse(value)


@lru_cache(64)
def _attributes(definition: str) -> Style:
    return Style.parse(definition)


def _blank(style: Style) -> tuple[object, ...]:
    """All that can be seen of a blank in this style."""
    color = style.color if style.reverse or style.underline else None
    return style.bgcolor, color, style.reverse, style.underline
