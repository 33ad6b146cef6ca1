"""`rise-tui`: the options and the subcommands."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from typing import Any

import click
from click.core import ParameterSource
from click.shell_completion import get_completion_class

from rise_engine import __version__
from rise_engine.cli.options import HERE, NEW, PLACES, RECOVER, SEED, SESSION_OPTIONS, SETTINGS, options
from rise_engine.cli.program import LazyGroup, split_ros_args
from rise_engine.cli.terminal import clean_standard_streams
from rise_tui.cli.command_line import KEYS, MOUSE, THEME, CommandLine
from rise_tui.cli.start import start
from rise_tui.config.display import DEFAULT_FRAMES, MAX_FRAMES, DisplayOptions

_COMMANDS = {
    "completions": ("rise_tui.cli.main:completions", "Complete commands with the tab key in your shell."),
    "edit": ("rise_tui.cli.edit:edit", "Change a study: acts, memory, keys, settings, tables."),
    "info": ("rise_tui.cli.info:info", "Print what a bug report needs."),
    "keys": ("rise_tui.cli.key_card:keys", "Print a card with all keys."),
}
"""The place of each subcommand, and its line in the help. Most of them import Textual."""
_NAMES = ("participant", "condition", "language", "wizard")
"""Options that have no meaning when they are empty."""


class _Program(LazyGroup):
    """The command group. It passes the arguments after `--ros-args` to the session's connection to ROS."""

    def main(self, args: Sequence[str] | None = None, *rest: Any, **more: Any) -> Any:
        ours, theirs = split_ros_args(sys.argv[1:] if args is None else args)
        with clean_standard_streams():
            return super().main(ours, *rest, obj=theirs, **more)


@click.group(
    cls=_Program,
    sections={"Commands": _COMMANDS},
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    subcommand_metavar="[COMMAND]",
)
@click.option(
    "--config",
    "folder",
    metavar="DIR",
    help="Open this scenario or study: its folder, its scenario.toml or its study.toml.",
)
@options(*SESSION_OPTIONS)
@SEED
@SETTINGS
@PLACES
@NEW
@RECOVER
@HERE
@click.option("--session", metavar="NAME", help="Attach to the running session with this name or socket.")
@click.option(
    "--observe", is_flag=True, help="Only watch. You can stop everything and add notes, but never take control."
)
@click.option(
    "--wizard",
    metavar="NAME",
    help="Record the session with this wizard's name. Default: the last wizard here, else your login name.",
)
@click.option("--replay", "replay", metavar="SESSION", help="Watch the recorded session with this folder or name.")
@click.option(
    "--shadow",
    "shadow",
    metavar="SESSION",
    help="Answer the cues of a recorded session as a second wizard. Your keys are kept and sent nowhere.",
)
@click.option("--at", metavar="SECONDS|mark", help="Begin the shadow here. mark2: at the second mark for recordings.")
@click.option(
    "--speed", type=click.FloatRange(0.01, 1000), default=1.0, help="Play a replay or a shadow this many times as fast."
)
@THEME
@click.option(
    "--colors",
    type=click.Choice(["auto", "truecolor", "256", "16", "mono"]),
    default="auto",
    show_default=True,
    help="Set what the terminal can show. auto: what it reports.",
)
@MOUSE
@click.option(
    "--fps",
    type=click.IntRange(1, MAX_FRAMES),
    default=DEFAULT_FRAMES,
    show_default=True,
    help="Paint the screen at most this many times a second. Use fewer on a slow link.",
)
@KEYS
@click.option("--fresh", is_flag=True, help="Do not restore the layout, filters and theme of the last time.")
@click.version_option(__version__)
@click.pass_context
def main(context: click.Context, /, theme: str | None, colors: str, mouse: str, fps: int, **given: Any) -> None:
    """Run a study from this terminal.

    With --config, attach to that scenario's session, or start one in the background. For a study, open the screen on
    which its sessions begin. Without --config, attach to the running session, or choose a session or study from a
    list. A session continues when its console closes.

    F9 or ctrl+g stops everything, on every screen. ? shows all keys. ctrl+c leaves.
    """
    if context.invoked_subcommand is not None:
        _check_alone(context)
        return
    display = DisplayOptions(theme or "", colors, mouse == "on", fps)
    if context.get_parameter_source("ros") is not ParameterSource.COMMANDLINE:
        given["ros"] = None
    given["wizard"] = (given["wizard"] or "").strip()
    given |= {name: given[name] or None for name in _NAMES}
    places, sets = given.pop("paths"), given.pop("settings")
    command_line = CommandLine(display=display, ros_args=tuple(context.obj or ()), places=places, sets=sets, **given)
    _check_usage(command_line)
    start(command_line)


def _check_alone(context: click.Context) -> None:
    """Refuse an option before a subcommand, which would otherwise be lost silently."""
    given = [
        option.opts[0]
        for option in context.command.params
        if option.name and context.get_parameter_source(option.name) is ParameterSource.COMMANDLINE
    ]
    if given:
        raise click.UsageError(f"{', '.join(given)} cannot come before `{context.invoked_subcommand}`")


def _check_usage(options: CommandLine) -> None:
    starting = {
        "--robot": options.robot,
        "--mode": options.mode,
        "--ros": options.ros,
        "--seed": options.seed,
        "--participant": options.participant,
        "--condition": options.condition,
        "--language": options.language,
        "--allow-untranslated": options.allow_untranslated or None,
        "--set": options.sets or None,
        "--place": options.places or None,
        "--new": (options.new and options.shadow is None) or None,
        "--recover": (options.recover and options.shadow is None) or None,
    }
    given = [name for name, value in starting.items() if value is not None]
    if options.folder is None and given:
        raise click.UsageError(f"use {', '.join(given)} only with --config DIR, which names the scenario to start")
    if options.allow_untranslated and not options.language:
        raise click.UsageError("--allow-untranslated goes with --language")
    if options.new and options.recover:
        raise click.UsageError("use either --new or --recover")
    if options.here and not options.recover:
        raise click.UsageError("--here goes with --recover")
    which = {
        "--config": options.folder,
        "--session": options.session,
        "--replay": options.replay,
        "--shadow": options.shadow,
    }
    named = [name for name, value in which.items() if value is not None]
    if len(named) > 1:
        raise click.UsageError(f"say either {' or '.join(named)}")
    if options.shadow is not None and options.observe:
        raise click.UsageError("--shadow is for a second wizard: --observe does not go with it")
    if options.replay is None and options.shadow is None and options.speed != 1.0:
        raise click.UsageError("--speed is for --replay and --shadow")
    if options.at is not None and options.shadow is None:
        raise click.UsageError("--at is for --shadow")
    if options.shadow is not None and options.recover and (options.at is not None or options.speed != 1.0):
        raise click.UsageError("--recover goes on where the shadow stopped, at its speed: neither --at nor --speed")
    if options.display.colors == "mono" and options.display.theme not in ("", "mono"):
        raise click.UsageError(f"--colors mono leaves no colours for --theme {options.display.theme}")


@click.command()
@click.argument("shell", type=click.Choice(["bash", "zsh", "fish"]))
def completions(shell: str) -> None:
    """Print a script that completes commands and options with the tab key in your shell.

    \b
    bash  in ~/.bashrc:  eval "$(rise-tui completions bash)"
    zsh   in ~/.zshrc:   eval "$(rise-tui completions zsh)"
    fish  once:          rise-tui completions fish > ~/.config/fish/completions/rise-tui.fish
    """
    found = get_completion_class(shell)
    assert found is not None
    click.echo(found(main, {}, "rise-tui", "_RISE_TUI_COMPLETE").source())
