"""A field for something that is said: over as many lines as it needs, and yet one line of a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from textual import events
from textual.binding import Binding, BindingType
from textual.message import Message
from textual.widgets import TextArea

from rise_engine.base.text import clean
from rise_tui.rendering.typing_fields import TakesText

STEPS = {"enter": 0, "tab": 1, "shift+tab": -1}
"""Keys that take what is typed, and to which text it goes on."""


class SentenceField(TextArea, TakesText):
    """Enter, tab and shift+tab take it, esc leaves it as it was. A line end that is pasted is a blank."""

    DEFAULT_CSS = """
    SentenceField, SentenceField:focus {
        height: auto; min-height: 1; border: none; padding: 0; background: $panel; scrollbar-size-vertical: 1;
        & .text-area--cursor-line { background: $panel; }
    }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("home", "cursor_text_start", show=False),
                                             Binding("end", "cursor_text_end", show=False)]  # fmt: skip

    @dataclass
    class TakeSentence(Message):
        """It is to be as typed; `step`: to which text it goes on, 0: to none."""

        text: str
        step: int

    class LeaveSentence(Message):
        """It is to be as it was."""

    def __init__(self, *, exact: bool = False) -> None:
        """`exact`: whether blanks and line ends that stand there count."""
        super().__init__(compact=True, highlight_cursor_line=False)
        self._is_exact = exact

    def begin(self, text: str) -> None:
        """Type in this."""
        self.load_text(text)
        self.action_cursor_text_end()

    @property
    def sentence(self) -> str:
        """What is typed; on one line, where nothing else counts."""
        return self.text if self._is_exact else " ".join(self.text.split())

    def action_cursor_text_start(self) -> None:
        """To the first character."""
        self.move_cursor((0, 0))

    def action_cursor_text_end(self) -> None:
        """Behind the last character."""
        self.move_cursor(self.document.end)

    async def on_key(self, event: events.Key) -> None:
        if event.key in STEPS:
            self.post_message(self.TakeSentence(self.sentence, STEPS[event.key]))
        elif event.key == "escape":
            self.post_message(self.LeaveSentence())
        else:
            return
        event.stop()
        event.prevent_default()

    async def on_paste(self, event: events.Paste) -> None:
        event.prevent_default()
        event.stop()
        self.replace(clean(" ".join(event.text.split())), *self.selection, maintain_selection_offset=False)
