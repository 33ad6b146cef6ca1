"""`rise-engine reproduce`: whether the sessions of a bundle come out again."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import msgspec
from msgspec import Struct, field

from rise_engine import __version__
from rise_engine.bundle.archive import opened_bundle
from rise_engine.bundle.courses import CourseComparison
from rise_engine.bundle.environment import made_with
from rise_engine.bundle.errors import BundleError
from rise_engine.bundle.manifest import ManifestCheck
from rise_engine.bundle.reproducing import check_bundle, session_folders
from rise_engine.cli.options import JSON
from rise_engine.cli.other_robot import CannotRun, compare_on_robot, load_for_robot
from rise_engine.cli.proof_text import proof_lines, proof_row
from rise_engine.cli.terminal import write_json
from rise_engine.exit_status import DIFFERENT, OK, USAGE
from rise_engine.session.errors import SessionError
from rise_engine.study.proof import ProvedSession, prove_sessions
from rise_engine.study.state import StudyStatus, StudyUnusable, read_state
from rise_engine.study.study_log import StudyLogError
from rise_engine.text import clean, pluralize

_SHOWN = 5
"""Differences of a kind that are printed for a session; `--json` has all."""


class OtherCourse(Struct, frozen=True):
    """A session on another robot."""

    name: str
    comparison: CourseComparison | None
    problem: str = ""


class Reproduction(Struct):
    """What came of a bundle."""

    check: ManifestCheck
    version: str = ""
    """Of this program, with which it was made."""
    sessions: list[ProvedSession] = field(default_factory=list)
    others: list[OtherCourse] = field(default_factory=list)

    @property
    def as_it_was(self) -> bool:
        """Whether nothing differs."""
        same = all(each.comparison is not None and each.comparison.identical for each in self.others)
        return self.check.whole and all(each.proved for each in self.sessions) and same


@click.command()
@click.argument("bundle", metavar="BUNDLE", type=click.Path())
@click.option("--robot", metavar="NAME", help="Run the same inputs on this robot, simulated, and say what differs.")
@JSON
def reproduce(bundle: str, robot: str | None, as_json: bool) -> None:
    """Say whether BUNDLE, a folder or zip file of `rise-engine study bundle`, is whole and comes out again: its check
    sums are compared, and the recorded inputs of every session go through this program once more.

    With --robot, what people and programs did is done again with another robot, which is simulated here and gives its
    own reports and times; acts that end otherwise and rules that go another way are told.

    Exit status: 0 as it was; 1 something differs, is missing or cannot be replayed; 2 there is no such bundle or robot.
    """
    sys.exit(reproduce_report(Path(bundle), robot, as_json=as_json))


def reproduce_report(path: Path, robot: str | None, *, as_json: bool) -> int:
    """Reproduce a bundle, and say what came of it; the exit status."""
    try:
        with opened_bundle(path) as root:
            found = Reproduction(check_bundle(root), made_with(root))
            folders = session_folders(root)
            if robot is not None and folders:
                load_for_robot(folders[0], robot)  # a robot that there is not is no difference
            if not as_json:
                _print(_check_lines(found.check))
            for session in prove_sessions(root, _state_of(root)):
                found.sessions.append(session)
                if not as_json:
                    _print(proof_lines(session))
            for folder in folders if robot is not None else ():
                other = _on_robot(folder, str(robot))
                found.others.append(other)
                if not as_json:
                    _print(_other_lines(other, str(robot)))
    except (BundleError, CannotRun) as error:
        _print_error(f"error: {path}: {line}" for line in str(error).splitlines())
        return USAGE
    if not found.sessions:
        _print_error([f"error: {path}: no session is in it that could be run again"])
        return DIFFERENT
    if as_json:
        write_json(_document(path, found, robot))
    else:
        _print(_last_lines(found, robot))
    return OK if found.as_it_was else DIFFERENT


def _state_of(root: Path) -> StudyStatus | None:
    try:
        return read_state(root)
    except (StudyUnusable, StudyLogError):
        return None


def _on_robot(folder: Path, robot: str) -> OtherCourse:
    try:
        return OtherCourse(folder.name, compare_on_robot(folder, robot))
    except (CannotRun, SessionError) as error:
        return OtherCourse(folder.name, None, str(error))


def _check_lines(check: ManifestCheck) -> list[str]:
    lines = [f"changed: {name}" for name in check.changed]
    lines += [f"missing: {name}" for name in check.missing]
    lines += [f"not of the bundle: {name}" for name in check.unlisted]
    lines += [f"unreadable: {sentence}" for sentence in check.unreadable]
    if check.whole:
        return [f"whole: {pluralize(check.files, 'file')} as they were"]
    return [*lines, f"({pluralize(check.files, 'file')} as they were)"]


def _other_lines(other: OtherCourse, robot: str) -> list[str]:
    found = other.comparison
    if found is None:
        return [f"{other.name} on {robot}: cannot be run: {other.problem}"]
    lines = [f"{other.name} on {robot} (simulated): {found.same} of {pluralize(found.acts, 'act')} end as they had"]
    for differences in (found.acts_differ, found.rules_differ):
        lines += [f"  {each}" for each in differences[:_SHOWN]]
        if len(differences) > _SHOWN:
            lines.append(f"  and {len(differences) - _SHOWN} more (--json)")
    if found.rules_same:
        lines.append(f"  the same way: {', '.join(found.rules_same)}")
    if found.longer:
        longer = "longer" if found.median_longer >= 0 else "shorter"
        lines.append(
            f"  {pluralize(len(found.longer), 'act')} took other times: {abs(found.median_longer):.1f} s {longer} in "
            "the median"
        )
    return lines


def _last_lines(found: Reproduction, robot: str | None) -> list[str]:
    identical = sum(each.comparison is not None and each.comparison.identical for each in found.sessions)
    lines = ["", f"{identical} of {pluralize(len(found.sessions), 'session')} identical"]
    if robot is not None:
        same = sum(each.comparison is not None and each.comparison.identical for each in found.others)
        lines.append(f"{same} of {len(found.others)} went the same way on {robot}")
    if not found.check.whole:
        lines.append("the bundle is not as it was made")
    if identical < len(found.sessions) and found.version not in ("", __version__):
        lines.append(f"it was made with rise-tui {found.version}, and this is {__version__}: try that version")
    return lines


def _document(path: Path, found: Reproduction, robot: str | None) -> dict[str, Any]:
    return {
        "bundle": str(path),
        "as_it_was": found.as_it_was,
        "made_with": found.version,
        "whole": found.check.whole,
        "files": msgspec.to_builtins(found.check),
        "sessions": [proof_row(each) for each in found.sessions],
        "robot": robot,
        "on_robot": [
            {
                "session": each.name,
                "problem": each.problem,
                **({} if each.comparison is None else msgspec.to_builtins(each.comparison)),
            }
            for each in found.others
        ],
    }


def _print(lines: Sequence[str]) -> None:
    sys.stdout.write("".join(f"{clean(line)}\n" for line in lines))
    sys.stdout.flush()


def _print_error(lines: Any) -> None:
    sys.stderr.write("".join(f"{clean(line)}\n" for line in lines))


COMMANDS = {"reproduce": reproduce}
