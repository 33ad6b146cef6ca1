"""The commands about scenarios and robots: check, eval, expand, schema, robots, doctor."""

from __future__ import annotations

import sys

import click

from rise_engine import exit_status
from rise_engine.cli.arguments import exit_with_usage, parse_number, resolve_scenario
from rise_engine.cli.check import (
    UnknownActError,
    UnusableMemoryError,
    check_report,
    doctor_report,
    eval_report,
    explain_act_report,
    functions_report,
    read_memory,
    robots_report,
    schema_text,
)
from rise_engine.cli.expand import ExpandError, expand_report
from rise_engine.cli.options import FOLDER, FOLDER_OR_NONE, JSON, LANGUAGE, MODE, ROBOT, ROS
from rise_engine.cli.terminal import write_xml
from rise_engine.ports.bridge import RosConnection, RosTransport


class _ExpressionCommand(click.Command):
    """Takes `-1`, `-n` and `-2^2` as an expression. Only `--word`, and `-h`, are options."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        takes_value = {
            name: not parameter.is_flag
            for parameter in self.get_params(ctx)
            if isinstance(parameter, click.Option)
            for name in parameter.opts
        }
        options: list[str] = []
        expressions: list[str] = []
        rest = iter(args)
        for arg in rest:
            if arg == "--":
                expressions += rest
            elif arg in takes_value:
                options.append(arg)
                if takes_value[arg]:
                    options += [each for each in (next(rest, None),) if each is not None]
            elif arg.startswith("--") and arg[2:3].isalpha():
                options.append(arg)  # with `=value`, or one that does not exist: click says so, and names the nearest
            else:
                expressions.append(arg)
        return super().parse_args(ctx, [*options, "--", *expressions])


@click.command()
@FOLDER
@JSON
@click.option("--all", "all_of_them", is_flag=True, help="Also the warnings that were silenced, with their reasons.")
@click.option(
    "--explain", "act", metavar="ACT", help="Say what scenario.toml sets for an act instead, and in which line."
)
@click.option("--deep", is_flag=True, help="Also look at what can happen in it, for some seconds.")
@ROBOT
@MODE
@LANGUAGE
def check(
    folder: str,
    as_json: bool,
    all_of_them: bool,
    act: str | None,
    deep: bool,
    robot: str | None,
    mode: str | None,
    language: str,
) -> None:
    """Say everything that is wrong with the scenario in DIR.

    With --deep also what can go wrong in a session: everything that can happen is looked at, as `explore` does, but
    without stops and lost robots, and for five seconds at most.

    Exit status: 0 without errors (warnings may be there), 1 with errors or problems, 2 no such folder or act.
    """
    folder = resolve_scenario(folder)
    if act is not None:
        try:
            sys.exit(explain_act_report(folder, act, robot=robot, mode=mode, as_json=as_json))
        except UnknownActError as error:
            exit_with_usage(str(error))
    sys.exit(
        check_report(
            folder, robot=robot, mode=mode, as_json=as_json, all_of_them=all_of_them, language=language, deep=deep
        )
    )


@click.command("eval", cls=_ExpressionCommand)
@click.argument("expression", required=False)
@click.option("--functions", is_flag=True, help="List the functions: what each takes and gives, with an example.")
@click.option(
    "--memory", metavar="JSON", default="{}", help="The memory: a JSON object, or the path of a memory.json (or @PATH)."
)
@JSON
def evaluate(expression: str | None, functions: bool, memory: str, as_json: bool) -> None:
    """Show the value of EXPRESSION, its type, and how it was read. It may begin with a minus: -2^2.

    Exit status: 0; 1 when it is refused or cannot be evaluated; 2 when the memory cannot be read.
    """
    if functions:
        sys.exit(functions_report(as_json=as_json))
    if expression is None:
        exit_with_usage("write an expression, in quotation marks: rise-engine eval '2 + 3' (or --functions)")
    try:
        values = read_memory(memory)
    except UnusableMemoryError as error:
        exit_with_usage(f"--memory: {error}")
    sys.exit(eval_report(expression, values, as_json=as_json))


@click.command()
@FOLDER_OR_NONE
@click.option("--kind", type=click.Choice(["cra", "rules", "bml"]), required=True, help="Acts, rules, or BML 1.0.")
@ROBOT
def schema(folder: str | None, kind: str, robot: str | None) -> None:
    """Print the RELAX NG schema of act, rule or BML files, for an editor that completes and checks them.

    With DIR, it knows the actions of that scenario and its robot too.
    """
    if folder is not None:
        folder = resolve_scenario(folder)
    text = schema_text(folder, kind, robot)
    if text is None:
        sys.exit(exit_status.REFUSED)
    write_xml(text.rstrip("\n"))


@click.command()
@FOLDER_OR_NONE
@JSON
def robots(folder: str | None, as_json: bool) -> None:
    """List the robots that a scenario can name, where each comes from and what it can do."""
    if folder is not None:
        folder = resolve_scenario(folder)
    sys.exit(robots_report(folder, as_json=as_json))


@click.command()
@FOLDER_OR_NONE
@ROBOT
@ROS
@click.option("--seconds", metavar="N", default="3", help="How long to look for the robot at most. Default: 3.")
@JSON
def doctor(folder: str | None, robot: str | None, ros: RosTransport, seconds: str, as_json: bool) -> None:
    """Say how ROS 2 stands on this machine, and whether the robot answers: of the scenario in DIR, or --robot.

    Nothing is sent to the robot. Exit status: 0; 1 when something is in the way; 2 when there is no such robot.
    """
    if folder is not None:
        folder = resolve_scenario(folder)
    patience = parse_number("--seconds", seconds, "a number of seconds above 0, up to 600", 600, least_excluded=True)
    connection = RosConnection(ros, click.get_current_context().obj)
    sys.exit(doctor_report(folder, robot=robot, ros=connection, seconds=patience, as_json=as_json))


@click.command()
@FOLDER
@click.option(
    "-o", "--output", "new", metavar="NEWDIR", help="Write a copy of the scenario there, in a new or empty folder."
)
def expand(folder: str, new: str | None) -> None:
    """Print the acts and rules of the scenario in DIR without templates, as they would have been written by hand.

    Standard error says what is in them that RISE itself does not know. Exit status: 0; 1 when the scenario has errors
    or the copy cannot be written; 2 when there is no such folder.
    """
    folder = resolve_scenario(folder)
    try:
        sys.exit(expand_report(folder, new))
    except ExpandError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(exit_status.REFUSED)


COMMANDS = {
    "check": check,
    "doctor": doctor,
    "eval": evaluate,
    "expand": expand,
    "robots": robots,
    "schema": schema,
}
