"""Which keys the editor takes, and when: what is typed behind a key that opens a field goes into that field."""

from __future__ import annotations

from textual import events
from textual.app import App

from rise_tui.actions import BY_ID
from rise_tui.key_labels import keys_of
from rise_tui.rendering.terminal_reader import read_first
from rise_tui.rendering.typing_fields import takes_text

EDITOR = "-editor"
"""The class of the editor's screen, by which the console knows it without loading the editor."""
AT_ONCE = ("stop", "quit")
"""Actions whose keys wait for nothing."""


def is_editing(app: App[object]) -> bool:
    """Whether the editor is open, whatever lies over it."""
    return any(screen.has_class(EDITOR) for screen in app.screen_stack)


def waits(app: App[object], event: events.Key) -> bool:
    """Whether a key waits until what the one before it opens is there."""
    return is_editing(app) and all(event.key not in keys_of(BY_ID[id]) for id in AT_ONCE)


def admits(app: App[object], event: events.Event) -> bool:
    """A paste is no row of commands: of letters that came in one piece, without a field, only the first is one."""
    if not isinstance(event, events.Key) or takes_text(app.focused):
        return True
    return read_first(event) or not event.is_printable
