"""The command line, and the plain terminal before any screen: login, progress, choice of a session.

Uses neither sockets nor Textual.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from getpass import getuser
from typing import TYPE_CHECKING, Final, Protocol

import click
from msgspec import Struct

from rise_engine.base.exit_status import OK, USAGE
from rise_engine.cli.arguments import parse_paths
from rise_engine.cli.terminal import Refused
from rise_engine.ports.bridge import RosConnection, RosTransport
from rise_engine.run.protocol.client import Role
from rise_engine.run.protocol.messages import SessionSummary
from rise_engine.run.protocol.session_options import SessionOptions
from rise_tui.config.display import DisplayOptions
from rise_tui.config.preferences import abbreviate_home, key_file_path
from rise_tui.rendering.text import clean, wrap

if TYPE_CHECKING:
    from rise_tui.config.key_file import KeyFile

THEMES = ("dark", "light", "contrast", "colorblind", "colorblind-light", "mono", "terminal")
"""The themes of `rise_tui.rendering.themes`. That module is imported only when a session is starting."""
THEME = click.option(
    "--theme", type=click.Choice(THEMES), help="Choose the theme. Default: the one that you used last; at first, dark."
)
MOUSE = click.option(
    "--mouse",
    type=click.Choice(["on", "off"]),
    default="on",
    show_default=True,
    help="Use the mouse, or leave it to the terminal.",
)
KEYS = click.option("--keys", metavar="FILE", help="Use this key file instead of the usual one. none: the usual keys.")


class CommandLine(Struct, frozen=True, kw_only=True):
    """The given options, by name. None: not given."""

    folder: str | None = None
    robot: str | None = None
    mode: str | None = None
    ros: RosTransport | None = None
    ros_args: tuple[str, ...] = ()
    seed: int | None = None
    participant: str | None = None
    condition: str | None = None
    language: str | None = None
    allow_untranslated: bool = False
    sets: tuple[str, ...] = ()
    """Start values of the memory, as written: `KEY=JSON`."""
    places: tuple[str, ...] = ()
    """The paths of acts, rules and memory, as written: `KIND=PATH`."""
    new: bool = False
    recover: bool = False
    here: bool = False
    session: str | None = None
    observe: bool = False
    wizard: str | None = None
    """None: see `open_console.wizard_name`."""
    replay: str | None = None
    shadow: str | None = None
    at: str | None = None
    """The start of a shadow, as written."""
    speed: float = 1.0
    display: DisplayOptions = DisplayOptions()
    keys: str | None = None
    fresh: bool = False
    resume: str = ""
    """The folder of the session to recover, as chosen in the launcher."""

    @property
    def role(self) -> Role:
        """The role in which the console attaches."""
        return "observer" if self.observe else "wizard"

    @property
    def unfinished(self) -> str:
        """What to do with an earlier session that did not end: `new`, `recover`, `ask`, or the folder to recover."""
        return self.resume or ("new" if self.new else "recover" if self.recover else "ask")

    @property
    def only_for_new(self) -> list[str]:
        """The given options that have no meaning for a running session."""
        return ["--set"] * bool(self.sets) + ["--place"] * bool(self.places)

    @property
    def only_for_scenarios(self) -> list[str]:
        """The given options that a study sets itself."""
        given = {
            "--robot": self.robot,
            "--mode": self.mode,
            "--seed": self.seed,
            "--condition": self.condition,
            "--language": self.language,
            "--allow-untranslated": self.allow_untranslated or None,
            "--set": self.sets or None,
            "--place": self.places or None,
            "--new": self.new or None,
            "--recover": self.recover or None,
        }
        return [name for name, value in given.items() if value is not None]

    @property
    def settings(self) -> SessionOptions:
        """The options for starting a session."""
        return SessionOptions(
            self.folder or "",
            self.robot,
            self.mode,
            paths=parse_paths(self.places),
            ros=RosConnection(self.ros or "auto", self.ros_args),
            participant=self.participant or "",
            condition=self.condition or "",
            language=self.language or "",
            allow_untranslated=self.allow_untranslated,
        )


class PlainTerminal:
    """Implements `rise_tui.cli.command_line.Prompter`."""

    @property
    def interactive(self) -> bool:
        """Whether the program can ask a person."""
        return sys.stdin.isatty() and sys.stdout.isatty()

    def print_line(self, line: str) -> None:
        """Write a line."""
        click.echo(line)

    def read_answer(self, question: str) -> str | None:
        """Return the answer; None: there is no more input."""
        try:
            return str(click.prompt(question, default="", show_default=False, prompt_suffix=" "))
        except click.Abort:
            click.echo("")
            return None


class ProgressLine:
    """The progress of a starting engine, on one line of the terminal that is overwritten."""

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
"""The name in a real session's record if none is given. A login is often a person's name."""


def login_name() -> str:
    """Return the user's login, or `wizard` if the system has none."""
    try:
        return getuser()
    except (KeyError, OSError):
        return "wizard"


def not_started(*lines: str, status: int = USAGE) -> Refused:
    """The error that ends the program before it starts or attaches to anything. The lines give the reason."""
    return Refused(status=status, findings=lines)


def read_key_file(named: str | None) -> KeyFile | None:
    """Read the user's key file, as named on the command line; None without one. Imports Textual. Raises Refused."""
    path = key_file_path(named)
    if path is None:
        return None
    from rise_tui.config.key_file import how_to_fix, read_keys

    keys = read_keys(path)
    if keys.problems:
        raise not_started(*map(str, keys.problems), how_to_fix(path))
    return keys


NOT_OFFERED_AGAIN = "The earlier record stays as it is, and is not offered again."
OFFERED_AGAIN = "What did not end stays as it is, and can be recovered later."
NARROWEST_WIDTH = 79
"""Cells of a line that fits every supported terminal."""


class Prompter(Protocol):
    """A terminal on which questions can be asked."""

    @property
    def interactive(self) -> bool: ...

    def print_line(self, line: str) -> None: ...

    def read_answer(self, question: str) -> str | None:
        """Return the answer; None: there is no more input."""
        ...


def check_matches(name: str, about: SessionSummary | None, options: CommandLine) -> None:
    """Check that a running session is the requested one. Raises Refused if not."""
    title = clean(about.title) if about is not None else name
    end = "attach with `rise-tui` and end it first (ctrl+c)"
    if options.new:
        raise not_started(f"{title} is running already; to begin a new session, {end}")
    if options.only_for_new:
        given = " and ".join(options.only_for_new)
        raise not_started(f"{title} is running already; {given} can only be set for a new session: {end}")
    for what in ("mode", "robot", "participant", "condition") if about is not None else ():
        wanted, is_now = getattr(options, what), getattr(about, what)
        if wanted is not None and wanted != is_now:
            which = f"with --{what} {clean(is_now)} and not {wanted}" if is_now else f"without --{what}"
            raise not_started(f"{title} is running already, {which}; for the other one, {end}")


def choose_recovery(
    unfinished: Sequence[tuple[str, str]],
    terminal: Prompter,
    others: Sequence[tuple[str, str]] = (),
    participant: str = "",
) -> str:
    """Choose what to do about sessions that did not end: `new`, or the folder of the one to recover.

    `unfinished`: folder and a sentence, the latest first. `others`: unfinished sessions of other participants than the
    requested `participant`. They are shown, but cannot be chosen. Raises Refused.
    """
    if not terminal.interactive:
        raise not_started(WITHOUT_TERMINAL)
    several = len(unfinished) > 1
    if unfinished:
        terminal.print_line(
            f"{len(unfinished)} earlier sessions of this scenario did not end:"
            if several
            else "An earlier session of this scenario did not end:"
        )
        _print_sessions(unfinished, terminal, numbered=several)
    if others:
        what = (
            "These did not end either, and are"
            if unfinished
            else "An earlier session of this scenario did not end. It is"
        )
        _print_wrapped(terminal, "", f"{what} not of {participant}, and never recovered as theirs:")
        _print_sessions(others, terminal)
        _print_wrapped(
            terminal, "", "To go on with one of these, quit, and name its participant: --participant ID --recover"
        )
        terminal.print_line("")
    which = f"recover the latest (1); r2 the second{', and so on' if len(unfinished) > 2 else ''}"
    if unfinished:
        _print_wrapped(
            terminal,
            "  r  ",
            f"{which if several else 'recover it'}. Memory, rules, timers and the stop are as they were. "
            "What the robot was doing counts as lost: nothing is repeated to the participant by itself.",
        )
    for_whom = f" for {participant}" if others else ""
    _print_wrapped(
        terminal,
        "  n  ",
        f"begin a new session{for_whom}. " + (OFFERED_AGAIN if others and not unfinished else NOT_OFFERED_AGAIN),
    )
    terminal.print_line("  q  quit. Nothing is started, nothing changes.")
    terminal.print_line("")
    while (answer := terminal.read_answer("r, n or q?" if unfinished else "n or q?")) is not None:
        wanted = answer.strip().lower()
        if wanted in ("q", "quit"):
            raise not_started(status=OK)
        if wanted in ("n", "new"):
            return "new"
        if unfinished and wanted in ("r", "recover"):
            return unfinished[0][0]
        which = wanted.removeprefix("r").strip()
        if several and which.isdecimal() and 1 <= int(which) <= len(unfinished):
            return unfinished[int(which) - 1][0]
    raise not_started("nothing was chosen, and nothing was started")


def _print_sessions(sessions: Sequence[tuple[str, str]], terminal: Prompter, *, numbered: bool = False) -> None:
    terminal.print_line("")
    for number, (folder, sentence) in enumerate(sessions, 1):
        lead = f"{number}  " if numbered else ""
        _print_wrapped(terminal, f"  {lead}", sentence)
        terminal.print_line(f"  {' ' * len(lead)}{clean(abbreviate_home(folder))}")
    terminal.print_line("")


def _print_wrapped(terminal: Prompter, lead: str, sentence: str) -> None:
    """Print a sentence on the lines that it needs on the narrowest terminal."""
    for at, line in enumerate(wrap(sentence, NARROWEST_WIDTH - len(lead))):
        terminal.print_line(f"{lead if at == 0 else ' ' * len(lead)}{line}")


WITHOUT_TERMINAL = (
    "an earlier session of this scenario did not end, and without a terminal you cannot choose: "
    "use --recover to continue it, or --new"
)
