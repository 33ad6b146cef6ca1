"""`rise-tui edit DIR`: the editor alone."""

from __future__ import annotations

from textual import events

from rise_tui import typed_ahead
from rise_tui.actions import bindings_in
from rise_tui.config.keymap import KeyFile, textual_keymap
from rise_tui.editor.exploring import Explorer
from rise_tui.editor.screen import EditScreen
from rise_tui.editor.study import EditedStudy, SessionWatch
from rise_tui.key_labels import use_own_keys
from rise_tui.rendering import themes
from rise_tui.rendering.terminal_app import TerminalApp


class EditApp(TerminalApp):
    """Shows the editor of one study until the author leaves it."""

    TITLE = "RISE"
    ENABLE_COMMAND_PALETTE = False
    ALLOW_SELECT = False
    BINDINGS = bindings_in("everywhere")
    CSS = themes.CSS

    def __init__(
        self,
        study: EditedStudy,
        *,
        sessions: SessionWatch,
        theme: str = themes.DEFAULT,
        keys: KeyFile | None = None,
        notice: str = "",
        explorer: Explorer | None = None,
    ) -> None:
        """`explorer`: as for `EditScreen`."""
        super().__init__()
        self.animation_level = "none"
        for known in themes.THEMES:
            self.register_theme(known)
        self.theme = themes.full_name(theme)
        keys = keys or KeyFile()
        use_own_keys(keys.keys)
        self.set_keymap(textual_keymap(keys))
        self.edit_screen = EditScreen(study, sessions=sessions, notice=notice, explorer=explorer)

    def get_theme_variable_defaults(self) -> dict[str, str]:
        return themes.DARK.variables

    async def on_mount(self) -> None:
        await self.push_screen(self.edit_screen, lambda _: self.exit())

    def waits_for_keys(self, event: events.Key) -> bool:
        return typed_ahead.waits(self, event)

    def admits(self, event: events.Event) -> bool:
        return typed_ahead.admits(self, event)

    def action_do(self, action: str) -> None:
        if action == "stop":
            self.edit_screen.stop_pressed()
        elif action == "quit":
            self.run_worker(self.action_quit())

    async def action_quit(self) -> None:
        if self.screen is self.edit_screen:
            self.edit_screen.ask_to_leave()
        else:
            self.exit()
