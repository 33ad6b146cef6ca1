"""A box with a line to type in and a list that follows it: the common base of help and palette."""

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
    """The list. The keys stay with the line above; Enter goes to the list's cursor."""

    DEFAULT_CSS = """
    FoundList { background: $panel; }
    """

    def background_of(self, index: int) -> str:
        return CURSOR_BACKGROUND if index == self.cursor else ""


class SearchDialog(SingleDismissModal[ScreenResultType], Generic[ScreenResultType]):
    """A box to search in. Esc closes it; the result is the chosen item, or None."""

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
        """Show the matches of the typed text."""

    def typed_filter(self) -> Filter | None:
        """The typed text as a filter; None while it is empty or not valid."""
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

    def carry_out_key(self, key: str) -> bool:
        """Carry out a key that is not text; False: it is text."""
        if key in ("up", "down"):
            self.list.action_step(-1 if key == "up" else 1)
        elif key in ("pageup", "pagedown"):
            self.list.action_page(-1 if key == "pageup" else 1)
        else:
            return False
        return True
