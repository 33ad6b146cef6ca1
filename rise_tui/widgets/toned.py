"""How the tones of `rise_tui.text` look: one place where meaning becomes colour, by theme variables only."""

from __future__ import annotations

from typing import ClassVar, get_args

from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip
from textual.widget import Widget

from rise_tui.text import Line, Tone, clean

CURSOR, CURSOR_AWAY = "line--cursor", "line--cursor-away"
COMPONENTS: frozenset[str] = frozenset({*(f"tone--{tone}" for tone in get_args(Tone)), CURSOR, CURSOR_AWAY})


def tone_css(widget: str) -> str:
    """The rules of all tones for one widget class (Textual inherits CSS along one base only)."""
    return f"""
    {widget} {{
        & > .tone--plain {{ color: $foreground; }}
        & > .tone--strong {{ color: $foreground; text-style: bold; }}
        & > .tone--muted {{ color: $rise-muted; }}
        & > .tone--accent {{ color: $primary; text-style: bold; }}
        & > .tone--key {{ color: $primary; }}
        & > .tone--wait {{ color: $warning; }}
        & > .tone--fault {{ color: $error; }}
        & > .tone--alarm {{ color: $rise-on-alarm; background: $error; text-style: bold; }}
        & > .line--cursor {{ background: $rise-cursor; }}
        & > .line--cursor-away {{ background: $rise-cursor-away; }}
    }}
    """


class Toned(Widget):
    """A widget that paints lines of toned text: first among the bases, with `COMPONENTS` and `tone_css`."""

    COMPONENT_CLASSES: ClassVar[set[str]] = set(COMPONENTS)
    _styles_of_tones: dict[str, Style] | None = None

    def notify_style_update(self) -> None:
        """The theme or a class changed."""
        self._styles_of_tones = None
        super().notify_style_update()

    def style_of(self, name: str) -> Style:
        known = self._styles_of_tones
        if known is None:
            known = self._styles_of_tones = {}
        style = known.get(name)
        if style is None:
            style = known[name] = self.get_component_rich_style(name)
        return style

    def paint(self, line: Line, width: int, background: str = "") -> Strip:
        """A line in exactly `width` cells. `background` names a component class whose background all of it gets."""
        ground = Style(bgcolor=self.style_of(background).bgcolor) if background else None
        segments = []
        for text, tone in line:
            style = self.style_of(f"tone--{tone}")
            segments.append(Segment(clean(text), style + ground if ground is not None and tone != "alarm" else style))
        fill = self.style_of("tone--plain")
        return Strip(segments).adjust_cell_length(width, fill + ground if ground is not None else fill)
