"""How the tones of `rise_tui.rendering.text` look: one place where meaning becomes colour, by theme variables only.

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

from rise_tui.rendering.text import StyledLine, TextRole, cell_width, clean


class StyleSpec(NamedTuple):
    """Names of theme variables."""

    color: str
    background: str = ""
    """Empty: that of the widget."""


STYLE_SPECS: dict[TextRole, StyleSpec] = {
    "plain": StyleSpec("foreground"),
    "strong": StyleSpec("foreground"),
    "muted": StyleSpec("rise-muted"),
    "accent": StyleSpec("primary"),
    "key": StyleSpec("primary"),
    "wait": StyleSpec("warning"),
    "fault": StyleSpec("error"),
    "alarm": StyleSpec("rise-on-alarm", "error"),
    "call": StyleSpec("rise-on-alarm", "warning"),
    "match": StyleSpec("foreground"),
}
CURSOR_BACKGROUND, UNFOCUSED_CURSOR_BACKGROUND = "rise-cursor", "rise-cursor-away"
"""The background of the cursor's row, where the keys go and where they do not."""


class ResolvedStyle(NamedTuple):
    """A style that is ready for use. Of one widget, equal styles are the same object."""

    style: Style
    blank: tuple[object, ...]
    """All that can be seen of a blank in this style; also the same object where it is equal."""


class StyledLines(Widget):
    """A widget that paints lines of toned text.

    The looks are not component classes: Textual works out each of those for each widget whenever it styles it, which
    was a third of the time that a console took to appear.
    """

    _styles_by_background: dict[str, dict[TextRole, ResolvedStyle]] | None = None
    """By the ground, then by the tone."""

    def notify_style_update(self) -> None:
        """The theme or a class changed."""
        self._styles_by_background = None
        super().notify_style_update()

    def _styles_on(self, ground: str) -> dict[TextRole, ResolvedStyle]:
        """How each tone looks on the background that a theme variable names; empty: the widget's own."""
        known = self._styles_by_background
        if known is None:
            known = self._styles_by_background = {}
        inks = known.get(ground)
        if inks is None:
            inks = known[ground] = self._resolve_styles(ground)
        return inks

    def _resolve_styles(self, ground: str) -> dict[TextRole, ResolvedStyle]:
        variables = self.app.theme_variables
        styles: dict[Style, Style] = {}
        blanks: dict[tuple[object, ...], tuple[object, ...]] = {}
        inks: dict[TextRole, ResolvedStyle] = {}
        for tone, look in STYLE_SPECS.items():
            background = _color(variables[look.background]) if look.background else self.background_colors[1]
            color = _color(variables[look.color])
            style = Style(color=color.rich_color, bgcolor=background.rich_color) + self.styles.text_style
            style += _attributes(variables.get(f"rise-{tone}-style", "none"))
            if ground and tone not in ("alarm", "call"):
                style += Style(bgcolor=_color(variables[ground]).rich_color)
                style += _attributes(variables.get(f"{ground}-style", "none"))
            blank = _blank(style)
            inks[tone] = ResolvedStyle(styles.setdefault(style, style), blanks.setdefault(blank, blank))
        return inks

    def to_strip(self, line: StyledLine, width: int, background: str = "") -> Strip:
        """A line in exactly `width` cells, on the background that a theme variable names."""
        inks = self._styles_on(background)
        fill = inks["plain"]
        segments: list[Segment] = []
        so_far, ink, rest = "", fill, width
        for text, tone in line:
            text = clean(text)
            rest -= cell_width(text)
            new = inks[tone]
            # A change of style costs the terminal 40 bytes, and a blank looks the same in every color of text.
            if new.style is ink.style or (new.blank is ink.blank and so_far and not text.strip(" ")):
                so_far += text
            elif text:
                if so_far:
                    segments.append(Segment(so_far, ink.style))
                so_far, ink = text, new
        if rest > 0:
            if so_far and ink.blank is not fill.blank:
                segments.append(Segment(so_far, ink.style))
                so_far, ink = "", fill
            so_far += " " * rest
        if so_far:
            segments.append(Segment(so_far, ink.style))
        return Strip(segments, width) if rest >= 0 else Strip(segments).adjust_cell_length(width, fill.style)


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
