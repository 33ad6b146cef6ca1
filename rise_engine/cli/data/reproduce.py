"""`rise-engine reproduce`: checks that a bundle's sessions replay, and that its results can be reproduced."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click
import msgspec
from msgspec import Struct, field

from rise_engine import __version__
from rise_engine.base.errors import AdapterError, FileError, RiseError, SessionError
from rise_engine.base.exit_status import DIFFERENT, OK, USAGE
from rise_engine.base.text import pluralize
from rise_engine.cli.options import JSON
from rise_engine.cli.session.headless_session import LIVELOCK, LIVELOCK_SECONDS
from rise_engine.cli.study.planning import NOT_PROVED, agreement_text, proof_lines, proof_row
from rise_engine.cli.terminal import Refused, print_lines, refusing, write_json
from rise_engine.kernel.inputs import AnyInput, Submit
from rise_engine.kernel.records import AnyRecord
from rise_engine.results.bundle.about import AboutBundle, read_about
from rise_engine.results.bundle.contents import is_running_program, wheel_in
from rise_engine.results.bundle.courses import (
    CourseComparison,
    RecordedSession,
    TaskNames,
    compare_courses,
    read_recorded,
)
from rise_engine.results.bundle.crate import ManifestCheck, fingerprint, opened_bundle
from rise_engine.results.bundle.derived import (
    DerivedCheck,
    InputsCheck,
    check_bundle,
    check_inputs,
    compare_derived,
    sessions_in_order,
)
from rise_engine.results.export.format import ExportError
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.run.engine.drivers import RobotOptionsError, make_robot
from rise_engine.run.engine.engine import Engine
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import SCENARIO_COPY, load_scenario_copy, read_info, speech_arguments
from rise_engine.study.proof import ProvedSession, compared_files, prove_sessions
from rise_engine.study.state import StudyStatus, read_state
from rise_engine.study.study_log import StudyLogError

_SHOWN = 5
"""Maximum number of differences of a kind that are printed for a session; `--json` has all."""


class OtherCourse(Struct, frozen=True):
    """A session on another robot."""

    name: str
    comparison: CourseComparison | None
    problem: str = ""


class Reproduction(Struct):
    """The results for a bundle."""

    check: ManifestCheck
    about: AboutBundle
    fingerprint: str
    inputs: InputsCheck = field(default_factory=InputsCheck)
    derived: DerivedCheck = field(default_factory=DerivedCheck)
    problems: list[str] = field(default_factory=list)
    """Sentences on parts that cannot be reproduced."""
    sessions: list[ProvedSession] = field(default_factory=list)
    compared: tuple[str, ...] = ()
    """The files with which the sessions were compared."""
    others: list[OtherCourse] = field(default_factory=list)

    @property
    def is_identical(self) -> bool:
        """Whether there are no differences."""
        same = all(each.comparison is not None and each.comparison.identical for each in self.others)
        follows = not (self.inputs.problems or self.derived.differences or self.problems)
        return self.check.whole and follows and all(each.proved for each in self.sessions) and same

    @property
    def same_version(self) -> bool:
        """Whether this version of the program made the bundle."""
        return self.about.program == __version__


@click.command()
@click.argument("bundle", metavar="BUNDLE", type=click.Path())
@click.option(
    "--robot", metavar="NAME", help="Run the same inputs on this robot, simulated, and report the differences."
)
@JSON
def reproduce(bundle: str, robot: str | None, as_json: bool) -> int:
    """Check that BUNDLE, a folder or zip file of `rise-engine study bundle`, is whole and reproduces its results.

    The recorded inputs of every session run through this program once more. Then it makes tables, BIDS and the report
    again from these sessions and the study's files, and compares them with those in the bundle. The output ends with
    what this has proved, and what it has not.

    With --robot, it repeats with another robot what people and programs did. That robot is simulated here and gives its
    own reports and times. The output lists acts and rules that end differently.

    Exit status: 0 nothing differs; 1 something differs, is missing or cannot be replayed; 2 no such bundle or robot.
    """
    path = Path(bundle)
    with refusing(USAGE, of=ExportError, where=bundle), opened_bundle(path) as root:
        check = check_bundle(root)
        found = Reproduction(check, read_about(root), fingerprint(root))
        state = _state_of(root, found)
        found.compared = compared_files(state)
        folders = sessions_in_order(root, state)
        if robot is not None and folders:
            load_for_robot(folders[0], robot)  # an unknown robot is an error, not a difference
        show = _show_nothing if as_json else print_lines  # with --json, all output comes at the end
        show(*_check_lines(found.check))
        for session in prove_sessions(root, state, absent=found.about.absent):
            found.sessions.append(session)
            show(*proof_lines(session))
        _make_again(root, state, folders, found)
        show(*_made_lines(found))
        for folder in folders if robot is not None else ():
            other = _on_robot(folder, str(robot))
            found.others.append(other)
            show(*_other_lines(other, str(robot)))
    if not found.sessions:
        raise Refused(f"{path}: no session is in it that could be run again", status=DIFFERENT)
    if as_json:
        write_json(_document(path, found, robot))
    else:
        print_lines(*_last_lines(found, robot))
    return OK if found.is_identical else DIFFERENT


def _show_nothing(*lines: str) -> None:
    """Print nothing, in place of `print_lines`."""


def _state_of(root: Path, found: Reproduction) -> StudyStatus | None:
    try:
        return read_state(root)
    except (FileError, StudyLogError) as error:
        found.problems += error.lines
        return None


def _make_again(root: Path, state: StudyStatus | None, folders: Sequence[Path], found: Reproduction) -> None:
    """Compare the inputs with the sessions, and the files made from both with the bundle."""
    if state is None or not folders:
        return
    found.inputs = check_inputs(root, state, folders)
    if wheel := wheel_in(root):
        if is_running_program(root):
            found.inputs.proved.append(f"{wheel} is the program that runs here, byte for byte")
        else:
            found.inputs.open.append(f"that {wheel} is the program that ran the sessions: another one runs here")
    try:
        found.derived = compare_derived(root, found.about, same_version=found.same_version)
    except (RiseError, OSError) as error:
        found.problems.append(f"tables, BIDS and the report cannot be made again: {error}")


def _on_robot(folder: Path, robot: str) -> OtherCourse:
    try:
        return OtherCourse(folder.name, compare_on_robot(folder, robot))
    except (ExportError, SessionError) as error:
        return OtherCourse(folder.name, None, str(error))


def _check_lines(check: ManifestCheck) -> list[str]:
    lines = [f"changed: {name}" for name in check.changed]
    lines += [f"missing: {name}" for name in check.missing]
    lines += [f"not part of the bundle: {name}" for name in check.unlisted]
    lines += [f"unreadable: {sentence}" for sentence in check.unreadable]
    if check.whole:
        return [f"whole: {pluralize(check.files, 'file')} as they were"]
    return [*lines, f"({pluralize(check.files, 'file')} as they were)"]


def _made_lines(found: Reproduction) -> list[str]:
    """Describe the results for the inputs, and for all files made from them."""
    derived = found.derived
    lines = [f"different: {each}" for each in (*found.problems, *found.inputs.problems)]
    lines += [f"different: {each}" for each in derived.differences]
    if not found.same_version:
        lines.append(
            f"the bundle was made with rise-tui {found.about.program}, and this is {__version__}: only columns "
            "that both know are compared"
        )
        lines += [f"not compared: {each}" for each in derived.not_compared]
    same = f"made again: {pluralize(derived.files, 'file')} of tables, BIDS and report"
    return [*lines, f"{same}, {'the same' if derived.files != 1 else 'it is the same'}"] if derived.files else lines


def _other_lines(other: OtherCourse, robot: str) -> list[str]:
    found = other.comparison
    if found is None:
        return [f"{other.name} on {robot}: cannot be run: {other.problem}"]
    lines = [f"{other.name} on {robot} (simulated): {found.same} of {pluralize(found.acts, 'act')} end as before"]
    for differences in (found.acts_differ, found.rules_differ):
        lines += [f"  {each}" for each in differences[:_SHOWN]]
        if len(differences) > _SHOWN:
            lines.append(f"  and {len(differences) - _SHOWN} more (--json)")
    if found.rules_same:
        lines.append(f"  the same way: {', '.join(found.rules_same)}")
    if found.longer:
        longer = "longer" if found.median_longer >= 0 else "shorter"
        lines.append(
            f"  {pluralize(len(found.longer), 'act')} took a different time: {abs(found.median_longer):.1f} s {longer} "
            "in the median"
        )
    return lines


def _last_lines(found: Reproduction, robot: str | None) -> list[str]:
    identical = sum(each.identical for each in found.sessions)
    lines = ["", f"{identical} of {pluralize(len(found.sessions), 'session')} identical"]
    if robot is not None:
        same = sum(each.comparison is not None and each.comparison.identical for each in found.others)
        lines.append(f"{same} of {len(found.others)} went the same way on {robot}")
    if not found.check.whole:
        lines.append("the bundle is not as it was made")
    if not found.is_identical and not found.same_version:
        lines.append(
            f"it was made with rise-tui {found.about.program}, and this is {__version__}: install the one in program/, "
            "and try again"
        )
    return [*lines, "", *_proof_paragraph(found)]


def _proof_paragraph(found: Reproduction) -> list[str]:
    """Return what the results have proved, and what they have not."""
    proved = sum(each.proved for each in found.sessions)
    lines = ["This proves:"]
    if proved:
        lines.append(
            f"- {pluralize(proved, 'session')}: every record follows from the recorded inputs and the session's copy "
            f"of the scenario, and {agreement_text(found.compared, found.sessions)}"
        )
    lines += [f"- {each}" for each in found.inputs.proved]
    if found.derived.files and not found.derived.differences:
        lines.append("- tables, BIDS and the report follow from the sessions and the study's files in the bundle")
    lines = lines if len(lines) > 1 else ["This proves nothing."]
    lines += [
        "This does not prove:",
        *(f"- {each}" for each in found.inputs.open),
        *(f"- anything about {name}: {why}" for name, why in found.about.absent.items()),
        *(f"- {each}" for each in NOT_PROVED),
        "- that README.md, environment.txt and ro-crate-metadata.json are right: nothing is derived from them",
        "- that nobody has replaced everything together, inputs, records and all that follows. Against that, compare "
        "the fingerprint with the one that the authors have published:",
        f"  {found.fingerprint}",
    ]
    return lines


def _document(path: Path, found: Reproduction, robot: str | None) -> dict[str, Any]:
    return {
        "bundle": str(path),
        "as_it_was": found.is_identical,
        "made_with": found.about.program,
        "fingerprint": found.fingerprint,
        "options": msgspec.to_builtins(found.about.options),
        "absent": found.about.absent,
        "problems": found.problems,
        "inputs": msgspec.to_builtins(found.inputs),
        "made_again": {
            **msgspec.to_builtins(found.derived),
            "differences": [str(each) for each in found.derived.differences],
        },
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


# --- another robot ----------------------------------------------------------------------------------------------------


def compare_on_robot(folder: Path, robot: str) -> CourseComparison:
    """Run the inputs of people and programs of the session in `folder` on a simulated `robot`, and compare.

    Reports of the session's own robot and timers are not repeated: the other robot gives its own.

    :param robot: the name of a profile (docs/reference/robots.md).
    :raises ExportError: the scenario does not load for that robot, or loops without end with it.
    :raises rise_engine.base.errors.SessionError: the session cannot be read.
    """
    info = read_info(folder)
    recorded = read_recorded(folder, info.seed)
    own, other = load_scenario_copy(folder, info), load_for_robot(folder, robot)
    return compare_courses(recorded.records, run_on_robot(recorded, other), own, other)


def load_for_robot(folder: Path, robot: str) -> Scenario:
    """Load the scenario of the session in `folder` for another, simulated robot.

    :raises ExportError: it does not load.
    """
    copy, info = folder / SCENARIO_COPY, read_info(folder)
    paths = {kind: path for kind, path in DEFAULT_PATHS.items() if (copy / path).exists()}
    loaded = load(copy, robot=robot, mode="debug", paths=paths, **speech_arguments(info))
    if loaded.scenario is None:
        findings = [str(each) for each in loaded.errors]
        raise ExportError(f"the scenario cannot be run on the robot {robot!r}:", *findings)
    return loaded.scenario


def run_on_robot(recorded: RecordedSession, scenario: Scenario) -> Sequence[AnyRecord]:
    """Run the inputs on the scenario's robot, and return the records. Raises ExportError."""
    clock = VirtualClock()
    try:
        robot = make_robot(scenario.robot, "debug", clock, recorded.seed)
    except (AdapterError, RobotOptionsError) as error:
        raise ExportError(str(error)) from None
    records: list[AnyRecord] = []
    before, after = TaskNames(), TaskNames()
    for record in recorded.records:
        before.add(record)

    def take(record: AnyRecord) -> None:
        records.append(record)
        after.add(record)

    engine = Engine(scenario, robot, clock, recorded.seed, started=recorded.started, sinks=(take,))

    def give(input: AnyInput) -> None:
        if not engine.ended:
            engine.accept(before.translate(input, after) if isinstance(input, Submit) else input)

    engine.start()
    for input in recorded.inputs:
        clock.call_at(input.t, lambda input=input: give(input))  # type: ignore[misc]
    clock.call_at(recorded.end, lambda: engine.end("the recorded session ended"))
    moment, inputs = clock.now(), engine.inputs
    while not engine.ended and clock.advance():
        if clock.now() >= moment + LIVELOCK_SECONDS:
            moment, inputs = clock.now(), engine.inputs
        elif engine.inputs - inputs > LIVELOCK + len(recorded.inputs):
            raise ExportError(f"something goes round in circles at {clock.now():g} s")
    engine.end_now("the recorded session ended")
    if engine.failure is not None:
        raise ExportError(f"the engine failed, which is a mistake in this program: {engine.failure!r}")
    return records
