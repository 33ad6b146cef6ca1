"""What the arguments of the command line mean: what can be used, and a sentence for what cannot."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from select import select
from typing import Any, NoReturn

import click
from msgspec.structs import replace

from rise_engine.cli.check import strict_json
from rise_engine.engine.drivers import PARAMETERS, DriverError, load_ros_plugin
from rise_engine.errors import RiseError
from rise_engine.exit_status import USAGE
from rise_engine.expression import Assignment, ExpressionError
from rise_engine.kernel.inputs import Submit
from rise_engine.ports.bridge import BridgeError, ParameterReader
from rise_engine.protocol.session_options import SessionOptions
from rise_engine.protocol.task_file import TaskFile, TaskFileError, read_task_file, unknown_name_sentence
from rise_engine.scenario.model import Mode, Scenario
from rise_engine.scenario.shipped_studies import resolve_study, shipped_hint
from rise_engine.text import clean


def add_ros_parameters(
    own: list[str], ros_args: tuple[str, ...], command: click.Command
) -> tuple[list[str], tuple[str, ...]]:
    """Options of a command that are given as parameters of ROS (`-p robot:=pepper`, or in a file), where they stand on
    the command line; ROS programs are started in that way. Exits when a parameter is none."""
    if not {"-p", "--param", "--params-file"} & set(ros_args):
        return own, ros_args
    options = [each for each in command.params if isinstance(each, click.Option)]
    try:
        read_parameters: ParameterReader = load_ros_plugin(PARAMETERS)
        more, ros_args = read_parameters(
            ros_args,
            switches={each.opts[0]: "".join(each.secondary_opts[:1]) for each in options if each.is_flag},
            single=[each.opts[0] for each in options if not each.is_flag and not each.multiple],
            many=[each.opts[0] for each in options if each.multiple],
            written=own,
        )
    except BridgeError as error:
        exit_with_usage("\n".join(error.lines))
    except DriverError as error:
        exit_with_usage(str(error))
    return [own[0], *more, *own[1:]], ros_args


def parse_paths(options: tuple[str, ...]) -> dict[str, str]:
    """Where acts, rules and memory are read instead of where the scenario says: each written as `memory=PATH`."""
    paths = dict(each.partition("=")[::2] for each in options)
    for kind, path in paths.items():
        if kind not in ("acts", "rules", "memory") or not path.strip():
            exit_with_usage(
                f"--place {kind}: this must be acts=PATH, rules=PATH or memory=PATH, in the scenario's folder"
            )
    return paths


class UnusableArgument(RiseError):
    """Something on the command line cannot be used; the text says what, in one or more lines."""


def tasks_at_start(
    scenario: Scenario, settings: tuple[str, ...], rules: tuple[str, ...], acts: tuple[str, ...]
) -> tuple[Submit, ...]:
    """What `--set`, `--rule` and `--act` submit at the beginning, in this order.

    :raises UnusableArgument: with everything that cannot be used.
    """
    problems = [
        f"error: --{what}: {unknown_name_sentence(what, name, known)}"
        for what, names, known in (("rule", rules, list(scenario.rules)), ("act", acts, list(scenario.acts)))
        for name in names
        if name not in known
    ]
    assigned: list[str] = []
    try:
        assigned = parse_assignments(settings)
    except UnusableArgument as error:
        problems.append(str(error))
    if problems:
        raise UnusableArgument("\n".join(problems))
    source = "wizard:command-line"
    return (
        *(Submit(function="assignValue", behavior=behavior, source=source) for behavior in assigned),
        *(Submit(function="startInteractionRule", behavior=name, source=source) for name in rules),
        *(Submit(function="startCommunicationRobotAct", behavior=name, source=source) for name in acts),
    )


def parse_assignments(settings: Sequence[str]) -> list[str]:
    """Every `--set` as an assignment. Raises UnusableArgument with all that cannot be used."""
    assigned, problems = [], []
    for setting in settings:
        try:
            assigned.append(_parse_assignment(setting))
        except ValueError as error:
            problems.append(f"error: --set {setting}: {error}")
    if problems:
        raise UnusableArgument("\n".join(problems))
    return assigned


def _parse_assignment(text: str) -> str:
    """`KEY=JSON` as an assignment. Raises ValueError with a sentence."""
    key, equals, value = text.partition("=")
    key = key.strip()
    if not equals or not key:
        raise ValueError("write KEY=JSON, as in task=2 or 'name=\"Anna\"'")
    try:
        parsed: Any = strict_json(value)
    except ValueError as error:
        bare = value.strip()
        if not bare or not (bare[0].isalpha() or bare[0] in "_/"):
            raise ValueError(
                f"the value is not JSON: {error}; a text stands in double quotes: '{key}=\"...\"'"
            ) from None
        click.echo(f"note: --set {key}: {bare} was taken as a text", err=True)
        parsed = bare
    behavior = json.dumps({key: parsed}, ensure_ascii=False)
    try:
        Assignment.parse(behavior)
    except ExpressionError as error:
        raise ValueError(str(error)) from None
    return behavior


def read_tasks_option(path: str | None, *, virtual: bool) -> tuple[TaskFile, bool]:
    """What is known before the session starts, and whether more tasks will come on standard input."""
    if path is None:
        return TaskFile(), False
    if path == "-" and not virtual:
        return TaskFile(), True
    if path == "-" and sys.stdin is None:  # closed by whoever started this: as good as empty
        return TaskFile(), False
    try:
        text = _read_standard_input() if path == "-" else Path(path).read_bytes()
    except OSError as error:
        raise UnusableArgument(f"error: --tasks {path}: {error.strerror or error}") from None
    try:
        return read_task_file(text, path), False
    except TaskFileError as error:
        raise UnusableArgument(str(error)) from None


def apply_task_file(
    options: SessionOptions, file: TaskFile, path: str | None, mode: Mode, *, of_study: bool
) -> SessionOptions:
    """The options of a session that plays a task file: with its faults, seed and condition. What the command line says
    of seed and condition counts more.

    :param options: as the command line has them.
    :param file: what was read.
    :param path: of the file, for messages.
    :param mode: the session's.
    :param of_study: whether it is a session of a study, whose plan says seed and condition.
    :raises UnusableArgument: it cannot be played in this mode, or with this study.
    """
    if file.faults and mode == "real":
        raise UnusableArgument(
            f"error: --tasks {path}: it has faults, and only a simulated robot does wrong on request: add --mode debug"
        )
    if of_study and (file.seed is not None or file.condition):
        what = "seed" if file.seed is not None else "condition"
        raise UnusableArgument(f"error: --tasks {path}: it has a {what}, and with --study the plan says it")
    return replace(
        options,
        faults=(*options.faults, *file.faults),
        seed=file.seed if options.seed is None else options.seed,
        condition=options.condition or file.condition,
    )


def rehearsal_options(options: SessionOptions, path: str, mode: Mode) -> SessionOptions:
    """The options of a session for consoles that plays a task file by itself. Raises UnusableArgument."""
    if mode == "real":
        raise UnusableArgument("error: --tasks plays a rehearsal by itself: add --mode debug")
    if path == "-":
        raise UnusableArgument("error: --tasks -: a session for consoles reads its tasks from a file")
    file, _ = read_tasks_option(path, virtual=True)
    return replace(apply_task_file(options, file, path, mode, of_study=False), script=file.tasks)


def _read_standard_input() -> bytes:
    """All of it. `sys.stdin.buffer.read()` notices an interrupt that comes between two of its reads only at the end."""
    descriptor = sys.stdin.fileno()
    chunks: list[bytes] = []
    while True:
        if not select([descriptor], [], [], 0.5)[0]:
            continue
        chunk = os.read(descriptor, 65_536)
        if not chunk:
            return b"".join(chunks)
        chunks.append(chunk)


def parse_number(option: str, text: str, wanted: str, most: float, *, least_excluded: bool = False) -> float:
    """The number, from 0 to `most`, that was given for an option; ends the program, with what is `wanted`, if none."""
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not 0 <= value <= most or (least_excluded and value == 0):
        exit_with_usage(f"{option} {text}: this must be {wanted}")
    return value


def resolve_scenario(folder: str) -> str:
    """The path of a scenario: a folder, its scenario.toml, or a shipped study by its name. Ends the program if none."""
    folder = resolve_study(folder)
    path = Path(folder)
    if (path / "study.toml").is_file() and not (path / "scenario.toml").exists():
        exit_with_usage(f"{folder} is a study, not a scenario: its commands are those of `rise-engine study`")
    if path.is_dir() or (path.is_file() and path.name == "scenario.toml"):
        return folder
    problem = f"there is no folder {folder}{shipped_hint()}"
    if path.exists():
        problem = f"{folder} is no scenario: give a folder, or the path of its scenario.toml"
    return exit_with_usage(problem)


def exit_with_usage(message: str) -> NoReturn:
    """End the program with a sentence about its command line."""
    click.echo(f"error: {clean(message)}", err=True)
    sys.exit(USAGE)
