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
from rise_engine.cli.arguments import add_ros_parameters, split_ros_args
from rise_engine.cli.terminal import clean_standard_streams
from rise_engine.exit_status import INTERRUPTED

_SCENARIO = "rise_engine.cli.scenario_commands"
_SESSION = "rise_engine.cli.session_commands"
_STUDY = "rise_engine.cli.study_commands"
_COMMANDS = {
    **dict.fromkeys(("check", "doctor", "eval", "expand", "robots", "schema"), _SCENARIO),
    "lsl": "rise_engine.cli.lsl",
    "lsp": "rise_engine.cli.lsp",
    "agree": "rise_engine.cli.agree",
    "coded": "rise_engine.cli.coded",
    "convert": "rise_engine.cli.convert",
    "explore": "rise_engine.cli.explore",
    "export": "rise_engine.cli.export",
    "import": "rise_engine.cli.imports",
    "graph": "rise_engine.cli.graph",
    **dict.fromkeys(("fmt", "rename", "uses"), "rise_engine.cli.edit_commands"),
    "edit": "rise_engine.cli.edit_file",
    "media": "rise_engine.cli.media",
    "new": "rise_engine.cli.new_scenario",
    "redact": "rise_engine.cli.redact",
    "reproduce": "rise_engine.cli.reproduce",
    "report": "rise_engine.cli.report",
    "texts": "rise_engine.cli.texts",
    **dict.fromkeys(("replay", "run", "serve", "sessions", "stop"), _SESSION),
    "study": _STUDY,
    "take-over": "rise_engine.cli.take_over",
    "test": "rise_engine.cli.study_tests",
}
"""Each command's name, and the module where it is the value of `COMMANDS`."""


class _CommandGroup(click.Group):
    """The group of all commands."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return sorted(_COMMANDS)

    def get_command(self, ctx: click.Context, name: str) -> click.Command | None:
        return _load_command(name) if name in _COMMANDS else None

    def main(self, args: Sequence[str] | None = None, *rest: Any, **more: Any) -> Any:
        own, ros_args = split_ros_args(sys.argv[1:] if args is None else args)
        with clean_standard_streams():
            if own[:1] == ["serve"]:
                own, ros_args = add_ros_parameters(own, ros_args, _load_command("serve"))
            return super().main(own, *rest, obj=ros_args, **more)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:  # before a session has begun; click would end with 1, which means refused
            sys.exit(INTERRUPTED)


def _load_command(name: str) -> click.Command:
    command: click.Command = import_module(_COMMANDS[name]).COMMANDS[name]
    return command


@click.group(cls=_CommandGroup, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="rise-engine")
def main() -> None:
    """Check and run human-robot interaction scenarios, without a screen."""
