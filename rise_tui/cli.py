"""`rise-tui`: read a scenario, start its engine, open the console."""

from __future__ import annotations

import os
import sys
from contextlib import suppress
from getpass import getuser
from random import SystemRandom

import click


def _wizard() -> str:
    try:
        return getuser()
    except (KeyError, OSError):
        return "wizard"


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--config", "folder", metavar="DIR", required=True, help="The scenario: a folder, or its scenario.toml.")
@click.option("--robot", metavar="NAME", help="Another robot than the scenario names.")
@click.option("--mode", type=click.Choice(["debug", "real"]), help="Another mode than the scenario's.")
@click.option("--seed", type=int, help="Seed of the session's chance; without it, a new one each time.")
@click.option("--theme", type=click.Choice(["dark", "light", "contrast"]), default="dark", show_default=True)
@click.option("--wizard", metavar="NAME", default=_wizard, help="Who sits at the console; stands in every record.")
@click.version_option(package_name="rise-tui")
def main(folder: str, robot: str | None, mode: str | None, seed: int | None, theme: str, wizard: str) -> None:
    """Run a study from this terminal.

    F9 or ctrl+g stops everything, on every screen. ? shows all keys. ctrl+c ends the session.
    """
    from rise_tui.launch import Refused, Settings, prepare

    chosen = Settings(folder, robot, mode, seed if seed is not None else SystemRandom().randrange(2**31))
    scenario = prepare(chosen)
    if isinstance(scenario, Refused):
        for line in scenario.lines:
            click.echo(line)
        click.echo(f"{folder} was refused: nothing was started", err=True)
        sys.exit(1)
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        click.echo("the console needs a terminal; `rise-engine run` needs none", err=True)
        sys.exit(2)
    os.environ.setdefault("TEXTUAL_ANIMATIONS", "none")  # read when Textual is imported
    from rise_tui.app import ConsoleApp

    app = ConsoleApp(scenario, chosen, wizard=wizard.strip() or "wizard", theme=theme)
    app.run()
    if app.last_words and not app.terminal_gone:
        with suppress(OSError):  # it may have gone just now
            click.echo(app.last_words, err=True)
    sys.exit(app.return_code or 0)


if __name__ == "__main__":
    main()
