"""The command line `rise-engine` (docs/reference/rise-engine.md).

Nothing but click is imported here: `check` must be there at once, so each command imports what it needs itself.
"""

from __future__ import annotations

import gc
import os
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Literal

import click

from rise_engine import __version__
from rise_engine.arguments import (
    UnusableError,
    first_tasks,
    number,
    places_of,
    require_folder,
    script_of,
    split_ros_args,
    usage,
    with_parameters,
)
from rise_engine.terminal import guarded

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rise_engine.bridge import Transport
    from rise_engine.kernel.inputs import Submit

_HELP = {"help_option_names": ["-h", "--help"]}
_LATEST = 30 * 86_400.0
"""Seconds: the latest --until."""
_FASTEST = 1e6
"""The highest --speed; beyond it there is `max`."""
_FOLDER = click.argument("folder", metavar="DIR", type=click.Path())
_SESSION = click.argument("session", type=click.Path())
_ROBOT = click.option("--robot", metavar="NAME", help="Another robot profile than the scenario's.")
_ROS = click.option(
    "--ros",
    type=click.Choice(["auto", "rclpy", "dds", "off"]),
    default="auto",
    show_default=True,
    help="How ROS 2 is spoken. auto: as the robot needs it.",
)
_PARTICIPANT = click.option("--participant", metavar="ID", default="", help="Who takes part; stands in the record.")
_CONDITION = click.option(
    "--condition",
    metavar="NAME",
    default="",
    help="The session's condition; one of the study's, if it lists any.",
)
_HERE = click.option(
    "--here",
    is_flag=True,
    help="Go on also with one that another computer had last, where nobody can see whether it still has.",
)
_MODE = click.option("--mode", type=click.Choice(["debug", "real"]), help="Another mode than the scenario's.")


class _Program(click.Group):
    """The group; called without arguments, as the installed script does, it is the whole process."""

    def __call__(self, *args: Any, **more: Any) -> Any:
        if sys.argv[1:2] != ["check"]:
            return super().__call__(*args, **more)
        # Editors and scripts run `check` all the time. It lives for a moment and keeps nothing: collecting garbage and
        # taking the interpreter down in order would be a fifth of its time.
        gc.disable()
        try:
            return super().__call__(*args, **more)
        except SystemExit as end:
            if isinstance(end.code, int):
                with suppress(OSError):  # a closed pipe: nobody reads it
                    sys.stdout.flush()
                    sys.stderr.flush()
                os._exit(end.code)
            raise

    def main(self, args: Sequence[str] | None = None, *rest: Any, **more: Any) -> Any:
        ours, theirs = split_ros_args(sys.argv[1:] if args is None else args)
        with guarded():
            if ours[:1] == ["serve"]:
                ours, theirs = with_parameters(ours, theirs, serve)
            return super().main(ours, *rest, obj=theirs, **more)

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:  # before a session has begun; click would end with 1, which means refused
            sys.exit(130)


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


@click.group(cls=_Program, context_settings=_HELP)
@click.version_option(__version__, prog_name="rise-engine")
def main() -> None:
    """Check and run human-robot interaction scenarios, without a screen."""


@main.command()
@_FOLDER
@click.option("--json", "as_json", is_flag=True, help="One JSON document instead of lines.")
@click.option("--all", "all_of_them", is_flag=True, help="Also the warnings that were silenced, with their reasons.")
@_ROBOT
@_MODE
def check(folder: str, as_json: bool, all_of_them: bool, robot: str | None, mode: str | None) -> None:
    """Say everything that is wrong with the scenario in DIR.

    Exit status: 0 without errors (warnings may be there), 1 with errors, 2 when there is no such folder.
    """
    from rise_engine.reports import check_report

    folder = require_folder(folder)
    sys.exit(check_report(folder, robot=robot, mode=mode, as_json=as_json, all_of_them=all_of_them))


@main.command("eval", cls=_ExpressionCommand)
@click.argument("expression", required=False)
@click.option("--functions", is_flag=True, help="List the functions: what each takes and gives, with an example.")
@click.option(
    "--memory", metavar="JSON", default="{}", help="The memory: a JSON object, or the path of a memory.json (or @PATH)."
)
@click.option("--json", "as_json", is_flag=True, help="One JSON document instead of lines.")
def evaluate(expression: str | None, functions: bool, memory: str, as_json: bool) -> None:
    """Show the value of EXPRESSION, its type, and how it was read. It may begin with a minus: -2^2.

    Exit status: 0; 1 when it is refused or cannot be evaluated; 2 when the memory cannot be read.
    """
    from rise_engine.reports import UnusableMemoryError, eval_report, functions_report, read_memory

    if functions:
        sys.exit(functions_report(as_json=as_json))
    if expression is None:
        usage("write an expression, in quotation marks: rise-engine eval '2 + 3' (or --functions)")
    try:
        values = read_memory(memory)
    except UnusableMemoryError as error:
        usage(f"--memory: {error}")
    sys.exit(eval_report(expression, values, as_json=as_json))


@main.command()
@_FOLDER
@click.option("--set", "settings", metavar="KEY=JSON", multiple=True, help="Set a memory value first. Repeatable.")
@click.option("--rule", "rules", metavar="NAME", multiple=True, help="Start an interaction rule. Repeatable.")
@click.option("--act", "acts", metavar="NAME", multiple=True, help="Start an act. Repeatable.")
@click.option("--tasks", metavar="FILE|-", help="Tasks, one JSON object per line; - is standard input.")
@click.option("--speed", metavar="N|max", default="1", help="How many times faster; max: virtual time.")
@click.option(
    "--until",
    metavar="idle|SECONDS",
    default="idle",
    help="When to end; idle: when nothing happens by itself any more.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, help="For everything picked at random. Default: 0.")
@_ROBOT
@_MODE
@_PARTICIPANT
@_CONDITION
@_ROS
@click.option(
    "--fault", "faults", metavar="SPEC", multiple=True, help="What the simulated robot does wrong. Repeatable."
)
@click.option("--json", "as_json", is_flag=True, help="Print the records, one JSON object per line.")
@click.option("--strict", is_flag=True, help="Exit with 3 when a task was rejected or aborted.")
def run(
    folder: str,
    settings: tuple[str, ...],
    rules: tuple[str, ...],
    acts: tuple[str, ...],
    tasks: str | None,
    speed: str,
    until: str,
    seed: int,
    robot: str | None,
    mode: str | None,
    participant: str,
    condition: str,
    ros: Transport,
    faults: tuple[str, ...],
    as_json: bool,
    strict: bool,
) -> None:
    """Run the scenario in DIR without a screen.

    First every --set, then every --rule, every --act, and the tasks by their time.

    \b
    What --fault understands (simulated robot only; @N: only the N-th of that action):
      Speech=reject  Speech=fail  Speech=fail@2  LookAt=slow:3  Speech=hang
      vanish@12.5    vanish@12.5-20

    Exit status: 0; 1 scenario refused; 2 wrong usage; 3 with --strict, a task was rejected or aborted; 4 it would never
    have ended; 130 interrupted.
    """
    from rise_engine.bridge import BridgeError, Wire
    from rise_engine.reports import load_or_refuse
    from rise_engine.robots import DriverError, RobotOptionsError
    from rise_engine.run import REFUSED, USAGE, Plan
    from rise_engine.run import run as run_session
    from rise_engine.scenario.study import condition_problem

    pace = None
    if speed != "max":
        pace = number("--speed", speed, "a number above 0, up to 1000000, or max", _FASTEST, least_excluded=True)
    elif ros in ("rclpy", "dds"):
        usage(f"--ros {ros} needs real time, and --speed max is virtual time")
    end = None
    if until != "idle":
        end = number("--until", until, "a number of seconds, 0 or more, up to 2592000 (30 days), or idle", _LATEST)
    folder = require_folder(folder)
    try:
        scenario = load_or_refuse(folder, robot=robot, mode=mode)
        if scenario is None:
            sys.exit(REFUSED)
        first = first_tasks(scenario, settings, rules, acts)
        if problem := condition_problem(scenario, condition):
            raise UnusableError(f"error: --condition: {problem}")
        script, stream = script_of(tasks, virtual=pace is None)
        plan = Plan(
            scenario=scenario,
            first=first,
            script=script,
            stream=stream,
            speed=pace,
            until=end,
            seed=seed,
            faults=faults,
            participant=participant,
            condition=condition,
            wire=Wire(ros, click.get_current_context().obj),
            json=as_json,
            strict=strict,
        )
        sys.exit(run_session(plan))
    except BridgeError as error:
        for line in error.lines:
            click.echo(f"error: {line}", err=True)
        sys.exit(REFUSED)
    except DriverError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(REFUSED)
    except RobotOptionsError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(USAGE)
    except UnusableError as error:
        click.echo(str(error), err=True)
        sys.exit(USAGE)


@main.command()
@_FOLDER
@click.option("--name", metavar="NAME", help="Of the session's socket; without it, made from DIR.")
@click.option("--set", "settings", metavar="KEY=JSON", multiple=True, help="Set a memory value first. Repeatable.")
@click.option("--rule", "rules", metavar="NAME", multiple=True, help="Start an interaction rule. Repeatable.")
@click.option("--act", "acts", metavar="NAME", multiple=True, help="Start an act. Repeatable.")
@click.option("--recover", is_flag=True, help="Go on with the latest session of DIR that did not end, if there is one.")
@click.option("--session", "session", metavar="SESSION", help="Go on with this session.")
@_HERE
@click.option("--new", is_flag=True, help="Begin a new session, also when an earlier one did not end.")
@click.option("--speed", metavar="N", default="1", help="How many times faster.")
@click.option("--seed", type=click.IntRange(min=0), help="For everything picked at random; without it, a new one.")
@_ROBOT
@_MODE
@_PARTICIPANT
@_CONDITION
@_ROS
@click.option(
    "--fault", "faults", metavar="SPEC", multiple=True, help="What the simulated robot does wrong. Repeatable."
)
@click.option(
    "--place",
    "places",
    metavar="KIND=PATH",
    multiple=True,
    help="Read acts, rules or memory from another PATH in the scenario's folder (memory=pilot.json). Repeatable.",
)
def serve(
    folder: str,
    name: str | None,
    settings: tuple[str, ...],
    rules: tuple[str, ...],
    acts: tuple[str, ...],
    recover: bool,
    session: str | None,
    here: bool,
    new: bool,
    speed: str,
    seed: int | None,
    robot: str | None,
    mode: str | None,
    participant: str,
    condition: str,
    ros: Transport,
    faults: tuple[str, ...],
    places: tuple[str, ...],
) -> None:
    """Run a session of the scenario in DIR, for consoles to attach to (`rise-tui`). It needs no terminal.

    It ends when a console ends it, with `rise-engine stop`, or by SIGTERM or SIGINT: first the robot stops.

    Exit status: 0; 1 scenario refused; 2 wrong usage; 3 a session of DIR is running already; 4 an earlier one did not
    end: say --recover or --new; 5 it cannot be recovered; 70 the engine failed; 74 not everything could be recorded.
    """
    from rise_engine.bridge import Wire
    from rise_engine.serve import Order, to_person
    from rise_engine.serve import serve as serve_session

    pace = number("--speed", speed, "a number above 0, up to 1000000", _FASTEST, least_excluded=True)
    if (recover or session is not None) and new:
        usage("say either --recover or --new")
    folder = require_folder(folder)
    if here and not recover and session is None:
        usage("--here goes with --recover or --session")
    which = session or ("recover" if recover else "new" if new else "ask")
    first: tuple[Submit, ...] = ()
    if settings or rules or acts:
        from rise_engine.reports import load_or_refuse
        from rise_engine.run import REFUSED

        scenario = load_or_refuse(folder, robot=robot, mode=mode)
        if scenario is None:
            sys.exit(REFUSED)
        try:
            first = first_tasks(scenario, settings, rules, acts)
        except UnusableError as error:
            click.echo(str(error), err=True)
            sys.exit(2)
    order = Order(
        folder=folder,
        robot=robot,
        mode=mode,
        places=places_of(places),
        seed=seed,
        speed=pace,
        faults=faults,
        first=first,
        wire=Wire(ros, click.get_current_context().obj),
        participant=participant,
        condition=condition,
        name=name,
        unfinished=which,
        here=here,
    )
    sys.exit(serve_session(order, to_person(order)))


@main.command()
@click.argument("folder", metavar="[DIR]", type=click.Path(), required=False)
@click.option("--from", "study", metavar="NAME", help="The shipped study that is copied.")
@click.option("--list", "listing", is_flag=True, help="List the studies that come with the program.")
def new(folder: str | None, study: str | None, listing: bool) -> None:
    """Make a study of your own in DIR, a new or empty folder, from one that comes with the program.

    Exit status: 0; 1 when it could not be made; 2 wrong usage.
    """
    from rise_engine.reports import new_report, studies_report

    if listing:
        sys.exit(studies_report())
    if folder is None or study is None:
        usage("say where and from what, as in: rise-engine new my-study --from lablinking (--list shows all)")
    sys.exit(new_report(folder, study))


@main.command()
@click.option("--json", "as_json", is_flag=True, help="One JSON document instead of lines.")
def sessions(as_json: bool) -> None:
    """List the sessions that run on this machine."""
    from rise_engine.link.reports import sessions_report

    sys.exit(sessions_report(as_json=as_json))


@main.command()
@click.argument("which", metavar="[NAME|DIR|SOCKET]", required=False)
def stop(which: str | None) -> None:
    """End a running session: the robot is stopped, the record is completed.

    Without an argument, the only one that runs. Exit status: 0 it has ended; 1 there is no such session, or several.
    """
    from rise_engine.link.reports import stop_session

    sys.exit(stop_session(which))


@main.command()
@_SESSION
@click.option("--scenario", metavar="DIR", type=click.Path(), help="Another scenario than the session's own copy.")
@click.option("--json", "as_json", is_flag=True, help="One JSON document instead of lines.")
@click.option("--speed", metavar="N", help="Play it in real time, N times as fast, into a console.")
def replay(session: str, scenario: str | None, as_json: bool, speed: str | None) -> None:
    """Feed the inputs of SESSION to a fresh engine, and compare what comes out with what was recorded.

    SESSION is a session's folder, or its name in the sessions folder ($RISE_SESSIONS, or ~/rise-sessions).

    With --speed it is not compared but played: into a console (rise-tui --replay), or as a readable account where
    standard output is no terminal.

    Exit status: 0 identical; 1 different; 2 when it cannot be read.
    """
    from rise_engine.session.reports import play_report, replay_report

    if speed is not None:
        if scenario is not None or as_json:
            usage("--speed plays what was recorded: it goes with neither --scenario nor --json")
        pace = number("--speed", speed, "a number above 0, up to 1000", 1000, least_excluded=True)
        sys.exit(play_report(session, pace))
    if scenario is not None:
        scenario = require_folder(scenario)
    sys.exit(replay_report(session, scenario=scenario, as_json=as_json))


@main.command()
@_SESSION
@click.option("--format", type=click.Choice(["csv", "jsonl"]), required=True, help="A table, or one JSON per record.")
@click.option("-o", "--output", metavar="FILE", type=click.Path(), help="A new file. Default: standard output.")
def export(session: str, format: Literal["csv", "jsonl"], output: str | None) -> None:
    """Write the records of SESSION, for analysis. Also of one that is running, torn or damaged.

    SESSION is a session's folder, or its name in the sessions folder ($RISE_SESSIONS, or ~/rise-sessions).

    Exit status: 0; 1 when something could not be read, and the rest was exported; 2 when nothing was.
    """
    from rise_engine.session.reports import export_report

    sys.exit(export_report(session, format, output))


@main.command()
@click.argument("folder", metavar="[DIR]", type=click.Path(), required=False)
@click.option("--kind", type=click.Choice(["cra", "rules"]), required=True, help="Acts, or interaction rules.")
@_ROBOT
def schema(folder: str | None, kind: str, robot: str | None) -> None:
    """Print the RELAX NG schema of act or rule files, for an editor that completes and checks them.

    With DIR, it knows the actions of that scenario and its robot too.
    """
    from rise_engine.reports import schema_text
    from rise_engine.terminal import write_xml

    if folder is not None:
        folder = require_folder(folder)
    text = schema_text(folder, kind, robot)
    if text is None:
        sys.exit(1)
    write_xml(text.rstrip("\n"))


@main.command()
@click.argument("folder", metavar="[DIR]", type=click.Path(), required=False)
@click.option("--json", "as_json", is_flag=True, help="One JSON document instead of lines.")
def robots(folder: str | None, as_json: bool) -> None:
    """List the robots that a scenario can name, where each comes from and what it can do."""
    from rise_engine.reports import robots_report

    if folder is not None:
        folder = require_folder(folder)
    sys.exit(robots_report(folder, as_json=as_json))


@main.command()
@click.argument("folder", metavar="[DIR]", type=click.Path(), required=False)
@_ROBOT
@_ROS
@click.option("--seconds", metavar="N", default="3", help="How long to look for the robot at most. Default: 3.")
@click.option("--json", "as_json", is_flag=True, help="One JSON document instead of lines.")
def doctor(folder: str | None, robot: str | None, ros: Transport, seconds: str, as_json: bool) -> None:
    """Say how ROS 2 stands on this machine, and whether the robot answers: of the scenario in DIR, or --robot.

    Nothing is sent to the robot. Exit status: 0; 1 when something is in the way; 2 when there is no such robot.
    """
    from rise_engine.bridge import Wire
    from rise_engine.reports import doctor_report

    if folder is not None:
        folder = require_folder(folder)
    patience = number("--seconds", seconds, "a number of seconds above 0, up to 600", 600, least_excluded=True)
    wire = Wire(ros, click.get_current_context().obj)
    sys.exit(doctor_report(folder, robot=robot, wire=wire, seconds=patience, as_json=as_json))
