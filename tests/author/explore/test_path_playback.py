"""Ways through the shipped studies are played on the engine, and written as task files that play."""

from __future__ import annotations

from functools import cache
from pathlib import Path as FilePath

import msgspec
import pytest

from rise_engine.author.explore.path_playback import PlayedPath, find_times, task_file_of
from rise_engine.author.explore.path_words import describe_path
from rise_engine.author.explore.situation import Situation
from rise_engine.author.explore.situation_graph import Path
from rise_engine.author.explore.stepper import Fact
from rise_engine.kernel.records import AnyRecord
from rise_engine.kernel.view import SessionView
from rise_engine.run.protocol.task_file import read_task_file
from tests.author.explore.exploring import ROOT, shipped
from tests.author.explore.paths import bounds_for, paths_of
from tests.chance import SEARCH, searched
from tests.commands import typed

pytestmark = pytest.mark.slow

PLAYS = {
    ("greeting", 0): 0.7,
    ("greeting", 1): 0.5,
    ("lab_opening", 0): 0.9,
    ("lab_opening", 1): 0.85,
    ("lablinking", 0): 1.0,
    ("lablinking", 1): 0.9,
    ("negation", 0): 0.9,
}
"""How many of the ways play at least. The others need more time than their clocks allow, or acts that take longer than
expected, which nobody looks for."""
FEW = [("lab_opening", 0)]
"""Those that are played every time."""


@cache
def played(name: str, faults: int) -> dict[Fact, tuple[Path, PlayedPath]]:
    scenario, bounds = shipped(name), bounds_for(name, faults)
    return {fact: (path, find_times(scenario, path, bounds)) for fact, path in paths_of(name, faults).items()}


@pytest.mark.search
@pytest.mark.parametrize(("name", "faults"), PLAYS if SEARCH else FEW)
def test_ways_are_played_as_they_are_told(name: str, faults: int, tmp_path: FilePath) -> None:
    ways = played(name, faults)
    certain = {fact: way for fact, way in ways.items() if way[1].is_certain}
    assert len(certain) / len(ways) >= PLAYS[name, faults]
    for _, result in ways.values():
        assert result.is_certain == (not result.problem)
    some = [*certain][:: max(1, len(certain) // 8)]
    for number, fact in enumerate(some):
        path, result = certain[fact]
        told = describe_path(shipped(name), path, bounds_for(name, faults))
        text = task_file_of(str(fact), told, result, f"scenarios/{name}")
        file = tmp_path / f"{number}.jsonl"
        file.write_text(text)
        again = read_task_file(text.encode(), file.name)
        assert [(each.at, each.task) for each in again.tasks] == [(each.at, each.task) for each in result.tasks]
        assert (again.faults, again.seed, again.condition) == (result.faults, result.seed, result.condition)
        assert looks_of(path.end) in looks_while_run(name, file, result.seconds), fact


def test_every_state_of_every_rule_of_lablinking_is_come_to() -> None:
    scenario, bounds = shipped("lablinking"), bounds_for("lablinking", 0)
    ways = [path for fact, path in paths_of("lablinking", 0).items() if fact[0] == "state"]
    assert len(ways) > 40
    results = [find_times(scenario, path, bounds) for path in (ways if SEARCH else ways[::4])]
    assert all(result.is_certain and not result.faults for result in results)


@pytest.mark.parametrize("name", ["lablinking", pytest.param("lab_opening", marks=searched)])
@pytest.mark.parametrize(
    ("fault", "end"), [("=fail@", ""), ("vanish@", "-")], ids=["an act", "the robot, until it is back"]
)
def test_what_goes_wrong_is_asked_of_the_robot(name: str, fault: str, end: str) -> None:
    scenario, bounds = shipped(name), bounds_for(name, 1)
    results = (find_times(scenario, path, bounds) for path in reversed(paths_of(name, 1).values()))
    faults = (each for result in results if result.is_certain for each in result.faults)
    assert any(fault in each and end in each for each in faults)


def test_chance_picks_as_the_way_has_it() -> None:
    scenario, bounds = shipped("greeting"), bounds_for("greeting", 0)
    by_chance = (
        path
        for path in paths_of("greeting", 0).values()
        if any("chance decides" in each for each in describe_path(scenario, path, bounds))
    )
    results = (find_times(scenario, path, bounds) for path in by_chance)
    assert any(result.is_certain and result.seed > 0 for result in results)


def test_a_way_for_which_there_are_no_times_says_perhaps_and_why() -> None:
    ways = played("lab_opening", 0)
    fact, (path, result) = next((fact, way) for fact, way in ways.items() if not way[1].is_certain)
    told = describe_path(shipped("lab_opening"), path, bounds_for("lab_opening", 0))
    text = task_file_of(str(fact), told, result, "scenarios/lab_opening")
    assert f"# This path could not be confirmed: {result.problem}." in text
    assert read_task_file(text.encode(), "perhaps.jsonl").tasks == tuple(
        msgspec.structs.replace(each, file="perhaps.jsonl", line=again.line)
        for each, again in zip(result.tasks, read_task_file(text.encode(), "perhaps.jsonl").tasks, strict=True)
    )


Looks = tuple[tuple[tuple[str, str], ...], tuple[str, ...], tuple[str, ...], str, bool]


def looks_of(situation: Situation) -> Looks:
    """What a situation looks like from outside."""
    return (
        tuple(sorted((rule.name, rule.state) for rule in situation.rules)),
        tuple(act.name for act in situation.waiting),
        tuple(sorted(act.name for act in situation.running)),
        situation.stop,
        situation.robot_lost,
    )


def looks_while_run(name: str, file: FilePath, seconds: float) -> set[Looks]:
    """What a session looked like at the end of each step, just before it was over."""
    folder = ROOT / "scenarios" / name
    options = ["--tasks", str(file), "--speed", "max", "--json", "--until", f"{seconds + 0.0001:.6f}"]
    ran = typed("run", folder, *options)
    assert ran.exit_code == 0, ran.output
    view = SessionView()
    found: set[Looks] = set()
    for line in ran.stdout.splitlines():
        record = msgspec.json.decode(line, type=AnyRecord)
        if record.t > seconds - 0.0001:
            found.add(looks_of_view(view))
        view.apply(record)
    found.add(looks_of_view(view))
    return found


def looks_of_view(view: SessionView) -> Looks:
    rules = ((name, rule.state or "") for name, rule in view.rules.items() if rule.running)
    return (
        tuple(sorted(rules)),
        tuple(view.tasks[task].behavior for task in view.waiting),
        tuple(sorted(view.tasks[task].behavior for task in view.running)),
        view.stop.status,
        view.robot is not None and view.robot.status == "lost",
    )
