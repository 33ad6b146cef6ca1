"""Covers of the console: jump mode, the editor of a study, and a mark for cameras; and their closing."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path

from rich.segment import Segment
from rich.style import Style
from textual.app import App
from textual.geometry import Region
from textual.screen import Screen
from textual.strip import Strip
from textual.widget import Widget

from rise_tui.console.layout import Layout
from rise_tui.rendering.text import crop
from rise_tui.rendering.themes import BLACK, WHITE
from rise_tui.requests import ConsoleHost
from rise_tui.rise_app import is_editing
from rise_tui.screens.tour import LETTERS, JumpScreen, TitleLabels, label_line

FLASH_SECONDS = 0.6
"""Seconds that it is shown: 15 pictures of a camera at 25 pictures a second."""
_DIGITS = {
    "0": "### # # # # # ###",
    "1": " #  ##   #   #  ###",
    "2": "###   # ### #   ###",
    "3": "###   # ###   # ###",
    "4": "# # # # ###   #   #",
    "5": "### #   ###   # ###",
    "6": "### #   ### # # ###",
    "7": "###   #   #   #   #",
    "8": "### # # ### # # ###",
    "9": "### # # ###   # ###",
}
"""Five rows of three dots, with a blank between rows."""
_WIDTH, _HEIGHT = 3, 5


def flash_rows(number: int, width: int, height: int) -> list[str]:
    """The number in the middle of `width` times `height` cells: `#` for painted cells, blanks elsewhere.

    A cell is twice as high as it is wide, so a dot is twice as many cells wide as high.

    >>> print("\\n".join(row.rstrip() for row in flash_rows(4, 8, 5)))
     ##  ##
     ##  ##
     ######
         ##
         ##
    """
    digits = str(number)
    columns = len(digits) * (_WIDTH + 1) - 1
    scale = min(height // _HEIGHT, width // (2 * columns))
    if scale < 1:
        return [" " * width] * height
    dots = [" ".join(_row(digit, row) for digit in digits) for row in range(_HEIGHT)]
    wide = ["".join(dot * 2 * scale for dot in row).center(width)[:width] for row in dots]
    rows = [row for row in wide for _ in range(scale)]
    above = (height - len(rows)) // 2
    return [" " * width] * above + rows + [" " * width] * (height - len(rows) - above)


def _row(digit: str, row: int) -> str:
    return _DIGITS[digit][row * (_WIDTH + 1) :][:_WIDTH].ljust(_WIDTH)


class Flash(Widget, can_focus=False):
    """Covers everything else on a screen, but takes no keys: they have their usual effect."""

    DEFAULT_CSS = "Flash { layer: flash; overlay: screen; width: 100%; height: 100%; }"

    def __init__(self, number: int, *, on_dark: bool) -> None:
        """`on_dark`: whether the screen below is dark, for the strongest contrast."""
        super().__init__()
        self.number = number
        ground, ink = (WHITE, BLACK) if on_dark else (BLACK, WHITE)
        self._ground, self._ink = Style(color=ink, bgcolor=ground), Style(color=ground, bgcolor=ink)

    def on_mount(self) -> None:
        self.set_timer(FLASH_SECONDS, self.remove)

    def render_line(self, y: int) -> Strip:
        width, height = self.size
        row = flash_rows(self.number, width, height)[y]
        pieces: list[Segment] = []
        at = 0
        while at < len(row):
            end = at
            while end < len(row) and row[end] == row[at]:
                end += 1
            pieces.append(Segment(" " * (end - at), self._ink if row[at] == "#" else self._ground))
            at = end
        return Strip(pieces, width)


SESSION_KEEPS_COPY = "the running session keeps its own copy of the files; what you save applies to the next one"


def open_jump_mode(console: ConsoleHost, panes: Layout, hints: Region) -> None:
    """Show letters over the title bars. The key hints explain them."""

    def focus_pane(name: str | None) -> None:
        if name:
            panes.focus_pane(name)

    console.app.push_screen(JumpScreen(_title_labels(panes), hints), focus_pane)


def _title_labels(panes: Layout) -> Iterator[TitleLabels]:
    """Labels over each visible title bar; over a zoomed pane's title, labels for all panes."""
    for pane in panes.visible_panes():
        names = tuple(panes.panes) if panes.is_zoomed else tuple(name for name, _ in pane.title.tabs)
        titles = [(LETTERS[name], panes.panes[name].TITLE, name == pane.SCOPE) for name in names]
        yield TitleLabels(pane.title.region, crop(label_line(titles), pane.title.region.width))


async def open_editor(app: App[object], folder: str, refuse: Callable[[str], None], *, runs: bool) -> None:
    """Open the editor of a study's files over the current screen.

    `refuse` receives the reason if it does not open. `runs`: whether a session runs here, so that the stop key must
    work.
    """
    # Most sessions never open it. Loading takes half a second, off the loop, because the stop key must not wait.
    await asyncio.to_thread(import_module, "rise_tui.editor.screen")
    from rise_engine.author.edit.plan import EditRefused
    from rise_engine.author.edit.workspace import Workspace
    from rise_engine.study.review import findings_of_files
    from rise_tui.editor.model.draft import StudyDraft, draft_of
    from rise_tui.editor.screen import EditScreen
    from rise_tui.editor.study import EditedStudy

    def read() -> tuple[Workspace, StudyDraft]:
        workspace = Workspace(Path(folder), also_check=findings_of_files)
        return workspace, draft_of(workspace)

    try:
        workspace, draft = await asyncio.to_thread(read)
    except EditRefused as refused:
        refuse(f"the editor cannot open: {refused}")
        return
    notice = workspace.read_only or (SESSION_KEEPS_COPY if runs else "")
    await app.push_screen(EditScreen(EditedStudy(workspace, draft), notice=notice, may_suspend=not runs))


def show_stop_in_editor(app: App[object]) -> None:
    """Report the stop in an editor that covers the console, because the editor hides its effect."""
    if not is_editing(app):
        return
    from rise_tui.editor.screen import EditScreen  # already loaded

    for screen in app.screen_stack:
        if isinstance(screen, EditScreen):
            screen.say("STOP was sent: the console below shows what the robot has confirmed", "fault")


def show_flash(app: App[object], number: int) -> None:
    """Show a mark for cameras over the current screen for a moment. It takes no keys and blocks nothing."""
    for earlier in app.screen.query(Flash):
        earlier.remove()
    app.screen.mount(Flash(number, on_dark=app.current_theme.dark))


def close_all_above(console: Screen[None]) -> None:
    """Close questions and lists above the console unanswered, so that none is forgotten there.

    Typed text stays in its field.
    """
    while console.app.screen is not console:
        console.app.screen.dismiss()
