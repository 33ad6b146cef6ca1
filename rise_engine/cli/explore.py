"""`rise-engine explore`: all situations of a study, before anybody comes."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from textwrap import fill
from types import FrameType
from typing import Any

import click
from msgspec.structs import replace

from rise_engine.cli.arguments import exit_with_usage, resolve_scenario
from rise_engine.cli.check import load_or_refuse
from rise_engine.cli.options import FOLDER_OR_NONE, ROBOT
from rise_engine.cli.terminal import write_json
from rise_engine.exit_status import NOT_WRITTEN, REFUSED
from rise_engine.explore.bounds import Bounds
from rise_engine.explore.exploration import Exploration, bounds_of, explore
from rise_engine.explore.path_file import task_file_of
from rise_engine.explore.playing import find_times
from rise_engine.explore.questions_of_use import NOT_RUNNING
from rise_engine.explore.space import Space
from rise_engine.explore.telling import tell_path
from rise_engine.scenario.model import Scenario
from rise_engine.session.disk import error_message
from rise_engine.text import pluralize

_WIDTH = 100
_MARKS = {"problem": "PROBLEM", "warning": "warning", "remark": "remark"}
_SECONDS_BETWEEN = 0.5
"""Between two lines of progress."""


@click.command("explore")
@FOLDER_OR_NONE
@ROBOT
@click.option("--all-keys", is_flag=True, help="Press also the keys that start acts by hand.")
@click.option("--faults", metavar="N", type=click.IntRange(0, 5), help="So many things go wrong on one way.")
@click.option("--line", metavar="N", type=click.IntRange(0, 5), help="So many acts wait at most.")
@click.option("--beside", metavar="N", type=click.IntRange(0, 5), help="So many acts run beside others at most.")
@click.option("--pace", metavar="LEAST-MOST|any", help="Acts take so many times what is expected: 0.5-3.")
@click.option("--no-stop", is_flag=True, help="Nobody stops everything.")
@click.option("--no-lost", is_flag=True, help="The robot is never lost.")
@click.option("--cores", metavar="N", type=click.IntRange(1, 64), help="So many processes. Default: all cores.")
@click.option("--show", metavar="N|all", help="Show the way to finding N, step by step.")
@click.option("--write", metavar="DIR", type=click.Path(file_okay=False), help="Write each way as a task file.")
@click.option("--keys", "show_keys", is_flag=True, help="Show which key does something in which state.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON document.")
def explore_command(folder: str | None, robot: str | None, **options: Any) -> None:
    """Look at everything that can happen in the study in DIR, and say what can go wrong.

    All keys are pressed in every situation, acts end, fail, or are cut off, time passes, the robot is lost and
    everything is stopped, within the bounds that the output names. ctrl+c ends it with what was found so far.

    Exit status: 0 no problem was found; 1 there are problems, or the scenario has errors; 2 wrong usage; 74 the ways
    cannot be written.
    """
    scenario = load_or_refuse(resolve_scenario(folder or "."), robot=robot, mode=None)
    if scenario is None:
        sys.exit(REFUSED)
    bounds = _bounds(scenario, options)
    cores = options["cores"] or os.cpu_count() or 1
    with _interruptible() as interrupted:
        exploration = explore(scenario, bounds, cores=cores, go_on=_Progress(interrupted))
    if options["as_json"]:
        write_json(exploration.row(scenario))
    else:
        for line in _report(scenario, exploration, options["show"], show_keys=options["show_keys"]):
            click.echo(line)
    if options["write"] is not None:
        _write_ways(scenario, exploration, Path(options["write"]), folder or ".")
    sys.exit(REFUSED if exploration.count("problem") else 0)


def _bounds(scenario: Scenario, options: dict[str, Any]) -> Bounds:
    """What the scenario says, and over it what the command line says."""
    given: dict[str, Any] = {name: options[name] for name in ("faults", "line", "beside") if options[name] is not None}
    if options["all_keys"]:
        given["keys"] = "all"
    if options["no_stop"]:
        given["stop"] = False
    if options["no_lost"]:
        given["lost"] = False
    if options["pace"] is not None:
        given["pace"] = _read_pace(options["pace"])
    return replace(bounds_of(scenario), **given)


def _read_pace(text: str) -> tuple[float, float] | None:
    """`0.5-3`, or `any`."""
    if text == "any":
        return None
    least, _, most = text.partition("-")
    try:
        pace = (float(least), float(most))
    except ValueError:
        pace = (0.0, 0.0)
    if not 0 < pace[0] <= pace[1]:
        exit_with_usage(f"--pace is two numbers such as 0.5-3, or `any`, not {text!r}")
    return pace


# --- while it looks -------------------------------------------------------------------------------------------------


@contextmanager
def _interruptible() -> Iterator[list[bool]]:
    """Within this, ctrl+c only says that it is enough; twice ends the program."""
    interrupted: list[bool] = []

    def interrupt(number: int, frame: FrameType | None) -> None:
        if interrupted:
            raise KeyboardInterrupt
        interrupted.append(True)

    before = signal.signal(signal.SIGINT, interrupt)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)


class _Progress:
    """Tells somebody who watches how far it has come, and stops when they have had enough."""

    def __init__(self, interrupted: list[bool]) -> None:
        self._interrupted = interrupted
        self._shown = sys.stderr.isatty()
        self._next = time.monotonic() + _SECONDS_BETWEEN

    def __call__(self, space: Space) -> bool:
        if self._interrupted:
            if self._shown:
                print("broken off: what was found so far comes now (ctrl+c again: without it)", file=sys.stderr)
            return False
        now = time.monotonic()
        if self._shown and now >= self._next:
            self._next = now + _SECONDS_BETWEEN
            count, left = len(space.situations), len(space.pending)
            print(
                f"{count:,} situations, {left:,} still to look at (ctrl+c: tell what was found so far)", file=sys.stderr
            )
        return True


# --- what it found --------------------------------------------------------------------------------------------------


def _report(scenario: Scenario, exploration: Exploration, show: str | None, *, show_keys: bool) -> Iterator[str]:
    yield f"{scenario.title}"
    for sentence in exploration.looked_at:
        yield fill(sentence, _WIDTH)
    yield ""
    for sentence in exploration.told:
        yield fill(sentence, _WIDTH)
    for number, finding in enumerate(exploration.findings, 1):
        if number == 1 or finding.level != exploration.findings[number - 2].level:
            yield ""
        yield from _finding_lines(scenario, exploration, number, shown=show in ("all", str(number)))
    if show_keys:
        yield ""
        yield from _key_lines(scenario, exploration)
    yield ""
    counts = (pluralize(exploration.count(level), level) for level in _MARKS)
    with_way = any(finding.path is not None for finding in exploration.findings)
    yield f"{', '.join(counts)}{'; `--show N` shows the way to one of them' if with_way and show is None else ''}"


def _finding_lines(scenario: Scenario, exploration: Exploration, number: int, *, shown: bool) -> Iterator[str]:
    finding = exploration.findings[number - 1]
    head = f"{number:>3} {_MARKS[finding.level]}: "
    place = f" [{finding.location}]" if finding.location is not None else ""
    yield fill(f"{head}{finding.text}{place}", _WIDTH, subsequent_indent="    ", break_on_hyphens=False)
    if shown and finding.path is not None:
        for at, sentence in enumerate(tell_path(scenario, finding.path, exploration.bounds), 1):
            yield fill(sentence, _WIDTH, initial_indent=f"      {at:>2}. ", subsequent_indent="          ")
        played = find_times(scenario, finding.path, exploration.bounds)
        if not played.is_certain:
            yield fill(
                f"Perhaps it does not come like this: {played.problem}.",
                _WIDTH,
                initial_indent="      ",
                subsequent_indent="      ",
            )
    elif shown:
        yield "      there is no single way to it"


def _key_lines(scenario: Scenario, exploration: Exploration) -> Iterator[str]:
    """Which key does something in which state: `x` always, `-` sometimes, nothing: never."""
    signs = {"always": "x", "sometimes": "-", "never": " "}
    keys = next(iter(exploration.keys.values()), {})
    labels = [scenario.keys[key].label for key in keys]
    widest = max((len(state) for state in exploration.keys), default=0)
    yield f"{'':<{widest}}  {' '.join(labels)}   (x: it does something there, -: sometimes)"
    order = sorted(exploration.keys, key=lambda state: state == NOT_RUNNING)
    for state in order:
        row = exploration.keys[state]
        cells = (signs[row[key]].ljust(len(label)) for key, label in zip(keys, labels, strict=True))
        yield f"{state:<{widest}}  {' '.join(cells)}".rstrip()


def _write_ways(scenario: Scenario, exploration: Exploration, folder: Path, study: str) -> None:
    """Each finding's way as a task file in a new or empty folder. Ends the program if they cannot be written."""
    if folder.exists() and any(folder.iterdir()):
        exit_with_usage(f"{folder} is not empty; name a new folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for number, finding in enumerate(exploration.findings, 1):
            if finding.path is not None:
                told = tell_path(scenario, finding.path, exploration.bounds)
                played = find_times(scenario, finding.path, exploration.bounds)
                text = task_file_of(finding.text, told, played, study)
                (folder / f"{number:02}-{finding.kind}.jsonl").write_text(text, encoding="utf-8")
    except OSError as error:
        click.echo(f"{folder} cannot be written: {error_message(error)}", err=True)
        sys.exit(NOT_WRITTEN)


COMMANDS = {"explore": explore_command}
