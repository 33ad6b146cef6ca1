"""Editing a key and its value in the row where it stands; the type shows while typing."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.message import Message
from textual.widgets import Input

from rise_engine.view import MemoryView
from rise_tui.text import Line, clean, crop, type_of_text, value_text, width_of
from rise_tui.widgets.line import Lines


class Field(Input):
    """A text field of one bare row."""

    DEFAULT_CSS = """
    Field, Field:focus { height: 1; border: none; padding: 0; background: $panel; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("tab", "app.focus_next", show=False)]
    """To the next field, while elsewhere on the console it goes to the next pane."""

    def validate_value(self, value: str) -> str:
        """A pasted control character would reach the terminal as it is."""
        return clean(value)


class RowEditor(Horizontal):
    """Opens over one row of the memory."""

    DEFAULT_CSS = """
    RowEditor {
        layer: edit; height: 1; width: 100%; padding: 0 1; background: $panel; display: none;
        &.-open { display: block; }
        Field { margin: 0 1 0 0; }
        Lines { width: 1fr; background: $panel; }
    }
    """

    class Done(Message):
        """The editor was closed; `key` is empty when nothing is to change."""

        def __init__(self, key: str, value: Any) -> None:
            super().__init__()
            self.key = key
            self.value = value

    def __init__(self) -> None:
        super().__init__()
        self._key = Field(placeholder="key", classes="key", select_on_focus=False)
        self._value = Field(placeholder="value", classes="value")
        self._type = Lines()
        self._editing = ""
        self._offered = ""
        self._before = ""
        self._now = ""

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    @property
    def type_shown(self) -> str:
        return self._type.text

    def compose(self) -> ComposeResult:
        yield self._key
        yield self._value
        yield self._type

    def open(self, editing: str, key: str, value: str, *, y: int, key_width: int, value_width: int) -> None:
        """Edit `editing` (empty: add a key) at row `y` of the pane; the columns are those of the list."""
        self._editing, self._before, self._now = editing, value, value
        self._offered = key
        self.styles.offset = (0, y)
        self._key.styles.width, self._value.styles.width = key_width, max(6, value_width)
        self._key.disabled = bool(editing)
        self._key.value, self._value.value = key, value
        self.add_class("-open")
        (self._value if key else self._key).focus()
        self._show_type()

    def check(self, memory: Mapping[str, MemoryView]) -> None:
        """The memory changed while the editor is open."""
        if self._editing:
            entry = memory.get(self._editing)
            self._now = value_text(entry.value) if entry is not None else "(deleted)"
            self._show_type()

    def _show_type(self) -> None:
        _, kind, remark = type_of_text(self._value.value)
        width = self._type.size.width
        line: Line = ((kind, "accent"),)
        if remark:
            line = _remarked(kind, remark, width)
        elif self._now != self._before:
            line = crop((*line, (f"  is now {self._now}", "wait")), width)
        self._type.show(line)

    @on(Lines.Resized)
    def _resized(self, event: Lines.Resized) -> None:
        event.stop()
        self._show_type()

    @on(Input.Changed)
    def _typed(self, event: Input.Changed) -> None:
        event.stop()
        self._show_type()

    @on(Input.Submitted)
    def _entered(self, event: Input.Submitted) -> None:
        event.stop()
        typed = self._key.value
        key = self._editing or (self._offered if typed == clean(self._offered) else typed.strip())
        if event.input is self._key or not key:
            (self._value if key else self._key).focus()
            return
        self._close(key, type_of_text(self._value.value)[0])

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            event.prevent_default()
            self._close("", None)

    def _close(self, key: str, value: Any) -> None:
        self.remove_class("-open")
        self.post_message(self.Done(key, value))


def _remarked(kind: str, remark: str, width: int) -> Line:
    """The type and why it is not what it looks like, in as many words as there is room for."""
    ways: tuple[Line, ...] = (
        ((kind, "accent"), (f"  {remark}", "wait")),
        ((kind, "accent"), ("  not JSON", "wait")),
        (("text", "accent"), (", not JSON", "wait")),
    )
    return next((line for line in ways if width_of(line) <= width), (("not JSON", "wait"),))
