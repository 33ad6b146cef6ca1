"""A box with a line to type in and a list that follows it: what help and palette have in common."""

from __future__ import annotations

from abc import abstractmethod
from typing import Generic

from textual import events, on
from textual.app import ComposeResult
from textual.screen import ScreenResultType
from textual.widgets import Input

from rise_tui.model.filtering import Filter, InvalidFilter
from rise_tui.rendering.modal import SingleDismissModal, TitledBox
from rise_tui.rendering.styled_lines import CURSOR_BACKGROUND
from rise_tui.widgets.prompt_bar import TextField
from rise_tui.widgets.row_list import RowList, RowView


class FoundList(RowList, can_focus=False):
    """The list. The keys stay with the line above; its cursor is where Enter goes."""

    DEFAULT_CSS = """
    FoundList { background: $panel; }
    """

    def background_of(self, index: int) -> str:
        return CURSOR_BACKGROUND if index == self.cursor else ""


class SearchDialog(SingleDismissModal[ScreenResultType], Generic[ScreenResultType]):
    """Esc closes it; the result is what was chosen, or None."""

    DEFAULT_CSS = """
    SearchDialog {
        align: center top; background: transparent;
        #box { width: 100%; max-width: 100; height: 1fr; max-height: 40; margin: 1 0 1 0; }
        TextField, TextField:focus { background: $surface; margin: 0 0 1 0; }
    }
    """

    def __init__(self, title: str, keys: str, placeholder: str) -> None:
        super().__init__()
        self._title, self._keys = title, keys
        self.search = TextField(placeholder=placeholder, select_on_focus=False)
        self.list = FoundList()

    def compose(self) -> ComposeResult:
        with TitledBox(self._title, self._keys):
            yield self.search
            yield self.list

    def on_mount(self) -> None:
        self.set_focus(self.search)

    @abstractmethod
    def draw(self) -> None:
        """Show what fits to what is typed."""

    def typed_filter(self) -> Filter | None:
        """What is typed; None while that is nothing, or cannot be used yet."""
        try:
            return Filter(self.search.value) or None
        except InvalidFilter:
            return None

    def is_found(self, wanted: Filter | None, text: str) -> bool:
        try:
            return wanted is None or wanted.matches(text)
        except InvalidFilter:
            return True

    @on(Input.Changed)
    @on(RowView.Resized)
    def _changed(self) -> None:
        if self.list.row_width > 0:
            self.draw()

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            self.dismiss(None)
        elif not self.carry_out_key(event.key):
            return
        event.stop()
        event.prevent_default()

    @abstractmethod
    def carry_out_key(self, key: str) -> bool:
        """Do what a key asks for that is not typed; False: it is typed."""
