"""`rise-engine run`: a session without a console."""

from __future__ import annotations

from typing import Any

import click
from msgspec.structs import replace

from rise_engine.base.exit_status import USAGE
from rise_engine.cli.arguments import (
    apply_task_file,
    load_for_session,
    named_scenario,
    read_tasks_option,
    session_options,
    tasks_at_start,
)
from rise_engine.cli.options import (
    BEGIN_OPTIONS,
    FAULTS,
    FOLDER_OR_NONE,
    SESSION_OPTIONS,
    STUDY_OPTIONS,
    number,
    options,
)
from rise_engine.cli.session.headless_session import RunOptions, run_session
from rise_engine.cli.study.session import rehearsed_session
from rise_engine.cli.terminal import Refused, exit_with_usage, refusing
from rise_engine.run.engine.drivers import RobotOptionsError
from rise_engine.run.protocol.session_start import set_conflicts, start_problems

_SPEED = number("--speed", "a number above 0, up to 1000000, or max", 1e6, above=0, word="max")
_UNTIL = number(
    "--until", "a number of seconds, 0 or more, up to 2592000 (30 days), or idle", 30 * 86_400.0, word="idle"
)


@click.command()
@FOLDER_OR_NONE
@options(*STUDY_OPTIONS, *BEGIN_OPTIONS)
@click.option("--tasks", metavar="FILE|-", help="Read tasks, one JSON object per line. -: from standard input.")
@click.option("--speed", metavar="N|max", type=_SPEED, default="1", help="Run N times as fast. max: in virtual time.")
@click.option(
    "--until",
    metavar="idle|SECONDS",
    type=_UNTIL,
    default="idle",
    help="End after SECONDS. idle: when nothing more happens by itself.",
)
@click.option(
    "--seed",
    type=click.IntRange(min=0),
    help="Set the seed of all random choices. Default: 0; with --study, the plan's.",
)
@options(*SESSION_OPTIONS, FAULTS)
@click.option("--json", "as_json", is_flag=True, help="Print the records, one JSON object per line.")
@click.option("--strict", is_flag=True, help="Exit with 3 if a task was rejected or aborted.")
@refusing(USAGE, of=RobotOptionsError)
def run(
    folder: str | None,
    study: str | None,
    run_number: int | None,
    settings: tuple[str, ...],
    rules: tuple[str, ...],
    acts: tuple[str, ...],
    tasks: str | None,
    speed: float | None,
    until: float | None,
    as_json: bool,
    strict: bool,
    **session: Any,
) -> int:
    """Run the scenario in DIR without a screen.

    It keeps no session folder: --json prints the records, and `rise-engine serve` keeps a session.

    Each --set comes first, then each --rule, each --act, and the tasks at their times.

    With --study, it runs the participant's next session in debug mode. This session takes no slot and is not kept.

    \b
    Values of --fault (simulated robot only; @N: only the N-th of that action):
      Speech=reject  Speech=fail  Speech=fail@2  LookAt=slow:3  Speech=hang
      vanish@12.5    vanish@12.5-20

    Exit status: 0; 1 scenario refused; 2 wrong usage; 3 with --strict, a task was rejected or aborted; 4 the session
    would never end; 6 it has ended, but the robot may still be doing something; 130 interrupted.
    """
    virtual = speed is None
    if virtual and session["ros"] in ("rclpy", "dds"):
        exit_with_usage(f"--ros {session['ros']} needs real time, and --speed max is virtual time")
    where = named_scenario(folder, run_number) if study is None else ""
    wanted, started = session_options(where, speed or 1.0, **session), None
    if study is not None:
        wanted, started = rehearsed_session(wanted, study, folder, run_number or 0)
    scenario = load_for_session(wanted)
    file, stream = read_tasks_option(tasks, virtual=virtual)
    wanted = apply_task_file(wanted, file, tasks, scenario.mode, of_study=started is not None)
    wanted = replace(wanted, first_tasks=tasks_at_start(scenario, settings, rules, acts))
    problems = (
        start_problems(scenario, wanted) if started is None else set_conflicts(scenario, started, wanted.first_tasks)
    )
    if problems:
        raise Refused(*problems, status=USAGE)
    return run_session(
        RunOptions(
            scenario, wanted, file.tasks, stream, virtual, until=until, json=as_json, strict=strict, started=started
        )
    )
