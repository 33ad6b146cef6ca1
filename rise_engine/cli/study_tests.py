"""`rise-engine test`: play the tests of a study, and say what came otherwise than they expect."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import click

from rise_engine import exit_status
from rise_engine.cli.arguments import exit_with_usage, resolve_scenario
from rise_engine.cli.check import print_findings
from rise_engine.cli.options import FOLDER, JSON
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_engine.text import clean, pluralize
from rise_engine.trial.playing import StudyTestOutcome, play_test
from rise_engine.trial.study_test import ENDING, StudyTestError, read_study_test
from rise_engine.trial.study_test import FOLDER as TESTS


def _find_tests(folder: Path, names: tuple[str, ...]) -> list[Path]:
    """The files that are meant. Exits when one is not there, or there is none at all."""
    if names:
        found = [path if (path := Path(name)).exists() else folder / name for name in names]
        missing = [name for name, path in zip(names, found, strict=True) if not path.is_file()]
        if missing:
            exit_with_usage(f"there is no file {missing[0]}, neither here nor in {folder}")
        return found
    found = sorted((folder / TESTS).glob(f"*{ENDING}"))
    if not found:
        exit_with_usage(f"there are no tests in {folder / TESTS}: a trial in the editor is kept as one")
    return found


def _shown(folder: Path, path: Path) -> str:
    return path.relative_to(folder).as_posix() if path.is_relative_to(folder) else str(path)


def _play(scenario: Scenario, folder: Path, path: Path) -> StudyTestOutcome | str:
    """What came of a test; or everything that is wrong with its file."""
    name = _shown(folder, path)
    try:
        return play_test(scenario, read_study_test(path.read_bytes(), name, scenario))
    except StudyTestError as error:
        return str(error)
    except OSError as error:
        return f"{name}: error: it cannot be read ({error.strerror or error})"


def _print_outcome(name: str, outcome: StudyTestOutcome | str) -> None:
    if isinstance(outcome, str):
        print(f"FAIL  {name}: it cannot be read")
        print("".join(f"      {line}\n" for line in clean(outcome, keep="\n").split("\n")), end="")
        return
    about = f"{pluralize(outcome.steps, 'step')}, {outcome.seconds:.1f} s of the study"
    print(clean(f"{'ok  ' if outcome.passed else 'FAIL'}  {name}: {outcome.test.title} ({about})"))
    for failure in outcome.failures:
        print(clean(f"      {name}:{failure.line}: after {failure.t:.1f} s: {failure.text}"))


def _as_json(name: str, outcome: StudyTestOutcome | str) -> dict[str, Any]:
    if isinstance(outcome, str):
        return {"file": name, "passed": False, "problems": outcome.split("\n")}
    failures = [{"line": each.line, "t": each.t, "text": each.text} for each in outcome.failures]
    about = {"title": outcome.test.title, "steps": outcome.steps, "seconds": outcome.seconds}
    return {"file": name, "passed": outcome.passed, **about, "failures": failures}


@click.command()
@FOLDER
@click.argument("files", nargs=-1, metavar="[FILE]...")
@JSON
def test(folder: str, files: tuple[str, ...], as_json: bool) -> None:
    """Play the tests of the study in DIR, all in its folder tests/, or these: without robot and without waiting.

    A test says what is done, a line each, and what is to come of it; a trial in the editor is kept as one.
    Exit status: 0; 1 when a test fails, cannot be read, or the scenario has errors; 2 when there are no tests.
    """
    folder = resolve_scenario(folder)
    loaded = load(folder)
    if loaded.scenario is None:
        print_findings(loaded)
        sys.exit(exit_status.REFUSED)
    root = Path(folder)
    passed = 0
    tests = _find_tests(root, files)
    for path in tests:
        outcome, name = _play(loaded.scenario, root, path), _shown(root, path)
        passed += not isinstance(outcome, str) and outcome.passed
        if as_json:
            print(json.dumps(_as_json(name, outcome), ensure_ascii=False))
        else:
            _print_outcome(name, outcome)
    if not as_json:
        print(f"{passed} of {pluralize(len(tests), 'test')} passed")
    sys.exit(exit_status.OK if passed == len(tests) else exit_status.REFUSED)


COMMANDS = {"test": test}
