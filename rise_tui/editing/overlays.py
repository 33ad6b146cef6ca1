"""What opens over the editor: help, palette, a draft, what was lost to a change outside."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from textual.app import App

from rise_engine.edit.drafts import Draft
from rise_engine.edit.workspace import OutsideChange
from rise_engine.text import clean
from rise_tui.editing.model.waiting_rows import waiting_text
from rise_tui.editing.study import EditedStudy
from rise_tui.screens.dialog import Dialog, DialogChoice
from rise_tui.screens.help import HelpScreen, edit_help_entries
from rise_tui.screens.palette import Palette
from rise_tui.screens.palette_commands import PaletteCommand, edit_commands, theme_commands

if TYPE_CHECKING:
    from rise_tui.editing.page import EditFrame

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


def set_aside_dialog(outside: OutsideChange) -> Dialog:
    """Own changes in whose way somebody else's stand: they are kept, and compared now or later."""
    number = len(outside.lost)
    what = "A change of yours is" if number == 1 else f"{number} changes of yours are"
    lines = [f"Somebody has changed {', '.join(outside.files)}, in the same place as you."] if outside.files else []
    lines += [f"{what} set aside, and nothing is lost: choose which is to stay."]
    says = [clean(sentence) for change in outside.lost for sentence in change.says]
    lines += [f"· {each}" for each in says[:_SHOWN]]
    lines += [f"· and {len(says) - _SHOWN} more"] if len(says) > _SHOWN else []
    return Dialog("Changed by two", lines, DialogChoice("c", "Compare"), no="Later", default="c")


def ask_about_set_aside(app: App[object], frame: EditFrame, outside: OutsideChange) -> None:
    """Changes of ours in whose way somebody else's stand are compared, now or later."""

    def answer(key: str | None) -> None:
        if key == "c":
            frame.open_page("waiting")
        else:
            say_what_waits(frame)

    app.push_screen(set_aside_dialog(outside), answer)


def say_what_waits(frame: EditFrame) -> None:
    """Which changes wait for the author, if any do."""
    if what := waiting_text(frame.study.draft):
        frame.say(f"{what}: p shows what waits", "wait")


def open_waiting(frame: EditFrame) -> None:
    """The page of changes that wait."""
    if frame.study.draft.waiting:
        frame.open_page("waiting")
    else:
        frame.say("nothing waits: no change was proposed, and none of yours was set aside")


def _local_time(kept: str) -> str:
    """A moment as clocks on the wall here show it; as it is written where it is none."""
    try:
        return datetime.fromisoformat(kept).astimezone().strftime("%Y-%m-%d %H:%M")
    except ValueError:
        return clean(kept)


def draft_dialog(draft: Draft) -> Dialog:
    """What an earlier editor has not saved: it is taken up or forgotten; esc leaves the editor, so that it is kept."""
    says = [clean(sentence) for change in draft.changes for sentence in change.says]
    aside = [each for each in draft.set_aside if not each.given_up]
    says += [f"set aside: {clean(sentence)}" for change in aside for sentence in change.says]
    lines = [
        f"An editor has ended without saving ({_local_time(draft.kept)}):",
        *(f"· {each}" for each in says[:_SHOWN]),
    ]
    lines += [f"· and {len(says) - _SHOWN} more"] if len(says) > _SHOWN else []
    return Dialog("A draft is there", lines, DialogChoice("d", "Forget it"), DialogChoice("t", "Take it up"),
                  no="Leave the editor", default="t")  # fmt: skip
