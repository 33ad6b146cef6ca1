"""`rise-engine explore`: explores all situations of a study, before the first participant comes."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from shlex import quote
from textwrap import fill
from types import FrameType
from typing import Any

import click
from msgspec.structs import replace

from rise_engine.author.explore.exploration import Exploration, bounds_of, explore
from rise_engine.author.explore.moves import Bounds
from rise_engine.author.explore.path_playback import find_times, task_file_of
from rise_engine.author.explore.path_words import describe_path
from rise_engine.author.explore.situation_graph import ExploreFinding
from rise_engine.author.explore.space import Space
from rise_engine.author.explore.usage_findings import NOT_RUNNING
from rise_engine.base.exit_status import INTERRUPTED, NOT_WRITTEN, OK, REFUSED
from rise_engine.base.files import error_message
from rise_engine.base.text import pluralize
from rise_engine.checks.kinds import KindFinding, MergedFinding, explore_kind, findings_of, load_for, merge
from rise_engine.cli.options import FOLDER_OR_NONE, JSON, ROBOT, is_study, resolve_scenario
from rise_engine.cli.scenario.loading import load_scenario
from rise_engine.cli.terminal import Refused, exit_with_usage, print_lines, print_notes, write_json
from rise_engine.scenario.model import Scenario
from rise_engine.study.participants import SessionKind, session_kinds
from rise_engine.study.review import review_study

_WIDTH = 100
_MARKS = {"problem": "PROBLEM", "warning": "warning", "remark": "remark"}
_SECONDS_BETWEEN = 0.5
"""Interval between two lines of progress."""


@click.command("explore")
@FOLDER_OR_NONE
@ROBOT
@click.option("--all-keys", is_flag=True, help="Also press the keys that start acts by hand.")
@click.option("--faults", metavar="N", type=click.IntRange(0, 5), help="Let at most N things go wrong on one path.")
@click.option("--line", metavar="N", type=click.IntRange(0, 5), help="Let at most N acts wait.")
@click.option("--beside", metavar="N", type=click.IntRange(0, 5), help="Let at most N acts run beside others.")
@click.option(
    "--pace", metavar="LEAST-MOST|any", help="Let acts take this many times their expected duration, as in 0.5-3."
)
@click.option("--no-stop", is_flag=True, help="Never stop everything.")
@click.option("--no-lost", is_flag=True, help="Never lose the robot.")
@click.option("--cores", metavar="N", type=click.IntRange(1, 64), help="Use N processes. Default: all cores.")
@click.option("--show", metavar="N|all", help="Show the path to finding N, step by step.")
@click.option(
    "--write", metavar="DIR", type=click.Path(file_okay=False), help="Write the path to each finding as a task file."
)
@click.option("--keys", "show_keys", is_flag=True, help="Show which keys do something in which state.")
@JSON
def explore_command(folder: str | None, robot: str | None, **options: Any) -> int:
    """Look at everything that can happen in the scenario or study in DIR, and report what can go wrong.

    It presses every key in every situation. Acts end, fail or are cut off, time passes, the robot is lost, and
    everything is stopped, within the bounds that the output names. ctrl+c ends it and reports the findings so far.

    For a study, a folder with study.toml, it explores every kind of session, each condition in each language, and plays
    it once without a robot. It lists each finding once, with the kinds of session that have it.

    Exit status: 0 no problems; 1 problems, or the scenario has errors; 2 wrong usage; 74 the task files cannot be
    written; 130 ctrl+c ended it, and it had found no problem.
    """
    if is_study(Path(folder or ".")):
        return _explore_study(folder or ".", robot, options)
    scenario = load_scenario(resolve_scenario(folder or "."), robot=robot)
    bounds = _bounds(scenario, options)
    cores = options["cores"] or os.cpu_count() or 1
    with _interruptible() as interrupted:
        exploration = explore(scenario, bounds, cores=cores, go_on=_Progress(interrupted))
    if options["as_json"]:
        write_json(exploration.row(scenario))
    else:
        _print(_report(scenario, exploration, options["show"], show_keys=options["show_keys"]))
    if options["write"] is not None:
        _write_paths(scenario, exploration, Path(options["write"]), folder or ".")
    return REFUSED if exploration.count("problem") else INTERRUPTED if interrupted else OK


def _explore_study(folder: str, robot: str | None, options: dict[str, Any]) -> int:
    """Explore and play every kind of session of a study, and print the findings; return the exit status."""
    for name, given in (("--robot", robot), ("--write", options["write"]), ("--keys", options["show_keys"])):
        if given:
            exit_with_usage(f"{name} goes with a scenario: rise-engine explore {quote(str(Path(folder) / 'scenario'))}")
    review = review_study(folder)
    study = review.study
    if study is None or review.errors:
        raise Refused("nothing is explored as long as the study has errors", findings=review.errors)
    cores = options["cores"] or os.cpu_count() or 1
    explored: list[tuple[SessionKind, Scenario, Exploration]] = []
    found: list[tuple[SessionKind, bool, Sequence[KindFinding]]] = []
    with _interruptible() as interrupted:
        for kind in session_kinds(study, review.participants, review.scenarios):
            scenario = load_for(study, kind.run.scenario, kind.language)
            if scenario is None or interrupted:
                continue
            bounds = _bounds(scenario, options)
            progress = _Progress(interrupted)
            exploration, played = explore_kind(study, kind, scenario, bounds, cores=cores, go_on=progress)
            explored.append((kind, scenario, exploration))
            found.append((kind, exploration.is_complete, findings_of(study, kind, exploration, played)))
    merged = merge(found)
    if options["as_json"]:
        kinds = [
            {"condition": kind.run.condition, "language": kind.language, **exploration.row(scenario)}
            for kind, scenario, exploration in explored
        ]
        write_json({"kinds": kinds, "findings": [each.row() for each in merged]})
    else:
        _print(_study_report(study.title, explored, merged, options["show"]))
    return REFUSED if any(each.finding.level == "problem" for each in merged) else INTERRUPTED if interrupted else OK


def _print(paragraphs: Iterator[str]) -> None:
    for paragraph in paragraphs:
        print_lines(*paragraph.split("\n"))


def _study_report(
    title: str,
    explored: Sequence[tuple[SessionKind, Scenario, Exploration]],
    merged: Sequence[MergedFinding],
    show: str | None,
) -> Iterator[str]:
    yield title
    alike: dict[tuple[str, ...], list[str]] = {}
    for kind, scenario, exploration in explored:
        alike.setdefault((*exploration.scope, *exploration.facts), []).append(kind.name or scenario.title)
    for sentences, names in alike.items():
        yield ""
        yield fill(", ".join(names), _WIDTH)
        for sentence in sentences:
            yield fill(sentence, _WIDTH, initial_indent="  ", subsequent_indent="  ")

    def path_to(number: int) -> Iterator[str]:
        kind_number, at = merged[number].first
        _, scenario, exploration = explored[kind_number]
        if at < len(exploration.findings):
            yield from _path_lines(scenario, exploration, exploration.findings[at])

    listed = [(each.finding.level, f"{each.finding.text} {each.where}".rstrip(), each.finding.place) for each in merged]
    yield from _finding_lines(listed, show, path_to)
    yield ""
    counts = {level: sum(each.finding.level == level for each in merged) for level in _MARKS}
    complete = all(exploration.is_complete for _, _, exploration in explored)
    yield _last_line(counts, complete=complete, can_show=bool(merged) and show is None)


def _last_line(counts: dict[str, int], *, complete: bool, can_show: bool) -> str:
    """Count the findings."""
    counted = ", ".join(pluralize(count, level) for level, count in counts.items())
    part = "" if complete else "; not everything was explored"
    return f"{counted}{part}{'; `--show N` shows the path to number N' if can_show else ''}"


def _bounds(scenario: Scenario, options: dict[str, Any]) -> Bounds:
    """Combine the scenario's bounds with those of the command line, which take precedence."""
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
    """Parse `0.5-3`, or `any`."""
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


# --- progress -------------------------------------------------------------------------------------------------------


@contextmanager
def _interruptible() -> Iterator[list[bool]]:
    """Make ctrl+c end only the exploring; a second one ends the program."""
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
    """Shows the progress, and stops the exploring after ctrl+c."""

    def __init__(self, interrupted: list[bool]) -> None:
        self._interrupted = interrupted
        self._shown = sys.stderr.isatty()
        self._next = time.monotonic() + _SECONDS_BETWEEN

    def __call__(self, space: Space) -> bool:
        if self._interrupted:
            if self._shown:
                print_notes("stopped: here is what was found so far (ctrl+c again skips it)")
            return False
        now = time.monotonic()
        if self._shown and now >= self._next:
            self._next = now + _SECONDS_BETWEEN
            count, left = len(space.situations), len(space.pending)
            print_notes(f"{count:,} situations, {left:,} still to look at (ctrl+c: report what was found so far)")
        return True


# --- results --------------------------------------------------------------------------------------------------------


def _report(scenario: Scenario, exploration: Exploration, show: str | None, *, show_keys: bool) -> Iterator[str]:
    yield f"{scenario.title}"
    for sentence in exploration.scope:
        yield fill(sentence, _WIDTH)
    yield ""
    for sentence in exploration.facts:
        yield fill(sentence, _WIDTH)
    yield from _finding_lines(
        [(each.level, each.text, str(each.location or "")) for each in exploration.findings],
        show,
        lambda number: _path_lines(scenario, exploration, exploration.findings[number]),
    )
    if show_keys:
        yield ""
        yield from _key_lines(scenario, exploration)
    yield ""
    counts = {level: exploration.count(level) for level in _MARKS}
    has_path = any(finding.path is not None for finding in exploration.findings)
    yield _last_line(counts, complete=exploration.is_complete, can_show=has_path and show is None)


def _finding_lines(
    findings: Sequence[tuple[str, str, str]], show: str | None, path_to: Callable[[int], Iterator[str]]
) -> Iterator[str]:
    """Yield findings (level, text and place), if requested with the path to each."""
    before = ""
    for number, (level, text, place) in enumerate(findings, 1):
        if level != before:
            yield ""
        before, where = level, f" [{place}]" if place else ""
        head = f"{number:>3} {_MARKS[level]}: "
        yield fill(f"{head}{text}{where}", _WIDTH, subsequent_indent="    ", break_on_hyphens=False)
        if show in ("all", str(number)):
            yield from path_to(number - 1)


def _path_lines(scenario: Scenario, exploration: Exploration, finding: ExploreFinding) -> Iterator[str]:
    """Yield the path to a finding, step by step."""
    if finding.path is not None:
        for at, sentence in enumerate(describe_path(scenario, finding.path, exploration.bounds), 1):
            yield fill(sentence, _WIDTH, initial_indent=f"      {at:>2}. ", subsequent_indent="          ")
        played = find_times(scenario, finding.path, exploration.bounds)
        if not played.is_certain:
            yield fill(
                f"This path could not be confirmed: {played.problem}.",
                _WIDTH,
                initial_indent="      ",
                subsequent_indent="      ",
            )
    else:
        yield "      no single path leads to it"


def _key_lines(scenario: Scenario, exploration: Exploration) -> Iterator[str]:
    """Yield a table of keys and states with their effects: `x` always, `-` sometimes, a blank never."""
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


def _write_paths(scenario: Scenario, exploration: Exploration, folder: Path, study: str) -> None:
    """Write each finding's path as a task file in a new or empty folder. Ends the program if they cannot be written."""
    if folder.exists() and any(folder.iterdir()):
        exit_with_usage(f"{folder} is not empty; name a new folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for number, finding in enumerate(exploration.findings, 1):
            if finding.path is not None:
                sentences = describe_path(scenario, finding.path, exploration.bounds)
                played = find_times(scenario, finding.path, exploration.bounds)
                text = task_file_of(finding.text, sentences, played, study)
                (folder / f"{number:02}-{finding.kind}.jsonl").write_text(text, encoding="utf-8")
    except OSError as error:
        raise Refused(f"{folder} cannot be written: {error_message(error)}", status=NOT_WRITTEN) from None
