"""Lines to type in: a bare field, a bar at the bottom of a pane, a remark for the record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from textual import events, on
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.message import Message
from textual.widget import Widget
from textual.widgets import Input

from rise_tui.rendering.text import clean
from rise_tui.widgets.static_lines import StaticLines


class TextField(Input):
    """A text field of one bare row."""

    DEFAULT_CSS = """
    TextField, TextField:focus { height: 1; border: none; padding: 0; background: $panel; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("tab", "app.focus_next", show=False)]
    """Tab goes to the next field; elsewhere on the console it goes to the next pane."""

    def validate_value(self, value: str) -> str:
        """Remove control characters, which would reach the terminal unchanged."""
        return clean(value)


class PromptBar(Horizontal):
    """A bar, hidden and empty until it is opened. Every pane has one. Messages tell its opener of Esc and Enter."""

    DEFAULT_CSS = """
    PromptBar {
        height: 1; padding: 0 1; background: $panel; display: none;
        &.-open { display: block; }
        StaticLines { background: $panel; }
    }
    """

    @dataclass
    class PromptMessage(Message):
        """An event in a bar."""

        bar: PromptBar

    class Edited(PromptMessage):
        """The text has changed."""

    class Accepted(PromptMessage):
        """The wizard pressed Enter."""

    class Cancelled(PromptMessage):
        """The wizard pressed Esc."""

    def __init__(self, label: str, placeholder: str) -> None:
        super().__init__()
        self._label = StaticLines()
        self._label.styles.width = len(label)
        self._label.show(((label, "key"),))
        self.field = TextField(placeholder=placeholder, select_on_focus=False)

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    @property
    def text(self) -> str:
        return self.field.value

    def open(self, text: str = "") -> None:
        if not self.field.is_attached:
            self.mount(self._label, self.field)
        self.add_class("-open")
        with self.prevent(Input.Changed):
            self.field.value = text
        self.field.cursor_position = len(text)
        self.screen.set_focus(self.field)

    def close(self) -> None:
        self.remove_class("-open")

    @on(Input.Changed)
    def _input_changed(self, event: Input.Changed) -> None:
        event.stop()
        if self.is_open:
            self.post_message(self.Edited(self))

    @on(Input.Submitted)
    def _input_submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self.post_message(self.Accepted(self))

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            event.prevent_default()
            self.post_message(self.Cancelled(self))


class NoteLine(TextField):
    """Replaces the notice while it is open. Text that was not accepted returns the next time."""

    DEFAULT_CSS = """
    NoteLine, NoteLine:focus {
        height: 1; border: none; padding: 0 1; background: $rise-cursor; display: none;
        &.-open { display: block; }
    }
    """

    @dataclass
    class SaveNote(Message):
        """The line was closed. `text` is empty if there is nothing to note."""

        text: str
        back: Widget | None
        """The widget that had the focus before."""

    def __init__(self) -> None:
        super().__init__(placeholder="note for the record; enter adds it, esc cancels", select_on_focus=False)
        self._back: Widget | None = None

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    def open(self, text: str) -> None:
        """Open the line with the text that was not accepted last time."""
        if not self.is_open:
            self._back = self.screen.focused
            self.value = text
            self.add_class("-open")
        self.screen.set_focus(self)

    @on(Input.Submitted)
    def _input_submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self._close(self.value.strip())

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            event.prevent_default()
            self._close("")

    def _close(self, text: str) -> None:
        self.remove_class("-open")
        self.post_message(self.SaveNote(text, self._back))
