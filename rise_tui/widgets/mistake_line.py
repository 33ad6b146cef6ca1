"""A line in which the wizard says what was wrong about their last action. It has the focus for its own letters."""

from __future__ import annotations

from dataclasses import dataclass

from textual import events
from textual.message import Message
from textual.timer import Timer
from textual.widget import Widget

from rise_tui.model.failures import MISTAKE_MARKS, markable_name
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, StyledSpan, clean, crop, fit, line_width
from rise_tui.widgets.static_lines import StoreLines

WIDE = 100
"""Cells from which the choices have space between them. Below this the name of the action needs the room."""
OPEN_SECONDS = 4.0
"""Seconds that the line waits for a letter."""


def is_mark_key(key: str) -> bool:
    """Whether the open line takes this key."""
    return key == "escape" or any(choice.key == key for choice in MISTAKE_MARKS)


class MistakeLine(StoreLines, can_focus=True):
    """Replaces the notice. A key that is not its own closes it and has its usual effect."""

    DEFAULT_CSS = """
    MistakeLine { background: $rise-cursor; display: none; }
    MistakeLine.-open { display: block; }
    """

    @dataclass
    class ChooseMark(Message):
        """What was wrong about the task."""

        task: int
        mark: str

    @dataclass
    class EndMarking(Message):
        """The line has closed. The focus returns to its former place."""

        back: Widget | None
        """The widget that had the focus before."""

    def __init__(self, store: Store) -> None:
        super().__init__(store, id="mistake")
        self.marked = 0
        """The task in question."""
        self._back: Widget | None = None
        self._timer: Timer | None = None

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    def open(self, task: int) -> None:
        """Ask about this task, which is being marked as wrong."""
        if not self.is_open:
            self._back = self.screen.focused
            self.add_class("-open")
        self.marked = task
        self.screen.set_focus(self)
        if self._timer is not None:
            self._timer.stop()
        self._timer = self.set_timer(OPEN_SECONDS, self.close)

    def close(self) -> None:
        """Close the line and return the focus."""
        if self._timer is not None:
            self._timer.stop()
            self._timer = None
        if self.is_open:
            self.remove_class("-open")
            self.post_message(self.EndMarking(self._back))

    def draw(self) -> None:
        store = self.store
        task = store.view.tasks.get(self.marked)
        if task is None or not self.is_open:
            return
        width = self.size.width
        sent = store.is_sent(("markMistake",), f"{task.id} wrong")
        what = f"↑ sent: {task.mark or 'wrong'}" if sent else f"! marked {task.mark}" if task.mark else "· not marked"
        choices: list[StyledSpan] = []
        gap = "  " if width >= WIDE else " "
        for choice in MISTAKE_MARKS:
            choices += [(f"{gap}{choice.key}", "key"), (f" {choice.word}", "plain")]
        choices += [(f"{gap}esc", "key"), (" ", "plain")]
        head: StyledLine = ((f" {what} ", "wait"),)
        room = width - line_width(head) - line_width(choices)
        name = clean(markable_name(task, store.key_of(task.function, task.behavior)))
        self.show(crop((*head, (fit(name, min(len(name), max(6, room))), "strong"), *choices), width))

    def on_key(self, event: events.Key) -> None:
        """Handle the line's own letters before anything else can."""
        choice = next((choice for choice in MISTAKE_MARKS if choice.key == event.key), None)
        if choice is None and event.key != "escape":
            return
        event.stop()
        event.prevent_default()
        if choice is not None:
            self.post_message(self.ChooseMark(self.marked, choice.mark))
        self.close()

    def on_blur(self) -> None:
        self.close()
