"""The plain terminal, before any screen: questions, progress, and the login."""

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
        """Whether the program can ask somebody."""
        return sys.stdin.isatty() and sys.stdout.isatty()

    def print_line(self, line: str) -> None:
        """Write a line."""
        click.echo(line)

    def read_answer(self, question: str) -> str | None:
        """The answer, or None when nobody answers any more."""
        try:
            return str(click.prompt(question, default="", show_default=False, prompt_suffix=" "))
        except click.Abort:
            click.echo("")
            return None


class ProgressLine:
    """The progress of an engine that is still starting, on one line of the terminal that is overwritten."""

    def __init__(self) -> None:
        self._is_shown = False

    def overwrite(self, sentence: str) -> None:
        """Overwrite the line with this sentence."""
        self._is_shown = True
        click.echo(f"\r\x1b[2K{clean(sentence)}", nl=False)

    def clear(self) -> None:
        """Remove the line."""
        if self._is_shown:
            click.echo("\r\x1b[2K", nl=False)


UNNAMED: Final = {"wizard": "wizard", "observer": "observer"}
"""The name in a real session's record when nobody gave one. A login is often a person's name."""


def login_name() -> str:
    """The user's login, or `wizard` if the system knows none."""
    try:
        return getuser()
    except (KeyError, OSError):
        return "wizard"


def not_started(*lines: str, status: int = USAGE) -> Refused:
    """The error that ends the program before it starts or attaches to anything; the lines say why."""
    return Refused(status=status, findings=lines)
