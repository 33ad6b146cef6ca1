"""Exploring finds exactly what an independent, slow explorer finds action by action, and whatever random runs meet."""

from __future__ import annotations

import pytest

from rise_engine.author.explore.exploration import sessions_of
from rise_engine.author.explore.moves import cue_matters
from rise_engine.kernel import rules
from rise_engine.kernel.inputs import SessionStarted
from tests.author.explore.exploring import STUDIES as FAULTY
from tests.author.explore.exploring import all_projections, loaded, shipped
from tests.author.explore.naive import explore_naively
from tests.author.explore.projection import difference, project
from tests.author.explore.random_runs import random_run
from tests.author.explore.random_studies import random_study
from tests.author.explore.world import World
from tests.chance import SEARCH, seeds

STUDIES, RUNS, INPUTS = 6, 4, 50
"""How many random studies are explored, with how many random runs each, of how many inputs."""
NAIVE_STUDIES = 6
MAX_SITUATIONS = 700
"""What the naive explorer is asked to look at, at most: it is slow."""
RELEASES = ("leave", "enter")
SMALL = [
    ("quiz", World(by_hand=False, line=0, beside=0, faults=1, stop=True, robot=True, releases=RELEASES)),
    ("lab_opening", World(by_hand=False, line=0, beside=0)),
]
LARGE = [
    ("lab_opening", World(by_hand=False, line=0, beside=1, faults=1)),
    ("greeting", World(by_hand=False, line=0, beside=1)),
    ("lablinking", World(by_hand=False, line=1, beside=1, faults=1)),
    ("lab_opening", World(by_hand=False, line=0, beside=0, faults=1, stop=True, robot=True, releases=RELEASES)),
]
"""Which take long: only in a search."""


@pytest.fixture(autouse=True)
def runaways_are_stopped_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Random studies go round in circles now and then; that need not take a thousand steps each time."""
    monkeypatch.setattr(rules, "STEP_LIMIT", 60)
    monkeypatch.setattr(rules, "MAX_VAIN_SEARCHES", 5)


def random_world(seed: int, *, has_cue: bool) -> World:
    return World(beside=1, faults=1, stop=seed % 3 == 0, robot=seed % 4 == 0, releases=RELEASES, cues=has_cue)


@pytest.mark.search
@pytest.mark.slow
@pytest.mark.parametrize(("name", "world"), [*SMALL, *(LARGE if SEARCH else [])])
def test_studies_have_the_same_situations(name: str, world: World) -> None:
    scenario = loaded(FAULTY / name) if name == "quiz" else shipped(name)
    begun = sessions_of(scenario)[0]
    found = all_projections(scenario, world, begun, in_order=True)
    assert found is not None
    projections, keys = found
    naive = explore_naively(scenario, keys=keys, timers="order", world=world, start=begun)
    assert naive.complete
    assert projections == naive.states, difference(projections, naive.states)


@pytest.mark.search
@pytest.mark.slow
def test_random_studies_have_no_situation_less_and_hardly_one_more() -> None:
    compared, studies = 0, seeds(NAIVE_STUDIES)
    for seed in studies:
        study = random_study(seed)
        world = World(beside=1, faults=1, stop=seed % 3 == 0, releases=RELEASES, cues=cue_matters(study.scenario))
        found = all_projections(study.scenario, world, SessionStarted(), in_order=True)
        if found is None:
            continue
        projections, keys = found
        naive = explore_naively(study.scenario, keys=keys, timers="order", world=world, max_states=MAX_SITUATIONS)
        if naive.complete:
            compared += 1
            assert projections == naive.states, f"study {seed}: {difference(projections, naive.states)}"
    assert SEARCH or compared > len(studies) // 3


@pytest.mark.search
@pytest.mark.slow
def test_random_runs_meet_nothing_that_exploring_has_not_found() -> None:
    """Also with clocks, which leave out what cannot come in time."""
    explored, studies = 0, seeds(STUDIES)
    for seed in studies:
        study = random_study(seed, speaking=True)
        world = random_world(seed, has_cue=cue_matters(study.scenario))
        found = all_projections(study.scenario, world, SessionStarted(), in_order=False)
        if found is None:
            continue
        explored += 1
        projections, keys = found
        for run in range(RUNS):
            for kernel in random_run(study.scenario, run, INPUTS, world=world):
                met = project(kernel, keys, in_order=False)
                assert met in projections, f"study {seed}, run {run}: {met}"
    assert SEARCH or explored > len(studies) // 2
