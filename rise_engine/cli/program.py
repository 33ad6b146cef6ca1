"""The program `rise-engine`, which loads each command only when it is used.

`check` must start fast, because editors and scripts run it often: it loads no engine, and a session's commands load no
checker.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import click

from rise_engine import __version__
from rise_engine.base.errors import RiseError
from rise_engine.base.exit_status import BROKEN_PIPE, INTERRUPTED, OK
from rise_engine.base.plugins import find_plugin, installed_plugins
from rise_engine.cli.terminal import Refused, clean_standard_streams, discard_rest


def load_command(place: str) -> click.Command:
    """Load a command from its place, `package.module:attribute`."""
    module, _, attribute = place.partition(":")
    command: click.Command = getattr(import_module(module), attribute)
    return command


class LazyGroup(click.Group):
    """A group with the places of its commands and their lines of the help."""

    def __init__(self, *arguments: Any, sections: Mapping[str, Mapping[str, tuple[str, str]]], **more: Any) -> None:
        """:param sections: the sections of the help: the place and the help line of each command, by its name."""
        super().__init__(*arguments, **more)
        self._sections = sections
        self.places = {name: place for section in sections.values() for name, (place, _) in section.items()}

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(self.places)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        return load_command(self.places[name]) if name in self.places else None

    def help_sections(self) -> dict[str, list[tuple[str, str]]]:
        """Return the commands and their lines of the help, by section, without loading them."""
        return {
            title: [(name, about) for name, (_, about) in section.items()] for title, section in self._sections.items()
        }

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        for title, lines in self.help_sections().items():
            with formatter.section(title):
                formatter.write_dl(lines, col_max=12)


_SECTIONS = {
    "Write scenarios": {
        "new": ("rise_engine.cli.scenario.new_scenario:new", "Make a study of your own in a new folder."),
        "check": ("rise_engine.cli.scenario.check:check", "Report everything that is wrong with a scenario."),
        "explore": (
            "rise_engine.cli.scenario.explore:explore_command",
            "Search everything that can happen for dead ends.",
        ),
        "test": ("rise_engine.cli.study.tests:test", "Run the tests of a scenario or study."),
        "eval": ("rise_engine.cli.scenario.evaluate:evaluate", "Show the value of an expression."),
        "expand": ("rise_engine.cli.scenario.expand:expand", "Print acts and rules without their templates."),
        "graph": ("rise_engine.cli.scenario.graph:graph", "Draw rules and acts."),
        "robots": ("rise_engine.cli.scenario.robots:robots", "List the robots that a scenario can name."),
        "schema": ("rise_engine.cli.scenario.robots:schema", "Print the schema of acts and rules for an editor."),
    },
    "Change scenarios": {
        "edit": ("rise_engine.cli.scenario.edit_file:edit", "Make the changes of a JSON file, all or none."),
        "fmt": ("rise_engine.cli.scenario.edit_commands:fmt", "Format the files of a study."),
        "rename": (
            "rise_engine.cli.scenario.edit_commands:rename",
            "Rename an act, rule, state, event or key everywhere.",
        ),
        "uses": ("rise_engine.cli.scenario.edit_commands:uses", "Find where a name is used."),
        "texts": ("rise_engine.cli.scenario.texts:texts", "Export all texts as a table, and import it again."),
        "lsp": ("rise_engine.cli.scenario.lsp:lsp", "Serve an editor with diagnostics and completion."),
    },
    "Run sessions": {
        "run": ("rise_engine.cli.session.run:run", "Run a scenario without a console."),
        "serve": ("rise_engine.cli.session.serve:serve", "Run a session that consoles attach to."),
        "sessions": ("rise_engine.cli.session.sessions:sessions", "List running and unfinished sessions."),
        "stop": ("rise_engine.cli.session.stop:stop", "Stop the robot and end a session."),
        "take-over": ("rise_engine.cli.session.stop:take_over", "Continue a session with changed files."),
        "doctor": ("rise_engine.cli.scenario.robots:doctor", "Examine ROS 2 on this machine and the robot."),
        "lsl": ("rise_engine.cli.session.lsl:lsl", "Send markers to the Lab Streaming Layer."),
    },
    "Run studies": {
        "study": ("rise_engine.cli.program:study", "Make, check, plan and run a study."),
    },
    "Use results": {
        "report": ("rise_engine.cli.data.report:report", "Summarize a session or a study."),
        "export": ("rise_engine.cli.data.export:export", "Write sessions as tables, BIDS, ELAN and more."),
        "agree": ("rise_engine.cli.data.agree:agree", "Compute the agreement of wizards."),
        "coded": ("rise_engine.cli.data.coded:coded", "Add annotations from ELAN or BORIS to a session."),
        "media": ("rise_engine.cli.data.media:media", "Attach films and sound to a session."),
        "redact": ("rise_engine.cli.data.redact:redact_session", "Remove words from a session permanently."),
        "replay": ("rise_engine.cli.session.replay:replay_session", "Replay a session, and compare the records."),
        "reproduce": ("rise_engine.cli.data.reproduce:reproduce", "Check that a bundle reproduces its results."),
    },
}
"""The commands in the order of help, each with its place and its line of the help."""
PLUGINS = "rise.commands"
"""The entry-point group for a package's own commands, each a `click.Command` in a light module: help loads it."""


def split_ros_args(arguments: Sequence[str]) -> tuple[list[str], tuple[str, ...]]:
    """Split our own arguments from those between `--ros-args` and `--` or the end, like every ROS 2 program."""
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


class CommandGroup(LazyGroup):
    """The group of all commands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return [*super().list_commands(ctx), *sorted(installed_plugins(PLUGINS).names)]

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        return super().get_command(ctx, name) or _load_plugin(name)

    def help_sections(self) -> dict[str, list[tuple[str, str]]]:
        plugins = {name: _load_plugin(name) for name in sorted(installed_plugins(PLUGINS).names - self.places.keys())}
        lines = [(name, each.get_short_help_str(60)) for name, each in plugins.items() if each]
        return {**super().help_sections(), **({"Exchange files": lines} if lines else {})}

    def main(self, args: Sequence[str] | None = None, *rest: Any, **more: Any) -> Any:
        own, ros_args = split_ros_args(sys.argv[1:] if args is None else args)
        with clean_standard_streams():
            if own[:1] == ["serve"]:
                serve = load_command(self.places["serve"])
                arguments = import_module("rise_engine.cli.arguments")  # needs the same as `serve`
                own, ros_args = arguments.add_ros_parameters(own, ros_args, serve)
            return super().main(own, *rest, obj=ros_args, **more)

    def invoke(self, ctx: click.Context) -> Any:
        """Run a command, and exit with the status that it returns (None: 0), or with the error that it raises."""
        try:
            status = super().invoke(ctx)
        except RiseError as error:
            raise Refused.of(error) from None
        except BrokenPipeError:
            discard_rest(sys.stdout)
            status = BROKEN_PIPE
        except KeyboardInterrupt:  # before a session has begun; click would exit with 1, which means refused
            status = INTERRUPTED
        return ctx.exit(status or OK)


def _load_plugin(name: str) -> click.Command | None:
    found = find_plugin(PLUGINS, name)
    command: click.Command | None = found.load() if found is not None else None
    return command


@click.group(cls=CommandGroup, sections=_SECTIONS, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="rise-engine")
def main() -> None:
    """Check and run human-robot interaction scenarios, without a screen."""


STUDY = {
    "bundle": ("rise_engine.cli.data.bundle:bundle", "Put a study into one folder or zip file for others."),
    "check": ("rise_engine.cli.study.planning:check", "Report everything that is wrong with a study."),
    "exclude": ("rise_engine.cli.study.day:exclude", "Exclude a participant; the next one gets their row."),
    "new": ("rise_engine.cli.study.new:new", "Make a study: ask what it is about."),
    "next": ("rise_engine.cli.study.day:next_participant", "Show who is next, and how their session begins."),
    "outcome": ("rise_engine.cli.study.day:outcome", "Record how a session counts."),
    "plan": ("rise_engine.cli.study.planning:plan", "Make the plan, once, and print its balance."),
    "reassign": ("rise_engine.cli.study.day:reassign", "Give a session to the participant who took part."),
    "status": ("rise_engine.cli.study.day:status", "Show participants, cells and what is left to do."),
    "withdraw": ("rise_engine.cli.study.withdraw:withdraw", "Erase everything about a participant."),
}
"""The commands of `rise-engine study`, each with its place and its line of the help."""


@click.group("study", cls=LazyGroup, sections={"Commands": STUDY})
def study() -> None:
    """Make, check and run a study: a folder with study.toml (docs/reference/study.md)."""
