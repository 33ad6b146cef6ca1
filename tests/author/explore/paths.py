"""Ways through the shipped studies, for tests that tell and play them."""

from __future__ import annotations

from functools import cache

from rise_engine.author.explore.exploration import main_rule, sessions_of
from rise_engine.author.explore.moves import Bounds
from rise_engine.author.explore.situation_graph import Path, Paths
from rise_engine.author.explore.space import Space
from rise_engine.author.explore.stepper import Fact, Stepper
from tests.author.explore.exploring import shipped

TELLING = ("state", "ended", "cut off", "out of step", "two at once", "in line", "failure alike", "failure matters")


def bounds_for(name: str, faults: int) -> Bounds:
    """Small ones: what goes wrong is a failed act, and in studies that are small also a stop or a lost robot."""
    small = name in ("lablinking", "lab_opening")
    return Bounds(faults=faults, stop=small, lost=small, follows_voice=shipped(name).reads_session)


@cache
def space_of(name: str, faults: int) -> Space:
    scenario = shipped(name)
    space = Space(Stepper(scenario, bounds_for(name, faults), sessions_of(scenario), main_rule(scenario)))
    space.begin()
    space.explore()
    return space


@cache
def paths_of(name: str, faults: int, most: int = 60) -> dict[Fact, Path]:
    """The way to each thing that is worth telling, some situations, and the first over which the robot is back."""
    space = space_of(name, faults)
    paths = Paths(space)
    found = {fact: path for fact in space.facts if fact[0] in TELLING and (path := paths.to_fact(fact)) is not None}
    count = len(space.situations)
    for number in range(0, count, max(1, count // most)):
        found["situation", number] = paths.to(number)
    back = (target for number in range(count) for move, target, _ in space.steps_from(number) if move.kind == "back")
    over_it = (paths.to(number) for number in back)
    if over := next((path for path in over_it if any(step.move.kind == "back" for step in path.steps)), None):
        found["back",] = over
    return found
