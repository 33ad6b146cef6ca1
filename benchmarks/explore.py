"""Exploring: inputs per CPU second, compared with the same inputs via snapshots. For LabLinking with all its keys, also
the seconds and the memory."""

from __future__ import annotations

import resource
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from measure import Report, cpu_seconds

from rise_engine.author.explore.exploration import main_rule, sessions_of
from rise_engine.author.explore.moves import Bounds
from rise_engine.author.explore.space import Space
from rise_engine.author.explore.stepper import Stepper
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import Submit
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario

SCENARIOS = Path(__file__).parents[1] / "scenarios"
ALL_KEYS = Bounds(keys="all", faults=0, beside=1, stop=False, lost=False)
IN_PASSING = Bounds(stop=False, lost=False)
SNAPSHOTS = 2_000


def study(name: str) -> Scenario:
    scenario = load(SCENARIOS / name).scenario
    assert scenario is not None
    return scenario


def explored(scenario: Scenario, bounds: Bounds) -> Space:
    space = Space(Stepper(scenario, bounds, sessions_of(scenario), main_rule(scenario)))
    space.begin()
    space.explore()
    return space


def timed(scenario: Scenario, bounds: Bounds) -> tuple[float, Space]:
    """CPU seconds of exploring, and the results."""
    spaces: list[Space] = []
    return cpu_seconds(lambda: spaces.append(explored(scenario, bounds)), 1), spaces[0]


def by_snapshot(scenario: Scenario) -> Callable[[], None]:
    """One input each time to a kernel that was restored from a snapshot."""
    kernel = Kernel(scenario, 0)
    kernel.handle(sessions_of(scenario)[0])
    key = next(key for key in scenario.keys.values() if key.function == "startInteractionRule")
    kernel.handle(Submit(t=1.0, function=key.function, behavior=key.task_behavior))
    snapshot = kernel.snapshot()

    def work() -> None:
        for _ in range(SNAPSHOTS):
            restored = Kernel.restore(scenario, snapshot)
            restored.handle(Submit(t=2.0, function="raiseEventTopic", behavior="/nobody"))
            restored.snapshot()

    return work


def all_keys() -> None:
    """LabLinking with all keys, in a separate process: prints its CPU seconds and megabytes."""
    seconds, space = timed(study("lablinking"), ALL_KEYS)
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(seconds, megabytes, len(space.situations), space.stepper.steps)


def main() -> bool:
    report = Report("Exploring")
    for name in ("greeting", "lab_opening", "lablinking", "negation"):
        scenario = study(name)
        seconds, space = timed(scenario, IN_PASSING)
        steps = space.stepper.steps
        peer = cpu_seconds(by_snapshot(scenario), SNAPSHOTS)
        report.row(f"{name}: situations, inputs", f"{len(space.situations):,}, {steps:,}")
        report.row(f"{name}: times as many inputs as by snapshots", f"{peer * steps / seconds:.1f}")
        report.target(f"{name}, without stops and lost robots, CPU s", seconds, 5, at_least=False)
        report.target(f"{name}: inputs per CPU second", steps / seconds, 20_000, at_least=True)
    command = [sys.executable, "-c", "import sys; sys.path[:0] = [sys.argv[1]]; import explore; explore.all_keys()"]
    told = subprocess.run([*command, str(Path(__file__).parent)], check=True, capture_output=True, text=True).stdout
    seconds, megabytes, situations, inputs = map(float, told.split())
    report.row("LabLinking with all keys: situations, inputs", f"{situations:,.0f}, {inputs:,.0f}")
    report.target("LabLinking with all keys, CPU s", seconds, 60, at_least=False)
    report.target("LabLinking with all keys, MB", megabytes, 200, at_least=False)
    return report.met


if __name__ == "__main__":
    sys.exit(not main())
