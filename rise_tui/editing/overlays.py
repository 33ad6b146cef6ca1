"""What opens over the editor: help, palette, a draft, what was lost to a change outside."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from textual.app import App

from rise_engine.edit.drafts import Draft
from rise_engine.edit.workspace import OutsideChange
from rise_engine.text import clean
from rise_tui.editing.study import EditedStudy
from rise_tui.screens.dialog import Dialog, DialogChoice
from rise_tui.screens.help import HelpScreen, edit_help_entries
from rise_tui.screens.palette import Palette
from rise_tui.screens.palette_commands import PaletteCommand, edit_commands, theme_commands

if TYPE_CHECKING:
    pass


def folder_of(study: EditedStudy) -> Path:
    """Where the study lies."""
    return Path(study.draft.folder)


def open_help(app: App[object]) -> None:
    """Every key and word of the editor."""
    app.push_screen(HelpScreen(list(edit_help_entries())))


def open_palette(app: App[object], run: Callable[[str], None] | None) -> None:
    """What can be done in the editor, and the themes; without `run` the themes alone."""

    def use_theme(name: str) -> None:
        app.theme = name

    def run_chosen(command: PaletteCommand | None) -> None:
        if command is not None:
            command.run()

    commands = [*(edit_commands(run) if run is not None else ()), *theme_commands(use_theme)]
    app.push_screen(Palette(commands, "command or theme" if run is not None else "theme"), run_chosen)


def lost_changes_dialog(outside: OutsideChange) -> Dialog:
    """What of ours has no place in the files any more as somebody else has written them."""
    lines = [f"Somebody has changed {', '.join(outside.files)}.", "These changes of yours fit no more:"]
    lines += [f"· {clean(sentence)}" for change in outside.lost for sentence in change.says]
    return Dialog("Changed outside", lines, no="I have read it")


def draft_dialog(draft: Draft) -> Dialog:
    """What an earlier editor has not saved: it is taken up or forgotten; esc leaves the editor, so that it is kept."""
    says = [clean(sentence) for change in draft.changes for sentence in change.says]
    lines = [f"An editor has ended without saving ({clean(draft.kept)}):", *(f"· {each}" for each in says[:8])]
    lines += [f"· and {len(says) - 8} more"] if len(says) > 8 else []
    return Dialog("A draft is there", lines, DialogChoice("d", "Forget it"), DialogChoice("t", "Take it up"),
                  no="Leave the editor", default="t")  # fmt: skip
