"""The command palette: type a few letters of anything that can be done, Enter does it."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    StyledSpan,
    align_at_both_ends,
    crop,
    fixed_span,
    highlight_matches,
    line_width,
)
from rise_tui.screens.palette_commands import PaletteCommand, PaletteHit, search_commands
from rise_tui.screens.search_dialog import SearchDialog

TITLE_WIDTH = 30
KEY_WIDTH = 7
"""The longest are `space` and `bksp`."""


class Palette(SearchDialog[PaletteCommand]):
    """Moving over a theme shows it; Esc leaves everything as it was."""

    DEFAULT_CSS = """
    Palette #box { max-width: 92; height: auto; }
    Palette FoundList { height: 16; }
    """

    def __init__(self, commands: Sequence[PaletteCommand], placeholder: str) -> None:
        super().__init__("Command", "↑↓ choose · enter runs it · esc closes", placeholder)
        self._commands = commands
        self._hits: list[PaletteHit] = []
        self._theme_before = ""

    def on_mount(self) -> None:
        super().on_mount()
        self._theme_before = self.app.theme

    def draw(self) -> None:
        self._hits = search_commands(self._commands, self.search.value)
        width = self.list.row_width
        rows = [ListRow(f"{at}", _hit_line(hit, width)) for at, hit in enumerate(self._hits)]
        self.list.show(rows or [ListRow("", ((" nothing found", "muted"),), selectable=False)])
        self.list.move_cursor(0 if rows else -1, by_wizard=False)
        self.list.scroll_to(y=0, animate=False)
        self._preview()

    def carry_out_key(self, key: str) -> bool:
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
    def current(self) -> PaletteCommand | None:
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
            self.dismiss(chosen)

    def on_unmount(self) -> None:
        if self._theme_before and self.app.theme != self._theme_before:
            self.app.theme = self._theme_before


def _hit_line(hit: PaletteHit, width: int) -> StyledLine:
    command = hit.command
    off = bool(command.blocked_text)
    shown = fixed_span(command.title, TITLE_WIDTH, "muted" if off else "plain")
    title = highlight_matches((shown,), [span for span in hit.spans if span[1] < TITLE_WIDTH])
    key: StyledSpan = fixed_span(command.key, KEY_WIDTH, "muted" if off else "key")
    said: StyledSpan = (f"not now: {command.blocked_text}", "wait") if off else (command.help, "muted")
    kind: StyledLine = ((f" {command.kind} ", "muted"),) if command.kind else ()
    left: StyledLine = ((" ", "plain"), *title, (" ", "plain"), key, said)
    room = width - line_width(kind)
    return align_at_both_ends(crop(left, room - 1), kind, width)
