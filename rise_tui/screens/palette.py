"""The command palette: type a few letters of anything that can be done, Enter does it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rise_tui.commands import Command, Hit, found
from rise_tui.screens.finder import Finder
from rise_tui.text import Line, Row, Span, cell, crop, marked, spread, width_of

TITLE_WIDTH = 30
KEY_WIDTH = 7
"""The longest are `space` and `bksp`."""


class Palette(Finder):
    """Moving over a theme shows it; Esc leaves everything as it was."""

    DEFAULT_CSS = """
    Palette #box { max-width: 92; height: auto; }
    Palette Found { height: 16; }
    """

    def __init__(self, commands: Sequence[Command], *, placeholder: str = "command, act, rule, event or theme") -> None:
        super().__init__("Command", "↑↓ choose · enter does it · esc closes", placeholder)
        self._commands = commands
        self._hits: list[Hit] = []
        self._theme_before = ""

    def on_mount(self) -> None:
        super().on_mount()
        self._theme_before = self.app.theme

    def draw(self) -> None:
        self._hits = found(self._commands, self.search.value)
        width = self.list.row_width
        rows = [Row(f"{at}", _line(hit, width)) for at, hit in enumerate(self._hits)]
        self.list.show(rows or [Row("", ((" nothing found", "muted"),), selectable=False)])
        self.list.move_to(0 if rows else -1, by_wizard=False)
        self.list.scroll_to(y=0, animate=False)
        self._preview()

    def key_taken(self, key: str) -> bool:
        moves: dict[str, Callable[[], None]] = {
            "up": lambda: self.list.action_step(-1),
            "down": lambda: self.list.action_step(1),
            "pageup": lambda: self.list.action_page(-1),
            "pagedown": lambda: self.list.action_page(1),
        }
        if key == "enter":
            self._choose()
        elif key in moves:
            moves[key]()
            self._preview()
        else:
            return False
        return True

    @property
    def current(self) -> Command | None:
        """What Enter would do."""
        return self._hits[self.list.cursor].command if 0 <= self.list.cursor < len(self._hits) else None

    def _preview(self) -> None:
        current = self.current
        wanted = current.theme if current is not None and current.theme else self._theme_before
        if wanted and self.app.theme != wanted:
            self.app.theme = wanted

    def _choose(self) -> None:
        chosen = self.current
        if chosen is not None:
            self._theme_before = chosen.theme or self._theme_before
            self.dismiss(str(self._commands.index(chosen)))

    def on_unmount(self) -> None:
        if self._theme_before and self.app.theme != self._theme_before:
            self.app.theme = self._theme_before


def _line(hit: Hit, width: int) -> Line:
    command = hit.command
    off = bool(command.why_not)
    title: Line = marked((cell(command.title, TITLE_WIDTH, "muted" if off else "plain"),), _shown(hit.places))
    key: Span = cell(command.key, KEY_WIDTH, "muted" if off else "key")
    said: Span = (f"not now: {command.why_not}", "wait") if off else (command.help, "muted")
    kind: Line = ((f" {command.kind} ", "muted"),) if command.kind else ()
    left: Line = ((" ", "plain"), *title, (" ", "plain"), key, said)
    room = width - width_of(kind)
    return spread(crop(left, room - 1), kind, width)


def _shown(places: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Those that the title's column has room for."""
    return [(start, end) for start, end in places if end < TITLE_WIDTH]
