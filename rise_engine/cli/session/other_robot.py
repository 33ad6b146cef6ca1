"""The inputs of a recorded session on another, simulated robot, in virtual time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rise_engine.base.errors import AdapterError
from rise_engine.cli.session.headless_session import LIVELOCK, LIVELOCK_SECONDS
from rise_engine.kernel.inputs import AnyInput, Submit
from rise_engine.kernel.records import AnyRecord
from rise_engine.results.bundle.courses import (
    CourseComparison,
    RecordedSession,
    TaskNames,
    compare_courses,
    read_recorded,
)
from rise_engine.results.export.format import ExportError
from rise_engine.run.engine.clock import VirtualClock
from rise_engine.run.engine.drivers import RobotOptionsError, make_robot
from rise_engine.run.engine.engine import Engine
from rise_engine.scenario.files.study_paths import DEFAULT_PATHS
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from rise_engine.session.folder import SCENARIO_COPY, load_scenario_copy, read_info, spoken_as


def compare_on_robot(folder: Path, robot: str) -> CourseComparison:
    """Run the inputs of people and programs of the session in `folder` on a simulated `robot`, and compare.

    Reports of the session's own robot, and of its timers, are not repeated: the other robot gives its own.

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
    loaded = load(copy, robot=robot, mode="debug", paths=paths, **spoken_as(info))
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
