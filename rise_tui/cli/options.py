"""The options that commands of `rise-tui` share, and the command line as data."""

from __future__ import annotations

import click
from msgspec import Struct

from rise_engine.cli.arguments import parse_paths
from rise_engine.ports.bridge import RosConnection, RosTransport
from rise_engine.run.protocol.client import Role
from rise_engine.run.protocol.session_options import SessionOptions
from rise_tui.config.display import DisplayOptions

THEMES = ("dark", "light", "contrast", "colorblind", "mono", "terminal")
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
    """Where acts, rules and memory are read, as written: `KIND=PATH`."""
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
    """Where a shadow begins, as written."""
    speed: float = 1.0
    display: DisplayOptions = DisplayOptions()
    keys: str | None = None
    fresh: bool = False

    @property
    def role(self) -> Role:
        """The role in which the console attaches."""
        return "observer" if self.observe else "wizard"

    @property
    def unfinished(self) -> str:
        """What to do about an earlier session that did not end."""
        return "new" if self.new else "recover" if self.recover else "ask"

    @property
    def only_for_new(self) -> list[str]:
        """The given options that mean nothing to a running session."""
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
        """What a session is started with."""
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
