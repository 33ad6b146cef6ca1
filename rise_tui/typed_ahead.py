"""Which keys are text, and which keys the editor takes when: keys after one that opens a field go into that field."""

from __future__ import annotations

from textual import events
from textual.app import App
from textual.widgets import Input

from rise_tui.actions import BY_ID
from rise_tui.key_labels import keys_of
from rise_tui.rendering.terminal_driver import read_first


class TakesText:
    """Mixed into text fields other than `Input`."""


def takes_text(widget: object) -> bool:
    """Whether letters that are typed or pasted into the widget are text."""
    return isinstance(widget, Input | TakesText)


EDITOR = "-editor"
"""The class of the editor's screen. The console recognises it without importing the editor."""
AT_ONCE = ("stop", "quit")
"""Actions whose keys never wait."""


def is_editing(app: App[object]) -> bool:
    """Whether the editor is open, even under another screen."""
    return any(screen.has_class(EDITOR) for screen in app.screen_stack)


def waits(app: App[object], event: events.Key) -> bool:
    """Whether a key waits until what the previous key opens is there."""
    return is_editing(app) and all(event.key not in keys_of(BY_ID[id]) for id in AT_ONCE)


def admits(app: App[object], event: events.Event) -> bool:
    """Whether an event may go on. Outside a field, only the first letter of a paste counts as a command."""
    if not isinstance(event, events.Key) or takes_text(app.focused):
        return True
    return read_first(event) or not event.is_printable
