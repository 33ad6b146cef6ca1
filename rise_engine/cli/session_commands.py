"""The commands about sessions: run, serve, sessions, stop, replay."""

from __future__ import annotations

import sys
from typing import Any

import click
from msgspec.structs import replace

from rise_engine import exit_status
from rise_engine.cli.arguments import (
    UnusableArgument,
    apply_task_file,
    exit_with_usage,
    parse_number,
    parse_paths,
    read_tasks_option,
    rehearsal_options,
    resolve_scenario,
    tasks_at_start,
)
from rise_engine.cli.check import load_or_refuse
from rise_engine.cli.options import FOLDER_OR_NONE, JSON, SESSION, begin_options, session_options, study_options
from rise_engine.cli.replay import play_report, replay_report
from rise_engine.cli.run import RunOptions
from rise_engine.cli.run import run as run_session
from rise_engine.cli.sessions import print_recorded, print_sessions, stop_session
from rise_engine.cli.startup_messages import print_startup
from rise_engine.cli.study_checks import CheckOptions, check_options
from rise_engine.cli.study_session import rehearsed_session, study_session
from rise_engine.engine.drivers import DriverError, RobotOptionsError
from rise_engine.ports.bridge import BridgeError, RosConnection, RosTransport
from rise_engine.protocol.session_options import SessionOptions
from rise_engine.protocol.session_start import set_conflicts, start_problems
from rise_engine.scenario.model import Scenario
from rise_engine.server.process import serve as serve_session

LATEST = 30 * 86_400.0
"""Seconds: the latest --until."""
FASTEST = 1e6
"""The highest --speed; beyond it there is `max`."""


@click.command()
@FOLDER_OR_NONE
@study_options
@begin_options
@click.option("--tasks", metavar="FILE|-", help="Tasks, one JSON object per line; - is standard input.")
@click.option("--speed", metavar="N|max", default="1", help="How many times faster; max: virtual time.")
@click.option(
    "--until",
    metavar="idle|SECONDS",
    default="idle",
    help="When to end; idle: when nothing happens by itself any more.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), help="For everything picked at random. Default: 0; with --study, the plan's."
)
@session_options
@click.option("--json", "as_json", is_flag=True, help="Print the records, one JSON object per line.")
@click.option("--strict", is_flag=True, help="Exit with 3 when a task was rejected or aborted.")
def run(
    folder: str | None,
    study: str | None,
    run_number: int | None,
    settings: tuple[str, ...],
    rules: tuple[str, ...],
    acts: tuple[str, ...],
    tasks: str | None,
    speed: str,
    until: str,
    as_json: bool,
    strict: bool,
    **session: Any,
) -> None:
    """Run the scenario in DIR without a screen.

    First every --set, then every --rule, every --act, and the tasks by their time.

    With --study, the session that the participant would have now, in debug mode: it takes no slot and keeps nothing.

    \b
    What --fault understands (simulated robot only; @N: only the N-th of that action):
      Speech=reject  Speech=fail  Speech=fail@2  LookAt=slow:3  Speech=hang
      vanish@12.5    vanish@12.5-20

    Exit status: 0; 1 scenario refused; 2 wrong usage; 3 with --strict, a task was rejected or aborted; 4 it would never
    have ended; 130 interrupted.
    """
    virtual = speed == "max"
    pace = 1.0
    if not virtual:
        pace = parse_number("--speed", speed, "a number above 0, up to 1000000, or max", FASTEST, least_excluded=True)
    elif session["ros"] in ("rclpy", "dds"):
        exit_with_usage(f"--ros {session['ros']} needs real time, and --speed max is virtual time")
    end = None
    if until != "idle":
        end = parse_number("--until", until, "a number of seconds, 0 or more, up to 2592000 (30 days), or idle", LATEST)
    if study is not None:
        options, started = rehearsed_session(_make_options("", pace, **session), study, folder, run_number or 0)
    else:
        options, started = _make_options(_needed_scenario(folder, run_number), pace, **session), None
    try:
        scenario = _load_or_exit(options)
        file, stream = read_tasks_option(tasks, virtual=virtual)
        options = apply_task_file(options, file, tasks, scenario.mode, of_study=started is not None)
        options = replace(options, first_tasks=tasks_at_start(scenario, settings, rules, acts))
        problems = (
            start_problems(scenario, options)
            if started is None
            else set_conflicts(scenario, started, options.first_tasks)
        )
        if problems:
            raise UnusableArgument("\n".join(f"error: {problem}" for problem in problems))
        run_options = RunOptions(
            scenario, options, file.tasks, stream, virtual, until=end, json=as_json, strict=strict, started=started
        )
        sys.exit(run_session(run_options))
    except BridgeError as error:
        for line in error.lines:
            click.echo(f"error: {line}", err=True)
        sys.exit(exit_status.REFUSED)
    except DriverError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(exit_status.REFUSED)
    except RobotOptionsError as error:
        click.echo(f"error: {error}", err=True)
        sys.exit(exit_status.USAGE)
    except UnusableArgument as error:
        click.echo(str(error), err=True)
        sys.exit(exit_status.USAGE)


@click.command()
@FOLDER_OR_NONE
@study_options
@click.option("--pilot", is_flag=True, help="With --study: with a participant, and it does not count.")
@click.option("--training", is_flag=True, help="With --study: without a participant, to practise; it does not count.")
@click.option(
    "--record/--no-record",
    "record",
    default=None,
    help="With --study: whether its recorders run. Usually those of sessions that count and of pilots.",
)
@check_options
@click.option("--wizard", metavar="NAME", default="", help="Who begins it; stands in the session's folder.")
@click.option("--name", metavar="NAME", help="Of the session's socket; without it, made from DIR.")
@begin_options
@click.option("--recover", is_flag=True, help="Go on with the latest session of DIR that did not end, if there is one.")
@click.option("--session", "which", metavar="SESSION", help="Go on with this session.")
@click.option(
    "--here",
    is_flag=True,
    help="Go on also with one that another computer had last, where nobody can see whether it still has.",
)
@click.option("--new", is_flag=True, help="Begin a new session, also when an earlier one did not end.")
@click.option("--speed", metavar="N", default="1", help="How many times faster.")
@click.option("--seed", type=click.IntRange(min=0), help="For everything picked at random; without it, a new one.")
@session_options
@click.option("--tasks", metavar="FILE", help="In debug mode: what is done when, one JSON object per line.")
@click.option(
    "--place",
    "paths",
    metavar="KIND=PATH",
    multiple=True,
    help="Read acts, rules or memory from another PATH in the scenario's folder (memory=pilot.json). Repeatable.",
)
def serve(
    folder: str | None,
    study: str | None,
    run_number: int | None,
    pilot: bool,
    training: bool,
    record: bool | None,
    confirmed: tuple[str, ...],
    skipped: tuple[str, ...],
    name: str | None,
    settings: tuple[str, ...],
    rules: tuple[str, ...],
    acts: tuple[str, ...],
    recover: bool,
    which: str | None,
    here: bool,
    new: bool,
    speed: str,
    paths: tuple[str, ...],
    tasks: str | None,
    **session: Any,
) -> None:
    """Run a session of the scenario in DIR, for consoles to attach to (`rise-tui`). It needs no terminal.

    With --study STUDY --participant P07 it is the next session of that participant: the plan gives scenario, condition,
    memory and seed, and the study's log gets what becomes of it.

    It ends when a console ends it, with `rise-engine stop`, or by SIGTERM or SIGINT: first the robot stops.

    Exit status: 0; 1 scenario refused; 2 wrong usage; 3 a session of DIR is running already; 4 an earlier one did not
    end: say --recover or --new; 5 it cannot be recovered; 70 the engine failed; 74 not everything could be recorded.
    """
    pace = parse_number("--speed", speed, "a number above 0, up to 1000000", FASTEST, least_excluded=True)
    if (recover or which is not None) and new:
        exit_with_usage("say either --recover or --new")
    if study is None:
        folder = _needed_scenario(folder, run_number, pilot, training, confirmed, skipped, record is not None)
    if here and not recover and which is None and not (new and study is not None):
        exit_with_usage("--here goes with --recover or --session, and with --new of a study")
    options = replace(
        _make_options(folder or "", pace, **session),
        paths=parse_paths(paths),
        socket_name=name,
        unfinished=which or ("recover" if recover else "new" if new else "ask"),
        from_other_computer=here,
        record=record,
    )
    if study is not None:
        checks = CheckOptions(confirmed, skipped)
        options = study_session(options, study, folder, run_number or 0, pilot=pilot, training=training, checks=checks)
    if tasks is not None and (recover or which is not None or study is not None):
        exit_with_usage("--tasks goes with a new session of DIR")
    if settings or rules or acts or tasks is not None:
        scenario = _load_or_exit(options)
        try:
            if tasks is not None:
                options = rehearsal_options(options, tasks, scenario.mode)
            options = replace(options, first_tasks=tasks_at_start(scenario, settings, rules, acts))
        except UnusableArgument as error:
            click.echo(str(error), err=True)
            sys.exit(exit_status.USAGE)
    sys.exit(serve_session(options, lambda message: print_startup(message, "" if study else options.folder)))


def _needed_scenario(folder: str | None, *of_study: object) -> str:
    """The scenario of a session that is of no study. Ends the program if none is named."""
    if folder is None:
        exit_with_usage("say what to run: DIR, a scenario's folder, or --study STUDY --participant ID")
    if any(of_study):
        exit_with_usage("--run, --pilot, --training, --record, --confirm and --skip-check go with --study")
    return resolve_scenario(folder)


def _make_options(folder: str, speed: float, *, ros: RosTransport, **session: Any) -> SessionOptions:
    """`session`: the options of `session_options` and `--seed`, which have the names of the fields."""
    if session["allow_untranslated"] and not session["language"]:
        exit_with_usage("--allow-untranslated goes with --language")
    connection = RosConnection(ros, click.get_current_context().obj)
    return SessionOptions(folder, speed=speed, ros=connection, **session)


def _load_or_exit(options: SessionOptions) -> Scenario:
    """The scenario; ends the program when it has errors."""
    scenario = load_or_refuse(
        options.folder,
        robot=options.robot,
        mode=options.mode,
        language=options.language,
        allow_untranslated=options.allow_untranslated,
    )
    if scenario is None:
        sys.exit(exit_status.REFUSED)
    return scenario


@click.command()
@click.argument("where", metavar="[STUDY|DIR]", type=click.Path(), required=False)
@click.option("--all", "everything", is_flag=True, help="Also those that have ended.")
@JSON
def sessions(where: str | None, everything: bool, as_json: bool) -> None:
    """List the sessions that run on this machine, and those that did not end.

    With STUDY, a scenario's DIR or a folder with sessions: every session that was recorded there, also those that have
    ended, with participant, condition, outcome, length and mode. So with --all, for the folder where sessions lie.

    Exit status: 0; 1 when they cannot be listed; 2 when there is no such folder.
    """
    if where is not None or everything:
        sys.exit(print_recorded(where, as_json=as_json))
    sys.exit(print_sessions(as_json=as_json))


@click.command()
@click.argument("which", metavar="[NAME|DIR|SOCKET]", required=False)
def stop(which: str | None) -> None:
    """End a running session: the robot is stopped, the record is completed.

    Without an argument, the only one that runs. Exit status: 0 it has ended; 1 there is no such session, or several.
    """
    sys.exit(stop_session(which))


@click.command("replay")
@SESSION
@click.option("--scenario", metavar="DIR", type=click.Path(), help="Another scenario than the session's own copy.")
@JSON
@click.option("--speed", metavar="N", help="Play it in real time, N times as fast, into a console.")
def replay_session(session: str, scenario: str | None, as_json: bool, speed: str | None) -> None:
    """Feed the inputs of SESSION to a fresh engine, and compare what comes out with what was recorded.

    SESSION is a session's folder, or its name in the sessions folder ($RISE_SESSIONS, or ~/rise-sessions).

    With --speed it is not compared but played: into a console (rise-tui --replay), or as a readable account where
    standard output is no terminal.

    Exit status: 0 identical; 1 different; 2 when it cannot be read.
    """
    if speed is not None:
        if scenario is not None or as_json:
            exit_with_usage("--speed plays what was recorded: it goes with neither --scenario nor --json")
        pace = parse_number("--speed", speed, "a number above 0, up to 1000", 1000, least_excluded=True)
        sys.exit(play_report(session, pace))
    if scenario is not None:
        scenario = resolve_scenario(scenario)
    sys.exit(replay_report(session, scenario=scenario, as_json=as_json))


COMMANDS = {"replay": replay_session, "run": run, "serve": serve, "sessions": sessions, "stop": stop}
