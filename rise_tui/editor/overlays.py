"""What opens over the editor: help, palette, a draft, a file that was changed here and on the disk."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import datetime
from pathlib import Path

from textual.app import App

from rise_engine.author.edit.drafts import Draft
from rise_engine.base.text import clean
from rise_tui.editor.study import EditedStudy
from rise_tui.screens.dialog import Dialog, DialogChoice
from rise_tui.screens.help import HelpScreen, edit_help_entries
from rise_tui.screens.palette import Palette, PaletteCommand, edit_commands, theme_commands

_SHOWN = 8
"""Changes that a dialog names."""


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


def ask_about_clash(app: App[object], files: Sequence[str], take: Callable[[], None]) -> None:
    """Which version of files is to stay, when they have unsaved changes here and were changed on the disk.

    :param take: takes them as they are on the disk.
    """
    named = ", ".join(map(clean, files))
    lines = [
        f"Somebody has changed {named} on the disk, and you have changes there that are not saved.",
        "Keep yours: saving then writes over what the other has written, and shows you first which lines.",
        "Take the other's: undo (ctrl+u) brings yours back.",
    ]
    question = Dialog(
        "Changed here and on the disk",
        lines,
        DialogChoice("o", "Take the other's"),
        no="Keep yours",
    )
    app.push_screen(question, lambda key: take() if key == "o" else None)


def _local_time(kept: str) -> str:
    """A moment as clocks on the wall here show it; as it is written where it is none."""
    try:
        return datetime.fromisoformat(kept).astimezone().strftime("%Y-%m-%d %H:%M")
    except ValueError:
        return clean(kept)


def draft_dialog(draft: Draft) -> Dialog:
    """What an earlier editor has not saved: it is taken up or forgotten; esc leaves the editor, so that it is kept."""
    says = [clean(sentence) for sentence in draft.says]
    lines = [
        f"An editor has ended without saving ({_local_time(draft.kept)}):",
        *(f"· {each}" for each in says[:_SHOWN]),
    ]
    lines += [f"· and {len(says) - _SHOWN} more"] if len(says) > _SHOWN else []
    return Dialog("A draft is there", lines, DialogChoice("d", "Forget it"), DialogChoice("t", "Take it up"),
                  no="Leave the editor", default="t")  # fmt: skip
