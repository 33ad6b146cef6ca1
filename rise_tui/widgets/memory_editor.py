"""Edits a key and its value in their row. The type shows while typing.

When the value changes meanwhile, a second row reports it, and Enter must be pressed again.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Horizontal, Vertical
from textual.message import Message
from textual.widgets import Input

from rise_tui.rendering.text import StyledLine, align_at_both_ends, clean, line_width, parse_typed_value
from rise_tui.widgets.fields import TextField
from rise_tui.widgets.lines import StaticLines


class PresentValue(NamedTuple):
    """A present value, and its source."""

    text: str
    """Empty: none."""
    source: str = ""


class RowEditor(Vertical):
    """An editor over one row of the memory."""

    DEFAULT_CSS = """
    RowEditor {
        layer: edit; height: 1; width: 100%; padding: 0 1; background: $panel; display: none;
        &.-open { display: block; }
        &.-conflict { height: 2; }
        Horizontal { height: 1; }
        TextField { margin: 0 1 0 0; }
        StaticLines { width: 1fr; background: $panel; }
        #conflict { display: none; }
        &.-conflict #conflict { display: block; }
    }
    """

    @dataclass
    class SaveRow(Message):
        """The editor was closed. `key` is empty if nothing should change."""

        key: str
        value: Any

    def __init__(self) -> None:
        super().__init__()
        self._key = TextField(placeholder="key", classes="key", select_on_focus=False)
        self._value = TextField(placeholder="value", classes="value")
        self.type_line = StaticLines()
        self.conflict_line = StaticLines(id="conflict")
        self._editing = ""
        self._offered = ""
        self._before = PresentValue("")
        self._shown_conflict: PresentValue | None = None
        """The conflicting value that Enter has already reported."""
        self._value_of: Callable[[str], PresentValue] = lambda key: PresentValue("")

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    def compose(self) -> ComposeResult:
        with Horizontal():
            yield self._key
            yield self._value
            yield self.type_line
        yield self.conflict_line

    def open(
        self,
        editing: str,
        key: str,
        value: str,
        value_of: Callable[[str], PresentValue],
        *,
        y: int,
        key_width: int,
        value_width: int,
    ) -> None:
        """Edit `editing` (empty: add a key) at row `y` of the pane, with the list's columns.

        `value_of` returns the present value of a key, or of the edited part of a value.
        """
        self._editing, self._offered, self._value_of = editing, key, value_of
        self._before, self._shown_conflict = value_of(editing) if editing else PresentValue(""), None
        self.styles.offset = (0, y)
        self._key.styles.width, self._value.styles.width = key_width, max(6, value_width)
        self._key.disabled = bool(editing)
        self._key.value, self._value.value = key, value
        self.remove_class("-conflict")
        self.add_class("-open")
        (self._value if key else self._key).focus()
        self.draw()

    @property
    def _key_meant(self) -> str:
        typed = self._key.value
        return self._editing or (self._offered if typed == clean(self._offered) else typed.strip())

    def _conflicting_value(self) -> PresentValue | None:
        """The key's present value, if it differs from the one to be edited; None: no conflict."""
        key = self._key_meant
        if not key:
            return None
        now = self._value_of(key)
        return None if now.text == self._before.text else now

    def draw(self) -> None:
        """Show the future value, and whether the memory has changed since the editor was opened."""
        _, kind, remark = parse_typed_value(self._value.value)
        self.type_line.show(_type_line(kind, remark, self.type_line.size.width) if remark else ((kind, "accent"),))
        now = self._conflicting_value()
        self.set_class(now is not None, "-conflict")
        if now is None:
            self._shown_conflict = None
            self.conflict_line.show()
            return
        says = f"is now {now.text}" if now.text else "is deleted now"
        who = f" by {now.source}" if now.source and now.text else ""
        was = f"was {self._before.text}, {says}" if self._before.text else f"there is one already: {says[7:]}"
        hint = "enter again: keep yours" if now == self._shown_conflict else "enter twice: keep yours"
        width = self.conflict_line.size.width or self.size.width - 2
        self.conflict_line.show(align_at_both_ends(((f"{was}{who}", "wait"),), ((hint, "key"),), max(1, width)))

    @on(StaticLines.DrawAgain)
    def _resized(self, event: StaticLines.DrawAgain) -> None:
        event.stop()
        self.draw()

    @on(Input.Changed)
    def _draw_changed(self, event: Input.Changed) -> None:
        event.stop()
        self.draw()

    @on(Input.Submitted)
    def _accept(self, event: Input.Submitted) -> None:
        event.stop()
        key = self._key_meant
        if event.input is self._key or not key:
            (self._value if key else self._key).focus()
            return
        now = self._conflicting_value()
        if now is not None and now != self._shown_conflict:
            self._shown_conflict = now
            self.draw()
            return
        self._close(key, parse_typed_value(self._value.value)[0])

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            event.prevent_default()
            self._close("", None)

    def _close(self, key: str, value: Any) -> None:
        self.remove_class("-open", "-conflict")
        self.post_message(self.SaveRow(key, value))


def _type_line(kind: str, remark: str, width: int) -> StyledLine:
    """The type, and why it differs from its look, in as many words as fit."""
    ways: tuple[StyledLine, ...] = (
        ((kind, "accent"), (f"  {remark}", "wait")),
        ((kind, "accent"), ("  not JSON", "wait")),
        (("text", "accent"), (", not JSON", "wait")),
    )
    return next((line for line in ways if line_width(line) <= width), (("not JSON", "wait"),))
