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


class Ink(NamedTuple):
    """A style that is ready for use. Of one widget, equal styles are the same object."""

    style: Style
    blank: tuple[object, ...]
    """All that can be seen of a blank in this style; also the same object where it is equal."""


class Toned(Widget):
    """A widget that paints lines of toned text.

    The looks are not component classes: Textual works out each of those for each widget whenever it styles it, which
    was a third of the time that a console took to appear.
    """

    _inks: dict[str, dict[Tone, Ink]] | None = None
    """By the ground, then by the tone."""

    def notify_style_update(self) -> None:
        """The theme or a class changed."""
        self._inks = None
        super().notify_style_update()

    def style_of(self, tone: Tone) -> Style:
        return self._inks_on("")[tone].style

    def _inks_on(self, ground: str) -> dict[Tone, Ink]:
        """How each tone looks on the background that a theme variable names; empty: the widget's own."""
        known = self._inks
        if known is None:
            known = self._inks = {}
        inks = known.get(ground)
        if inks is None:
            inks = known[ground] = self._make_inks(ground)
        return inks

    def _make_inks(self, ground: str) -> dict[Tone, Ink]:
        variables = self.app.theme_variables
        styles: dict[Style, Style] = {}
        blanks: dict[tuple[object, ...], tuple[object, ...]] = {}
        inks: dict[Tone, Ink] = {}
        for tone, look in LOOKS.items():
            background = _color(variables[look.background]) if look.background else self.background_colors[1]
            color = _color(variables[look.color])
            style = Style(color=color.rich_color, bgcolor=background.rich_color) + self.styles.text_style
            style += _attributes(variables.get(f"rise-{tone}-style", "none"))
            if ground and tone not in ("alarm", "call"):
                style += Style(bgcolor=_color(variables[ground]).rich_color)
                style += _attributes(variables.get(f"{ground}-style", "none"))
            blank = _blank(style)
            inks[tone] = Ink(styles.setdefault(style, style), blanks.setdefault(blank, blank))
        return inks

    def paint(self, line: Line, width: int, background: str = "") -> Strip:
        """A line in exactly `width` cells, on the background that a theme variable names."""
        inks = self._inks_on(background)
        fill = inks["plain"]
        segments: list[Segment] = []
        so_far, ink, rest = "", fill, width
        for text, tone in line:
            text = clean(text)
            rest -= cells(text)
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
