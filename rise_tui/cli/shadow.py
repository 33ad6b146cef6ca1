"""`rise-tui --shadow`: which session, who judges, and whether it is begun, begun anew or gone on with."""

from __future__ import annotations

from rise_engine.base.errors import SessionError
from rise_engine.base.exit_status import UNFINISHED
from rise_engine.run.client.shadow import ShadowClient, start_time
from rise_engine.session.folder import find_session
from rise_engine.session.shadow import unfinished_shadow
from rise_tui.cli.choose_session import Prompter
from rise_tui.cli.options import CommandLine
from rise_tui.cli.terminal import not_started
from rise_tui.config.paths import abbreviate_home, expand_home
from rise_tui.rendering.text import clean, format_clock

QUESTION = "Your name, as the comparison of wizards is to have it?"


def make_shadow(options: CommandLine, terminal: Prompter) -> tuple[ShadowClient, str]:
    """The client that plays the session's cues, and the name of whoever sits here. Nothing is written yet.

    :raises Refused: there is no such session, nobody says who judges, or what was left must be decided about.
    """
    try:
        folder = find_session(str(expand_home(options.shadow or "")))
        wizard = _name_judge(options, terminal)
        left = unfinished_shadow(folder, wizard)
        if options.recover:
            if left is None:
                raise not_started(f"{clean(wizard)} has left no shadow of {folder.name} unfinished")
            return ShadowClient(folder, wizard, resume=left), wizard
        if left is not None and not options.new:
            raise not_started(
                f"{clean(wizard)} has begun a shadow of {folder.name}, which goes as far as "
                f"{format_clock(left.resume_at[0])}: {abbreviate_home(str(left.path))}",
                "--recover goes on with it; --new begins another one, and leaves it as it is",
                status=UNFINISHED,
            )
        at = start_time(folder, options.at) if options.at is not None else 0.0
    except SessionError as error:
        raise not_started(*error.lines) from None
    return ShadowClient(folder, wizard, at=at, speed=options.speed), wizard


def _name_judge(options: CommandLine, terminal: Prompter) -> str:
    """Never taken from the last session: whoever sat here then may be the one who is compared."""
    name = options.wizard
    if name is None and terminal.interactive:
        name = (terminal.read_answer(QUESTION) or "").strip()
    if not name:
        raise not_started("name the second wizard: --wizard NAME; the comparison tells wizards apart by their names")
    return name
