"""Lines of fixed height that change often. A change repaints the lines that differ, without a new layout."""

from __future__ import annotations

from abc import abstractmethod

from textual import events
from textual.geometry import Region
from textual.message import Message
from textual.strip import Strip

from rise_tui.model.store import Store
from rise_tui.rendering.styled_lines import StyledLines
from rise_tui.rendering.text import StyledLine, plain_text


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
