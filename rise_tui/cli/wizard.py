"""Who sits here: a name that is asked once and found again the next time."""

from __future__ import annotations

from collections.abc import Callable

from msgspec.structs import replace

from rise_tui.cli.choose_session import Prompter
from rise_tui.cli.options import CommandLine
from rise_tui.config.paths import PREFERENCES_NAME, state_folder
from rise_tui.config.preferences import Preferences, load_saved
from rise_tui.rendering.text import clean

QUESTION = "Your name, as the record is to have it (a short one; enter: none)?"


def last_wizard(options: CommandLine) -> str:
    """Who sat here last; empty: nobody has said it, or nothing is to be found again."""
    return "" if options.fresh else load_saved(state_folder() / PREFERENCES_NAME, Preferences)[0].wizard


def name_wizard(options: CommandLine, is_real: Callable[[], bool], terminal: Prompter) -> tuple[CommandLine, str]:
    """The command line with the name of whoever begins a session, and what there is to say about it.

    Without `--wizard` it is who sat here last. Nobody did: before a real session it is asked, and one in debug mode
    begins with the login, which is nobody's name.
    """
    if options.wizard is not None:
        return options, ""
    if last := last_wizard(options):
        remark = f"you are {clean(last)}, as last time; if you are not: rise-tui --wizard NAME"
        return replace(options, wizard=last), remark
    if terminal.interactive and is_real() and (answer := (terminal.read_answer(QUESTION) or "").strip()):
        return replace(options, wizard=answer), ""
    return options, ""
