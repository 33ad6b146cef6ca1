"""Lines in which something is typed: a bare field, a bar at the foot of a pane, a remark for the record."""

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
    """To the next field, while elsewhere on the console it goes to the next pane."""

    def validate_value(self, value: str) -> str:
        """A pasted control character would reach the terminal as it is."""
        return clean(value)


class PromptBar(Horizontal):
    """Hidden and empty until it is opened: every pane has one. Whoever opens it closes it; Esc and Enter are told."""

    DEFAULT_CSS = """
    PromptBar {
        height: 1; padding: 0 1; background: $panel; display: none;
        &.-open { display: block; }
        StaticLines { background: $panel; }
    }
    """

    @dataclass
    class PromptMessage(Message):
        """Something has happened in a bar."""

        bar: PromptBar

    class Edited(PromptMessage):
        """The text has changed."""

    class Accepted(PromptMessage):
        """Enter."""

    class Cancelled(PromptMessage):
        """Esc: it is given up."""

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
    """Stands where the notice stands while it is open. What was not taken is still there the next time."""

    DEFAULT_CSS = """
    NoteLine, NoteLine:focus {
        height: 1; border: none; padding: 0 1; background: $rise-cursor; display: none;
        &.-open { display: block; }
    }
    """

    @dataclass
    class SaveNote(Message):
        """Closed; `text` is empty when nothing is to be noted."""

        text: str
        back: Widget | None
        """What had the focus before."""

    def __init__(self) -> None:
        super().__init__(placeholder="note for the record; enter adds it, esc cancels", select_on_focus=False)
        self._back: Widget | None = None

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    def open(self, text: str) -> None:
        """Begin, with what was not taken the last time."""
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
