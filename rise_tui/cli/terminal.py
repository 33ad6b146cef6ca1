"""The plain terminal, before any screen: questions, progress, and whose it is."""

from __future__ import annotations

import sys
from getpass import getuser
from typing import Final

import click

from rise_engine.base.exit_status import USAGE
from rise_engine.base.text import clean
from rise_engine.cli.terminal import Refused


class PlainTerminal:
    """Implements `rise_tui.cli.choose_session.Prompter`."""

    @property
    def interactive(self) -> bool:
        """Whether somebody can be asked."""
        return sys.stdin.isatty() and sys.stdout.isatty()

    def print_line(self, line: str) -> None:
        """Write a line."""
        click.echo(line)

    def read_answer(self, question: str) -> str | None:
        """The answer; None when nobody answers any more."""
        try:
            return str(click.prompt(question, default="", show_default=False, prompt_suffix=" "))
        except click.Abort:
            click.echo("")
            return None


class ProgressLine:
    """How far an engine is that is still coming up: one line of the terminal, which is written over."""

    def __init__(self) -> None:
        self._is_shown = False

    def overwrite(self, sentence: str) -> None:
        """Write it over what the line said."""
        self._is_shown = True
        click.echo(f"\r\x1b[2K{clean(sentence)}", nl=False)

    def clear(self) -> None:
        """Take the line away."""
        if self._is_shown:
            click.echo("\r\x1b[2K", nl=False)


UNNAMED: Final = {"wizard": "wizard", "observer": "observer"}
"""Who sits at the console of a real session, when nobody has said it: a login is a person's name, often enough."""


def login_name() -> str:
    """The user's, or `wizard` where the system knows none."""
    try:
        return getuser()
    except (KeyError, OSError):
        return "wizard"


def not_started(*lines: str, status: int = USAGE) -> Refused:
    """Ends the program: nothing is started and nothing attached to; the lines say why."""
    return Refused(status=status, findings=lines)
