"""`rise-engine test`: runs a study's tests, and reports differences from the expectations."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from rise_engine.author.trial.study_test import ENDING, read_study_test
from rise_engine.author.trial.study_test import FOLDER as TESTS
from rise_engine.author.trial.study_test_run import StudyTestOutcome, play_test
from rise_engine.base.errors import FileError
from rise_engine.base.exit_status import OK, REFUSED
from rise_engine.base.text import pluralize
from rise_engine.cli.options import JSON, SCENARIO
from rise_engine.cli.scenario.loading import sound_scenario
from rise_engine.cli.terminal import exit_with_usage, print_lines, reason_of, write_json
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario


def _find_tests(folder: Path, names: tuple[str, ...]) -> list[Path]:
    """Find the test files. Exits if one does not exist, or if there are none."""
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


def _play(scenario: Scenario, folder: Path, path: Path) -> StudyTestOutcome | tuple[str, ...]:
    """Run a test and return its outcome; or all errors of its file."""
    name = _shown(folder, path)
    try:
        return play_test(scenario, read_study_test(path.read_bytes(), name, scenario))
    except FileError as error:
        return error.lines
    except OSError as error:
        return (f"{name}: error: it cannot be read ({reason_of(error)})",)


def _outcome_lines(name: str, outcome: StudyTestOutcome | tuple[str, ...]) -> list[str]:
    if isinstance(outcome, tuple):
        return [f"FAIL  {name}: it cannot be read", *(f"      {line}" for line in outcome)]
    about = f"{pluralize(outcome.steps, 'step')}, {outcome.seconds:.1f} s of the study"
    return [
        f"{'ok  ' if outcome.passed else 'FAIL'}  {name}: {outcome.test.title} ({about})",
        *(f"      {name}:{each.line}: after {each.t:.1f} s: {each.text}" for each in outcome.failures),
    ]


def _as_json(name: str, outcome: StudyTestOutcome | tuple[str, ...]) -> dict[str, Any]:
    if isinstance(outcome, tuple):
        return {"file": name, "passed": False, "problems": outcome}
    failures = [{"line": each.line, "t": each.t, "text": each.text} for each in outcome.failures]
    about = {"title": outcome.test.title, "steps": outcome.steps, "seconds": outcome.seconds}
    return {"file": name, "passed": outcome.passed, **about, "failures": failures}


@click.command()
@SCENARIO
@click.argument("files", nargs=-1, metavar="[FILE]...")
@JSON
def test(folder: str, files: tuple[str, ...], as_json: bool) -> int:
    """Run the tests of the study in DIR: all in its folder tests/, or these. They need no robot and do not wait.

    A test lists steps, one per line, and what they should lead to. The editor keeps a trial run as a test.
    Exit status: 0; 1 if a test fails or cannot be read, or the scenario has errors; 2 if there are no tests.
    """
    scenario = sound_scenario(load(folder))
    root = Path(folder)
    passed = 0
    tests = _find_tests(root, files)
    for path in tests:
        outcome, name = _play(scenario, root, path), _shown(root, path)
        passed += not isinstance(outcome, tuple) and outcome.passed
        if as_json:
            write_json(_as_json(name, outcome), indent=0)
        else:
            print_lines(*_outcome_lines(name, outcome))
    if not as_json:
        print_lines(f"{passed} of {pluralize(len(tests), 'test')} passed")
    return OK if passed == len(tests) else REFUSED
