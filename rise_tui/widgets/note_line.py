"""One line in which a remark for the record is typed."""

from __future__ import annotations

from dataclasses import dataclass

from textual import events, on
from textual.message import Message
from textual.widget import Widget
from textual.widgets import Input

from rise_tui.widgets.memory_editor import TextField


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
