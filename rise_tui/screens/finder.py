"""A box with a line to type in and a list that follows it: what help and palette have in common."""

from __future__ import annotations

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import Input

from rise_tui.model.filtering import BrokenFilter, Filter
from rise_tui.rendering.modal import SingleDismissModal
from rise_tui.widgets.editor import Field
from rise_tui.widgets.rows import RowList, RowView
from rise_tui.widgets.toned import CURSOR


class Found(RowList, can_focus=False):
    """The list. The keys stay with the line above; its cursor is where Enter goes."""

    DEFAULT_CSS = """
    Found { background: $panel; }
    """

    def ground_of(self, index: int) -> str:
        return CURSOR if index == self.cursor else ""


class Finder(SingleDismissModal[str]):
    """Esc closes it; the result is what was chosen, or empty."""

    DEFAULT_CSS = """
    Finder {
        align: center top; background: transparent;
        #box { width: 100%; max-width: 100; height: 1fr; max-height: 40; margin: 1 0 1 0; padding: 0 1;
               background: $panel; border: round $primary; border-title-style: bold; }
        Field, Field:focus { background: $surface; margin: 0 0 1 0; }
    }
    """

    def __init__(self, title: str, keys: str, placeholder: str) -> None:
        super().__init__()
        self._title, self._keys = title, keys
        self.search = Field(placeholder=placeholder, select_on_focus=False)
        self.list = Found()

    def compose(self) -> ComposeResult:
        box = Vertical(id="box")
        box.border_title = f" {self._title} "
        box.border_subtitle = f" {self._keys} "
        with box:
            yield self.search
            yield self.list

    def on_mount(self) -> None:
        self.set_focus(self.search)

    def draw(self) -> None:
        """Show what fits to what is typed."""
        raise NotImplementedError

    def wanted(self) -> Filter | None:
        """What is typed; None while that is nothing, or cannot be used yet."""
        try:
            return Filter(self.search.value) or None
        except BrokenFilter:
            return None

    def finds(self, wanted: Filter | None, text: str) -> bool:
        try:
            return wanted is None or wanted.matches(text)
        except BrokenFilter:
            return True

    @on(Input.Changed)
    @on(RowView.Resized)
    def _changed(self) -> None:
        if self.list.row_width > 0:
            self.draw()

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            self.dismiss("")
        elif not self.key_taken(event.key):
            return
        event.stop()
        event.prevent_default()

    def key_taken(self, key: str) -> bool:
        """Do what a key asks for that is not typed."""
        raise NotImplementedError
