"""How the tones of `rise_tui.text` look: one place where meaning becomes colour, by theme variables only."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

from rich.segment import Segment
from rich.style import Style
from textual.color import Color
from textual.strip import Strip
from textual.widget import Widget

from rise_tui.text import Line, Tone, clean


class Look(NamedTuple):
    """Names of theme variables."""

    color: str
    background: str = ""
    """Empty: that of the widget."""
    bold: bool = False


LOOKS: dict[Tone, Look] = {
    "plain": Look("foreground"),
    "strong": Look("foreground", bold=True),
    "muted": Look("rise-muted"),
    "accent": Look("primary", bold=True),
    "key": Look("primary"),
    "wait": Look("warning"),
    "fault": Look("error"),
    "alarm": Look("rise-on-alarm", "error", bold=True),
    "call": Look("rise-on-alarm", "warning", bold=True),
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
            style = known[tone] = Style(color=color.rich_color, bgcolor=background.rich_color, bold=look.bold or None)
        return style

    def paint(self, line: Line, width: int, background: str = "") -> Strip:
        """A line in exactly `width` cells, on the background that a theme variable names."""
        ground = Style(bgcolor=_color(self.app.theme_variables[background]).rich_color) if background else None
        segments = []
        for text, tone in line:
            style = self.style_of(tone)
            segments.append(
                Segment(clean(text), style + ground if ground is not None and tone not in ("alarm", "call") else style)
            )
        fill = self.style_of("plain")
        return Strip(segments).adjust_cell_length(width, fill + ground if ground is not None else fill)


@lru_cache(64)
def _color(value: str) -> Color:
    return Color.parse(value)
