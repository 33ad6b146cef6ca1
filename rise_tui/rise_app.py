"""The base of both programs: theme, own keys, keys that are text, and keys that wait for what earlier ones open."""

from __future__ import annotations

from textual import events
from textual.app import App
from textual.widgets import Input

from rise_tui.actions import BY_ID, bindings_in
from rise_tui.config.key_file import KeyFile, textual_keymap
from rise_tui.key_labels import keys_of, use_own_keys
from rise_tui.rendering import themes
from rise_tui.rendering.terminal_app import TerminalApp
from rise_tui.rendering.terminal_driver import read_first


class TakesText:
    """Mixed into text fields other than `Input`."""


def takes_text(widget: object) -> bool:
    """Whether typed or pasted letters are text for the widget."""
    return isinstance(widget, Input | TakesText)


EDITOR = "-editor"
"""The class of the editor's screen. The console recognises it without importing the editor."""
IMMEDIATE_ACTIONS = ("stop", "quit")
"""Actions whose keys never wait."""


def is_editing(app: App[object]) -> bool:
    """Whether the editor is open, even under another screen."""
    return any(screen.has_class(EDITOR) for screen in app.screen_stack)


class RiseApp(TerminalApp):
    """The common part of the console and the editor: theme, the user's own keys, and keys typed ahead."""

    TITLE = "RISE"
    ENABLE_COMMAND_PALETTE = False  # ours is an action of the registry
    ALLOW_SELECT = False
    BINDINGS = bindings_in("everywhere")
    CSS = themes.CSS

    def __init__(self, theme: str, keys: KeyFile) -> None:
        super().__init__()
        self.animation_level = "none"
        for known in themes.THEMES:
            self.register_theme(known)
        self.theme = themes.full_name(theme)
        use_own_keys(keys.keys)
        self.set_keymap(textual_keymap(keys))

    def get_theme_variable_defaults(self) -> dict[str, str]:
        return themes.DARK.variables

    def waits_for_keys(self, event: events.Key) -> bool:
        return is_editing(self) and all(event.key not in keys_of(BY_ID[id]) for id in IMMEDIATE_ACTIONS)

    def admits(self, event: events.Event) -> bool:
        """Outside a field, only the first letter of a paste counts as a command."""
        if not isinstance(event, events.Key) or takes_text(self.focused):
            return True
        return read_first(event) or not event.is_printable
