"""`rise-engine serve`: a session that consoles attach to."""

from __future__ import annotations

from typing import Any

import click
from msgspec.structs import replace

from rise_engine.base.exit_status import REFUSED, UNFINISHED
from rise_engine.cli.arguments import (
    load_for_session,
    named_scenario,
    parse_paths,
    rehearsal_options,
    session_options,
    tasks_at_start,
)
from rise_engine.cli.options import (
    BEGIN_OPTIONS,
    CHECK_OPTIONS,
    FAULTS,
    FOLDER_OR_NONE,
    HERE,
    NEW,
    PLACES,
    RECOVER,
    SEED,
    SESSION_OPTIONS,
    STUDY_OPTIONS,
    number,
    options,
)
from rise_engine.cli.study.checks import CheckOptions
from rise_engine.cli.study.session import study_session
from rise_engine.cli.terminal import exit_with_usage, print_notes
from rise_engine.run.server.process import serve as serve_session
from rise_engine.run.server.spawn import EngineRefused, EngineStarted, StartOutcome, StartupProgress


@click.command()
@FOLDER_OR_NONE
@options(*STUDY_OPTIONS)
@click.option("--pilot", is_flag=True, help="With --study: run a pilot session, which does not count.")
@click.option(
    "--training", is_flag=True, help="With --study: practise without a participant. The session does not count."
)
@click.option(
    "--record/--no-record",
    "record",
    default=None,
    help="With --study: run its recorders, or not. Default: in sessions that count and in pilots.",
)
@options(*CHECK_OPTIONS)
@click.option("--wizard", metavar="NAME", default="", help="Record the session with this wizard's name.")
@click.option("--name", metavar="NAME", help="Name the session's socket. Default: made from DIR.")
@options(*BEGIN_OPTIONS)
@RECOVER
@click.option("--session", "which", metavar="SESSION", help="Continue this session.")
@HERE
@NEW
@click.option(
    "--speed",
    metavar="N",
    type=number("--speed", "a number above 0, up to 1000000", 1e6, above=0),
    default="1",
    help="Run N times as fast.",
)
@SEED
@options(*SESSION_OPTIONS, FAULTS)
@click.option(
    "--tasks", metavar="FILE", help="In debug mode: carry out these tasks at their times, one JSON object per line."
)
@PLACES
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
    speed: float,
    paths: tuple[str, ...],
    tasks: str | None,
    **session: Any,
) -> int:
    """Run a session of the scenario in DIR, for consoles to attach to (`rise-tui`). It needs no terminal.

    With --study STUDY --participant P07, it is that participant's next session. The plan sets the scenario, condition,
    memory values and seed, and the study's log keeps the outcome.

    It ends when a console ends it, with `rise-engine stop`, or by SIGTERM or SIGINT. What runs is stopped first.

    Exit status: 0; 1 scenario refused; 2 wrong usage; 3 a session of DIR is running already; 4 an earlier one did not
    end: use --recover or --new; 5 it cannot be recovered; 6 the session has ended, but the robot may still be doing
    something; 70 the engine failed; 74 not everything could be recorded; 130 ended before it began.
    """
    if (recover or which is not None) and new:
        exit_with_usage("use either --recover or --new")
    if study is None:
        folder = named_scenario(folder, run_number, pilot, training, confirmed, skipped, record is not None)
    if here and not recover and which is None and not (new and study is not None):
        exit_with_usage("--here goes with --recover or --session, and with --new of a study")
    wanted = replace(
        session_options(folder or "", speed, **session),
        paths=parse_paths(paths),
        socket_name=name,
        unfinished=which or ("recover" if recover else "new" if new else "ask"),
        from_other_computer=here,
        record=record,
    )
    if study is not None:
        checks = CheckOptions(confirmed, skipped)
        wanted = study_session(wanted, study, folder, run_number or 0, pilot=pilot, training=training, checks=checks)
    if tasks is not None and (recover or which is not None or study is not None):
        exit_with_usage("--tasks goes with a new session of DIR")
    if settings or rules or acts or tasks is not None:
        scenario = load_for_session(wanted)
        if tasks is not None:
            wanted = rehearsal_options(wanted, tasks, scenario.mode)
        wanted = replace(wanted, first_tasks=tasks_at_start(scenario, settings, rules, acts))
    return serve_session(wanted, lambda message: print_notes(*_lines(message, "" if study else wanted.folder)))


def _lines(message: StartupProgress | StartOutcome, scenario_folder: str) -> list[str]:
    """Format the start's progress and outcome. `scenario_folder` is empty for a study."""
    match message:
        case StartupProgress(sentence=sentence):
            return [sentence]
        case EngineStarted(name=name, folder=folder):
            return [*message.lines, f"serving {name}; the record is in {folder}"]
        case EngineRefused():
            return _refusal_lines(message, scenario_folder)


def _refusal_lines(refused: EngineRefused, scenario_folder: str) -> list[str]:
    lines = [*refused.lines]
    for folder, sentence in refused.unfinished:
        lines += [f"  {sentence}", f"    {folder}"]
    if refused.others:
        lines.append("of other participants or conditions, and not recovered for this one:")
    for folder, sentence in refused.others:
        lines += [f"  {sentence}", f"    {folder}"]
    if refused.code == UNFINISHED and not refused.unfinished:
        lines.append("use --new to begin, or name theirs to continue one (--participant, --condition)")
    elif refused.code == UNFINISHED:
        lines.append("use --recover to continue the latest, or --new")
    elif refused.code == REFUSED:
        refused_folder = f"{scenario_folder} was refused: " if scenario_folder else ""
        lines.append(f"{refused_folder}nothing was started")
    return lines
