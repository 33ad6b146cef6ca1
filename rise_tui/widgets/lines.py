"""Lines of text and lists of rows that change often: a change repaints only differences, without a new layout.

Only this module turns the roles of `rise_tui.rendering.text` into colours, through theme variables. Roles and
backgrounds also have attributes (`rise-<name>-style`), the only styles of a theme without colours.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from time import monotonic
from typing import ClassVar, NamedTuple

from rich.segment import Segment
from rich.style import Style
from textual import events
from textual.binding import Binding, BindingType
from textual.color import Color
from textual.geometry import Offset, Region, Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.widget import Widget

from rise_tui.model.store import Store
from rise_tui.rendering.text import ListRow, StyledLine, TextRole, clean, plain_text


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

    The styles are not component classes, which Textual computes whenever it styles a widget. That took a third of a
    console's start time.
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

    DEFAULT_CSS = "StaticLines { height: 1; width: 1fr; }"

    class DrawAgain(Message):
        """The width has changed: make lines that depend on it again."""

        def can_replace(self, message: Message) -> bool:
            """Keep one of several waiting messages: drawing once makes all lines again."""
            return isinstance(message, StaticLines.DrawAgain)

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.lines: tuple[StyledLine, ...] = ()

    def show(self, *lines: StyledLine) -> None:
        """Show these lines. Only different ones are repainted."""
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


FOCUS_MARK = "▌"
"""The first cell of what has the focus: its contrast is at least 3 to 1, which a background cannot reach under text."""
DISPLACED_SECONDS = 0.7
"""Seconds after the cursor's row has vanished in which the row now under the cursor cannot have been read."""


class RowView(ScrollView, StyledLines, can_focus=True):
    """A list with a cursor. Subclasses provide the number of rows and the content of each."""

    DEFAULT_CSS = """
    RowView {
        height: 1fr; width: 1fr;
        overflow-x: hidden; overflow-y: auto; scrollbar-gutter: stable;
        scrollbar-size-vertical: 1;
    }
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("up", "step(-1)", show=False),
        Binding("down", "step(1)", show=False),
        Binding("pageup", "page(-1)", show=False),
        Binding("pagedown", "page(1)", show=False),
        Binding("home", "edge(-1)", show=False),
        Binding("end", "edge(1)", show=False),
    ]

    @dataclass
    class CursorMoved(Message):
        """The wizard moved the cursor."""

        rows: RowView

    class Resized(Message):
        """The width changed."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.cursor = -1
        self.displaced_at = float("-inf")
        """When the cursor's row last vanished, so that the cursor moved to another, on the monotonic clock."""
        self.continuation: RowView | None = None
        """A list below that cannot take the focus. It scrolls when this list has nothing further."""

    @property
    def was_just_displaced(self) -> bool:
        """Whether the wizard may not yet have seen the row under the cursor."""
        return monotonic() - self.displaced_at < DISPLACED_SECONDS

    @property
    @abstractmethod
    def count(self) -> int:
        """The number of rows."""

    @abstractmethod
    def row_at(self, index: int) -> ListRow:
        """The content of a row."""

    @property
    def current_id(self) -> str:
        """The id of the row under the cursor, or empty."""
        return self.row_at(self.cursor).id if 0 <= self.cursor < self.count else ""

    @property
    def row_width(self) -> int:
        """Cells of one row, without the scrollbar."""
        return self.scrollable_content_region.width

    @property
    def allow_vertical_scroll(self) -> bool:
        """Allow scrolling even before the scrollbar of a grown list is laid out."""
        return True

    def render_line(self, y: int) -> Strip:
        index = y + self.scroll_offset.y
        width = self.size.width
        if not 0 <= index < self.count:
            return self.to_strip((), width)
        return self.row_strip(index, self.row_at(index).line)

    def row_strip(self, index: int, line: StyledLine) -> Strip:
        """A row on its background. The cursor's row begins with the mark of the focus, if its first cell is blank."""
        if index == self.cursor and self.has_focus and line and line[0][0].startswith(" "):
            (text, role), *rest = line
            line = ((FOCUS_MARK, "accent"), (text[1:], role), *rest)
        return self.to_strip(line, self.size.width, self.background_of(index))

    @property
    def cursor_screen_offset(self) -> Offset:
        """The first cell of the cursor's row on the screen. The terminal's own cursor is put there."""
        row = min(max(0, self.cursor - self.scroll_offset.y), self.size.height)
        return self.content_region.offset + Offset(0, row)

    def background_of(self, index: int) -> str:
        """The theme variable of a row's background; empty: the list's own."""
        if index != self.cursor:
            return ""
        return CURSOR_BACKGROUND if self.has_focus else UNFOCUSED_CURSOR_BACKGROUND

    def move_cursor(self, index: int, *, by_wizard: bool = True) -> None:
        """Put the cursor on a row and bring it into view."""
        index = min(max(index, -1), self.count - 1)
        if index != self.cursor:
            old, self.cursor = self.cursor, index
            self._refresh_row(old)
            self._refresh_row(index)
            if by_wizard:
                self.displaced_at = float("-inf")
                self.post_message(self.CursorMoved(self))
        self.bring_into_view()

    def bring_into_view(self) -> bool:
        """Scroll to the cursor's row. False: it is in view, or there is none."""
        top, height = self.scroll_offset.y, self.size.height
        if not height or self.cursor < 0 or top <= self.cursor < top + height:
            return False
        self.scroll_to(y=self.cursor if self.cursor < top else self.cursor - height + 1, animate=False)
        return True

    def _find_selectable(self, index: int, direction: int) -> int | None:
        """The first row from `index` on that the cursor may be on."""
        indices = range(max(index, 0), self.count) if direction > 0 else range(index, -1, -1)
        return next((at for at in indices if self.row_at(at).selectable), None)

    def action_step(self, direction: int) -> None:
        index = self._find_selectable(self.cursor + direction, direction)
        if index is not None:
            self.move_cursor(index)
        else:  # nothing more to select, but perhaps more to read
            (self.continuation or self).scroll_relative(y=direction, animate=False)

    def action_page(self, direction: int) -> None:
        if self.continuation is not None:
            self.continuation.scroll_relative(y=direction * max(1, self.continuation.size.height - 1), animate=False)
            return
        self._move_to_nearest(self.cursor + direction * max(1, self.size.height - 1), direction)

    def action_edge(self, direction: int) -> None:
        self._move_to_nearest(0 if direction < 0 else self.count - 1, -direction)
        self.scroll_to(y=0 if direction < 0 else self.count, animate=False)

    def _move_to_nearest(self, index: int, direction: int) -> None:
        """Move to the selectable row nearest to `index`, first further on, then back."""
        index = min(max(index, 0), self.count - 1)
        nearest = self._find_selectable(index, direction)
        nearest = self._find_selectable(index, -direction) if nearest is None else nearest
        if nearest is not None:
            self.move_cursor(nearest)

    def _refresh_row(self, index: int) -> None:
        if index >= 0:
            self.refresh_line(index)

    def on_focus(self) -> None:
        self._refresh_row(self.cursor)

    def on_blur(self) -> None:
        self._refresh_row(self.cursor)

    def on_click(self, event: events.Click) -> None:
        index = event.y + self.scroll_offset.y
        if 0 <= index < self.count and self.row_at(index).selectable:
            self.move_cursor(index)

    def on_resize(self, event: events.Resize) -> None:
        self.post_message(self.Resized())


class RowList(RowView):
    """A list of rows held in memory. The cursor stays on its row when others come and go."""

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._rows: Sequence[ListRow] = ()

    @property
    def count(self) -> int:
        return len(self._rows)

    def row_at(self, index: int) -> ListRow:
        return self._rows[index]

    @property
    def text(self) -> str:
        """The characters of all rows."""
        return "\n".join(plain_text(row.line).rstrip() for row in self._rows)

    def show(self, rows: Sequence[ListRow]) -> None:
        """Show these rows. Only different ones are repainted."""
        old, self._rows = self._rows, rows
        before, current = self.cursor, old[self.cursor].id if 0 <= self.cursor < len(old) else ""
        found = self._index_of(current) if current else None
        self.cursor = self._nearest_index(before) if found is None else found
        if current and self.current_id != current:
            self.displaced_at = monotonic()
        self.virtual_size = Size(self.row_width, len(rows))
        for index in range(max(len(old), len(rows))):
            if index >= len(old) or index >= len(rows) or old[index].line != rows[index].line:
                self._refresh_row(index)
        if self.cursor != before:
            self._refresh_row(before)
            self._refresh_row(self.cursor)

    def select(self, row_id: str) -> None:
        """Put the cursor on a row, if it exists."""
        if (index := self._index_of(row_id)) is not None:
            self.move_cursor(index, by_wizard=False)

    def _index_of(self, row_id: str) -> int | None:
        return next((index for index, row in enumerate(self._rows) if row.id == row_id and row.selectable), None)

    def _nearest_index(self, before: int) -> int:
        selectable = (index for index, row in enumerate(self._rows) if row.selectable)
        return min(selectable, key=lambda index: abs(index - max(before, 0)), default=-1)
