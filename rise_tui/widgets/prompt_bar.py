"""One row at the foot of a pane in which something is typed: a filter, a time, the name of a file."""

from __future__ import annotations

from dataclasses import dataclass

from textual import events, on
from textual.containers import Horizontal
from textual.message import Message
from textual.widgets import Input

from rise_tui.widgets.memory_editor import TextField
from rise_tui.widgets.static_lines import StaticLines


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
