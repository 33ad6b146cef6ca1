"""The program `rise-engine`: its commands, each loaded when it is asked for.

`check` must be there at once, for editors and scripts that run it all the time: it loads no engine, and a session's
commands load no checker.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from importlib import import_module
from typing import Any

import click

from rise_engine import __version__
from rise_engine.base.errors import RiseError
from rise_engine.base.exit_status import BROKEN_PIPE, INTERRUPTED, OK
from rise_engine.base.plugins import find_plugin, installed_plugins
from rise_engine.cli.terminal import Refused, clean_standard_streams, discard_rest

_SECTIONS = {
    "Write scenarios": {
        "new": ("scenario.new_scenario", "Make a study of your own in a new folder."),
        "check": ("scenario.check", "Report everything that is wrong with a scenario."),
        "explore": ("scenario.explore", "Search everything that can happen for dead ends."),
        "test": ("study.tests", "Run the tests of a scenario or study."),
        "eval": ("scenario.evaluate", "Show the value of an expression."),
        "expand": ("scenario.expand", "Print acts and rules without their templates."),
        "graph": ("scenario.graph", "Draw rules and acts."),
        "robots": ("scenario.robots", "List the robots that a scenario can name."),
        "schema": ("scenario.robots", "Print the schema of acts and rules for an editor."),
    },
    "Change scenarios": {
        "edit": ("scenario.edit_file", "Make the changes of a JSON file, all or none."),
        "fmt": ("scenario.edit_commands", "Format the files of a study."),
        "rename": ("scenario.edit_commands", "Rename an act, rule, state, event or key everywhere."),
        "uses": ("scenario.edit_commands", "Find where a name is used."),
        "texts": ("scenario.texts", "Export all texts as a table, and import it again."),
        "lsp": ("scenario.lsp", "Serve an editor with diagnostics and completion."),
    },
    "Run sessions": {
        "run": ("session.run", "Run a scenario without a console."),
        "serve": ("session.serve", "Run a session that consoles attach to."),
        "sessions": ("session.sessions", "List running and unfinished sessions."),
        "stop": ("session.stop", "Stop the robot and end a session."),
        "take-over": ("session.stop", "Continue a session with changed files."),
        "doctor": ("scenario.robots", "Examine ROS 2 on this machine and the robot."),
        "lsl": ("session.lsl", "Send markers to the Lab Streaming Layer."),
    },
    "Run studies": {
        "study": ("study.commands", "Make, check, plan and run a study."),
    },
    "Use results": {
        "report": ("data.report", "Summarize a session or a study."),
        "export": ("data.export", "Write sessions as tables, BIDS, ELAN and more."),
        "agree": ("data.agree", "Compute the agreement of wizards."),
        "coded": ("data.coded", "Add annotations from ELAN or BORIS to a session."),
        "media": ("data.media", "Attach films and sound to a session."),
        "redact": ("data.redact", "Remove words from a session permanently."),
        "replay": ("session.replay", "Replay a session, and compare the records."),
        "reproduce": ("data.reproduce", "Check that a bundle reproduces its results."),
    },
}
"""Each command's module in this package, in whose `COMMANDS` it is, and its line of the help."""
COMMANDS = {name: module for section in _SECTIONS.values() for name, (module, _) in section.items()}
PLUGINS = "rise.commands"
"""The entry-point group in which a package names commands of its own, each a `click.Command`. The module that it names
is light: help loads it."""


def split_ros_args(arguments: Sequence[str]) -> tuple[list[str], tuple[str, ...]]:
    """Our own arguments, and those between `--ros-args` and `--` or the end, as every ROS 2 program takes them."""
    own: list[str] = []
    ros_args: list[str] = []
    inside = False
    for each in arguments:
        if each == "--ros-args":
            inside = True
        elif inside and each == "--":
            inside = False
        else:
            (ros_args if inside else own).append(each)
    return own, tuple(ros_args)


class CommandGroup(click.Group):
    """The group of all commands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*COMMANDS, *installed_plugins(PLUGINS).names]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        return _load_command(name) if name in COMMANDS else _load_plugin(name)

    def sections(self) -> dict[str, list[tuple[str, str]]]:
        """Commands and their lines of the help, by purpose. Loads nothing that any of them needs."""
        found = {title: [(name, about) for name, (_, about) in rows.items()] for title, rows in _SECTIONS.items()}
        plugins = [(name, _load_plugin(name)) for name in sorted(installed_plugins(PLUGINS).names - COMMANDS.keys())]
        found["Exchange files"] = [(name, each.get_short_help_str(60)) for name, each in plugins if each]
        return found

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, lines in self.sections().items():
            with formatter.section(title):
                formatter.write_dl(lines, col_max=12)

    def main(self, args: Sequence[str] | None = None, *rest: Any, **more: Any) -> Any:
        own, ros_args = split_ros_args(sys.argv[1:] if args is None else args)
        with clean_standard_streams():
            if own[:1] == ["serve"]:
                serve = _load_command("serve")
                arguments = import_module("rise_engine.cli.arguments")  # which needs what `serve` needs
                own, ros_args = arguments.add_ros_parameters(own, ros_args, serve)
            return super().main(own, *rest, obj=ros_args, **more)

    def invoke(self, ctx: click.Context) -> Any:
        """Ends with the exit status that a command returns (None: 0), or with the error that it raises."""
        try:
            status = super().invoke(ctx)
        except RiseError as error:
            raise Refused.of(error) from None
        except BrokenPipeError:
            discard_rest(sys.stdout)
            status = BROKEN_PIPE
        except KeyboardInterrupt:  # before a session has begun; click would end with 1, which means refused
            status = INTERRUPTED
        return ctx.exit(status or OK)


def _load_command(name: str) -> click.Command:
    command: click.Command = import_module(f"rise_engine.cli.{COMMANDS[name]}").COMMANDS[name]
    return command


def _load_plugin(name: str) -> click.Command | None:
    found = find_plugin(PLUGINS, name)
    command: click.Command | None = found.load() if found is not None else None
    return command


@click.group(cls=CommandGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="rise-engine")
def main() -> None:
    """Check and run human-robot interaction scenarios, without a screen."""
