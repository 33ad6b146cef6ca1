"""Lines of fixed height that change often: a change repaints those that differ, without a new layout.

Here alone the roles of `rise_tui.rendering.text` become colours, through theme variables. Roles and backgrounds also
have attributes (`rise-<name>-style`), the only styles of a theme without colours.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import NamedTuple

from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.color import Color
from textual.geometry import Region
from textual.message import Message
from textual.strip import Strip
from textual.widget import Widget

from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, TextRole, clean, plain_text


class StyleSpec(NamedTuple):
    """Names of theme variables."""

    color: str
    background: str = ""
    """Empty: the widget's own."""


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
"""The background of the cursor's row, with and without the focus."""


class StyledLines(Widget):
    """A widget that paints lines of styled text.

    The styles are not component classes. Textual computes those for each widget whenever it styles it, which took a
    third of a console's start time.
    """

    _styles_by_background: dict[str, dict[TextRole, Style]] | None = None
    """By background, then by role."""

    def notify_style_update(self) -> None:
        """Forget the styles after a change of the theme or a class."""
        self._styles_by_background = None
        super().notify_style_update()

    def styles_on(self, background: str) -> dict[TextRole, Style]:
        """The style of each role on the background of this theme variable; empty: the widget's own."""
        if self._styles_by_background is None:
            self._styles_by_background = {}
        if background not in self._styles_by_background:
            self._styles_by_background[background] = self._resolve_styles(background)
        return self._styles_by_background[background]

    def _resolve_styles(self, row_background: str) -> dict[TextRole, Style]:
        variables = self.app.theme_variables
        styles: dict[TextRole, Style] = {}
        for role, spec in STYLE_SPECS.items():
            background = Color.parse(variables[spec.background]) if spec.background else self.background_colors[1]
            style = Style(color=Color.parse(variables[spec.color]).rich_color, bgcolor=background.rich_color)
            style += self.styles.text_style + Style.parse(variables.get(f"rise-{role}-style", "none"))
            if row_background and role not in ("alarm", "call"):
                style += Style(bgcolor=Color.parse(variables[row_background]).rich_color)
                style += Style.parse(variables.get(f"{row_background}-style", "none"))
            styles[role] = style
        return styles

    def to_strip(self, line: StyledLine, width: int, background: str = "") -> Strip:
        """A line in exactly `width` cells, on the background of this theme variable."""
        styles = self.styles_on(background)
        segments = [Segment(clean(text), styles[role]) for text, role in line if text]
        return Strip(segments).adjust_cell_length(width, styles["plain"]).simplify()


class StaticLines(StyledLines):
    """One or more lines of styled text."""

    DEFAULT_CSS = """
    StaticLines { height: 1; width: 1fr; }
    """

    class DrawAgain(Message):
        """The width has changed: make lines that depend on it again."""

        def can_replace(self, message: Message) -> bool:
            """Keep one of several waiting messages: drawing once makes all lines again."""
            return isinstance(message, StaticLines.DrawAgain)

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.lines: tuple[StyledLine, ...] = ()

    def show(self, *lines: StyledLine) -> None:
        """Show these lines. Only those that differ are repainted."""
        old, self.lines = self.lines, lines
        for y in range(max(len(old), len(lines))):
            before = old[y] if y < len(old) else ()
            after = lines[y] if y < len(lines) else ()
            if before != after:
                self.refresh(Region(0, y, self.size.width, 1))

    @property
    def text(self) -> str:
        """The shown characters."""
        return "\n".join(plain_text(line) for line in self.lines)

    def render_line(self, y: int) -> Strip:
        return self.to_strip(self.lines[y] if y < len(self.lines) else (), self.size.width)

    def on_resize(self, event: events.Resize) -> None:
        self.post_message(self.DrawAgain())


class StoreLines(StaticLines):
    """Lines that show a part of the store."""

    def __init__(self, store: Store, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.store = store

    @abstractmethod
    def draw(self) -> None:
        """Make the lines again from the store."""
