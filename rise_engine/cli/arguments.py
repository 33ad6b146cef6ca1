"""Parses a session's command line: its options, its first tasks, and its task file."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from select import select
from typing import Any

import click
from msgspec.structs import replace

from rise_engine.base.exit_status import USAGE
from rise_engine.base.json_codec import JsonError, decode
from rise_engine.cli.options import resolve_scenario
from rise_engine.cli.scenario.loading import load_scenario
from rise_engine.cli.terminal import Refused, exit_with_usage, print_notes, reason_of, refusing
from rise_engine.expression import Assignment, ExpressionError
from rise_engine.kernel.inputs import Submit
from rise_engine.ports.bridge import ParameterReader, RosConnection, RosTransport
from rise_engine.run.engine.drivers import PARAMETERS, load_ros_plugin
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.task_file import TaskFile, read_task_file, unknown_name_sentence
from rise_engine.scenario.model import Mode, Scenario


@refusing(USAGE)
def add_ros_parameters(
    own: list[str], ros_args: tuple[str, ...], command: click.Command
) -> tuple[list[str], tuple[str, ...]]:
    """Add options from ROS parameters (`-p robot:=pepper`, or in a file), as in ROS launch files.

    Ends the command if a parameter is invalid.
    """
    if not {"-p", "--param", "--params-file"} & set(ros_args):
        return own, ros_args
    options = [each for each in command.params if isinstance(each, click.Option)]
    read_parameters: ParameterReader = load_ros_plugin(PARAMETERS)
    more, ros_args = read_parameters(
        ros_args,
        switches={each.opts[0]: "".join(each.secondary_opts[:1]) for each in options if each.is_flag},
        single=[each.opts[0] for each in options if not each.is_flag and not each.multiple],
        many=[each.opts[0] for each in options if each.multiple],
        written=own,
    )
    return [own[0], *more, *own[1:]], ros_args


# --- options ----------------------------------------------------------------------------------------------------------


def named_scenario(folder: str | None, *of_study: object) -> str:
    """Return the scenario of a session outside of a study. Ends the command if none is named.

    :param folder: as the user named it.
    :param of_study: options that are only allowed in a study.
    """
    if folder is None:
        exit_with_usage("name what to run: DIR, a scenario's folder, or --study STUDY --participant ID")
    if any(of_study):
        exit_with_usage("--run, --pilot, --training, --record, --confirm and --skip-check go with --study")
    return resolve_scenario(folder)


def session_options(folder: str, speed: float, *, ros: RosTransport, **session: Any) -> SessionOptions:
    """Make the options of a session.

    :param folder: the scenario's folder; empty: the study sets it.
    :param speed: session seconds per second.
    :param ros: the ROS 2 connection.
    :param session: `options.SESSION_OPTIONS` and `--seed`, with the names of the fields.
    """
    if session["allow_untranslated"] and not session["language"]:
        exit_with_usage("--allow-untranslated goes with --language")
    connection = RosConnection(ros, click.get_current_context().obj)
    return SessionOptions(folder, speed=speed, ros=connection, **session)


def load_for_session(options: SessionOptions) -> Scenario:
    """Load the scenario of a session. Ends the command if it has errors."""
    return load_scenario(
        options.folder,
        robot=options.robot,
        mode=options.mode,
        language=options.language,
        allow_untranslated=options.allow_untranslated,
    )


def parse_paths(options: tuple[str, ...]) -> dict[str, str]:
    """Parse the places of acts, rules and memory, each written as `memory=PATH`."""
    paths = dict(each.partition("=")[::2] for each in options)
    for kind, path in paths.items():
        if kind not in ("acts", "rules", "memory") or not path.strip():
            exit_with_usage(
                f"--place {kind}: this must be acts=PATH, rules=PATH or memory=PATH, in the scenario's folder"
            )
    return paths


# --- the beginning of a session ---------------------------------------------------------------------------------------


def tasks_at_start(
    scenario: Scenario, settings: tuple[str, ...], rules: tuple[str, ...], acts: tuple[str, ...]
) -> tuple[Submit, ...]:
    """Make the tasks of `--set`, `--rule` and `--act` at the beginning, in this order.

    Ends the command with all errors.
    """
    problems = [
        f"--{what}: {unknown_name_sentence(what, name, known)}"
        for what, names, known in (("rule", rules, list(scenario.rules)), ("act", acts, list(scenario.acts)))
        for name in names
        if name not in known
    ]
    assignments = parse_assignments(settings, problems)
    source = "wizard:command-line"
    return (
        *assignments,
        *(Submit(function="startInteractionRule", behavior=name, source=source) for name in rules),
        *(Submit(function="startCommunicationRobotAct", behavior=name, source=source) for name in acts),
    )


def parse_assignments(settings: Sequence[str], problems: Sequence[str] = ()) -> list[Submit]:
    """Parse every `--set` as an assignment. Ends the command with all errors, after the other `problems`."""
    assigned, found = [], [*problems]
    for setting in settings:
        try:
            behavior = _parse_assignment(setting)
        except ValueError as error:
            found.append(f"--set {setting}: {error}")
        else:
            assigned.append(Submit(function="assignValue", behavior=behavior, source="wizard:command-line"))
    if found:
        raise Refused(*found, status=USAGE)
    return assigned


def _parse_assignment(text: str) -> str:
    """Parse `KEY=JSON` as an assignment. Raises ValueError with a sentence."""
    key, equals, value = text.partition("=")
    key = key.strip()
    if not equals or not key:
        raise ValueError("write KEY=JSON, as in task=2 or 'name=\"Anna\"'")
    try:
        parsed: Any = decode(value)
    except JsonError as error:
        bare = value.strip()
        if not bare or not (bare[0].isalpha() or bare[0] in "_/"):
            why = f"{error} (column {error.offset + 1})"
            raise ValueError(f"the value is not JSON: {why}; put a text in double quotes: '{key}=\"...\"'") from None
        print_notes(f"note: --set {key}: {bare} was taken as a text")
        parsed = bare
    behavior = json.dumps({key: parsed}, ensure_ascii=False)
    try:
        Assignment.parse(behavior)
    except ExpressionError as error:
        raise ValueError(str(error)) from None
    return behavior


# --- tasks ------------------------------------------------------------------------------------------------------------


@refusing(USAGE)
def read_tasks_option(path: str | None, *, virtual: bool) -> tuple[TaskFile, bool]:
    """Read the tasks known before the start, and whether more will come on standard input."""
    if path is None:
        return TaskFile(), False
    if path == "-" and not virtual:
        return TaskFile(), True
    if path == "-" and sys.stdin is None:  # closed by the parent process: like an empty one
        return TaskFile(), False
    try:
        text = b"".join(_standard_input()) if path == "-" else Path(path).read_bytes()
    except OSError as error:
        exit_with_usage(f"--tasks {path}: {reason_of(error)}")
    return read_task_file(text, path), False


def apply_task_file(
    options: SessionOptions, file: TaskFile, path: str | None, mode: Mode, *, of_study: bool
) -> SessionOptions:
    """Add a task file's faults, seed and condition to a session's options; the command line's own take precedence.

    Ends the command if the file cannot be played in this mode, or with this study.

    :param options: from the command line.
    :param file: the parsed file.
    :param path: its path, for messages.
    :param mode: the session's mode.
    :param of_study: whether it is a session of a study, whose plan sets seed and condition.
    """
    if file.faults and mode == "real":
        exit_with_usage(f"--tasks {path}: it has faults, which only a simulated robot can have: add --mode debug")
    if of_study and (file.seed is not None or file.condition):
        what = "seed" if file.seed is not None else "condition"
        exit_with_usage(f"--tasks {path}: it has a {what}, but with --study the plan sets it")
    return replace(
        options,
        faults=(*options.faults, *file.faults),
        seed=file.seed if options.seed is None else options.seed,
        condition=options.condition or file.condition,
    )


def rehearsal_options(options: SessionOptions, path: str, mode: Mode) -> SessionOptions:
    """Make the options of a session for consoles that plays a task file. Ends the command if it cannot."""
    if mode == "real":
        exit_with_usage("--tasks plays a rehearsal by itself: add --mode debug")
    if path == "-":
        exit_with_usage("--tasks -: a session for consoles reads its tasks from a file")
    file, _ = read_tasks_option(path, virtual=True)
    return replace(apply_task_file(options, file, path, mode, of_study=False), script=file.tasks)


def _standard_input() -> Iterator[bytes]:
    """Yield all of standard input. (`sys.stdin.buffer.read()` would notice some interrupts only at its end.)"""
    descriptor = sys.stdin.fileno()
    while True:
        if select([descriptor], [], [], 0.5)[0]:
            chunk = os.read(descriptor, 65_536)
            if not chunk:
                return
            yield chunk
