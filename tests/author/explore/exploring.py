"""What tests of exploring share: a scenario explored within bounds, and what its situations look like from outside."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

from rise_engine.author.explore.exploration import Exploration, explore, main_rule
from rise_engine.author.explore.moves import Bounds
from rise_engine.author.explore.situation_graph import ExploreFinding
from rise_engine.author.explore.space import Space
from rise_engine.author.explore.stepper import Stepper
from rise_engine.kernel.inputs import SessionStarted
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from tests.author.explore.projection import Projection, project
from tests.author.explore.world import World

ROOT = Path(__file__).parents[3]
STUDIES = Path(__file__).parent / "studies"


@cache
def shipped(name: str) -> Scenario:
    return loaded(ROOT / "scenarios" / name)


def loaded(folder: Path) -> Scenario:
    scenario = load(folder).scenario
    assert scenario is not None
    return scenario


@cache
def quickly_explored(folder: str, **bounds: Any) -> Exploration:
    """A study explored without stops and lost robots; `folder` is relative to that of the project."""
    return explore(loaded(ROOT / folder), Bounds(stop=False, lost=False, **bounds))


def of_kind(exploration: Exploration, kind: str) -> list[ExploreFinding]:
    return [finding for finding in exploration.findings if finding.kind == kind]


def bounds_of_world(world: World, scenario: Scenario, *, in_order: bool) -> Bounds:
    return Bounds(
        keys="all" if world.by_hand else "rules",
        merges_alike=False,
        line=world.line,
        beside=world.beside,
        asked=world.asked,
        kept=world.kept,
        faults=world.faults,
        stop=world.stop,
        lost=world.robot,
        pace=None if in_order else (0.5, 3.0),
        situations=4_000,
        follows_voice=scenario.reads_session,
    )


def all_projections(
    scenario: Scenario, world: World, begun: SessionStarted, *, in_order: bool
) -> tuple[set[Projection], tuple[str, ...]] | None:
    """What all situations look like from outside, and the memory keys that matter; null: there are too many."""
    stepper = Stepper(scenario, bounds_of_world(world, scenario, in_order=in_order), [begun], main_rule(scenario))
    space = Space(stepper)
    space.begin()
    space.explore()
    if not space.complete:
        return None
    keys = stepper.kernel.keys
    found = set()
    for situation in space.situations:
        stepper.kernel.put(situation)
        found.add(project(stepper.kernel.kernel, keys, in_order=in_order))
    return found, keys
