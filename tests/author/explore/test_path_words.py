"""Ways through a study, in sentences."""

from __future__ import annotations

from functools import cache

import pytest
from msgspec.structs import replace

from rise_engine.author.explore.exploration import main_rule, sessions_of
from rise_engine.author.explore.moves import Bounds, Move
from rise_engine.author.explore.path_words import describe_path
from rise_engine.author.explore.situation_graph import Path, Paths, PathStep
from rise_engine.author.explore.space import Space
from rise_engine.author.explore.stepper import Fact, Stepper
from rise_engine.base.errors import RiseError
from tests.author.explore.exploring import shipped
from tests.author.explore.paths import bounds_for, paths_of
from tests.chance import searched


@cache
def told(name: str, faults: int, fact: Fact) -> list[str]:
    return describe_path(shipped(name), paths_of(name, faults)[fact], bounds_for(name, faults))


def test_what_the_wizard_does_and_what_the_rules_and_acts_do_then() -> None:
    sentences = told("greeting", 0, ("state", "Greeting", "Introduce"))
    assert sentences == [
        "the wizard presses b (begin) → Greeting begins in Start, at once to Nobody, Gaze begins in Nobody, "
        "Listening begins in Listening",
        "the wizard presses a (comes near) → Greeting goes on to Visitor comes, Gaze goes on to Following, "
        "R_Notice begins, R_FollowGaze begins",
        "the wizard presses h (says hello) → Listening goes on to Spotting, at once to Listening, "
        "Greeting goes on to Greet, R_Notice is cut off, R_Greeting has to wait",
        "the robot has stopped doing R_Notice → R_Greeting begins",
        "R_Greeting ends → Greeting goes on to Introduce, R_Introduction begins",
    ]


def test_time_that_passes_and_where() -> None:
    sentences = told("lab_opening", 0, ("state", "Conversation", "No answer"))
    assert sentences[-1].startswith("15 s pass in Thinking → Conversation goes on to No answer")


def test_an_act_that_fails_and_what_becomes_of_it() -> None:
    paths = paths_of("lablinking", 1)
    fact = next(fact for fact in paths if fact[0].startswith("failure"))
    sentences = told("lablinking", 1, fact)
    assert sentences[-1].startswith(f"{fact[1]} fails") or any("cannot be reached" in each for each in sentences)
    assert "→ somebody is asked what to do" in sentences[-1]


def test_a_stop_and_a_lost_robot() -> None:
    everything = [told("lablinking", 1, fact) for fact in paths_of("lablinking", 1)]
    stops = [each for way in everything for each in way if each.startswith("somebody stops everything")]
    assert any("Table setting is stopped in" in each for each in stops)
    assert any(each.startswith("the robot cannot be reached any more") for way in everything for each in way)


def test_chance_is_said_where_it_decides() -> None:
    sentences = [each for fact in paths_of("greeting", 0) for each in told("greeting", 0, fact)]
    by_chance = [each for each in sentences if "chance decides" in each]
    assert by_chance and all(each.startswith("the wizard presses") for each in by_chance)
    assert not any("chance" in each for each in sentences if "presses b (begin)" in each)


def test_values_that_are_tried() -> None:
    scenario = shipped("lablinking")
    bounds = Bounds(faults=0, line=0, stop=False, lost=False, tries={"task": (2.5, "two")})
    space = Space(Stepper(scenario, bounds, sessions_of(scenario), main_rule(scenario)))
    space.begin()
    number = space.beginnings[0]
    space.take(number, space.stepper.follow(space.situations[number], space.zones[number]))
    paths = Paths(space)
    sentences = {each for at in range(len(space.situations)) for each in describe_path(scenario, paths.to(at), bounds)}
    assert {"somebody sets task = 2.5", "somebody sets task = two"} <= sentences


@pytest.mark.parametrize("name", ["lablinking", pytest.param("lab_opening", marks=searched)])
def test_every_way_has_a_sentence_for_each_step(name: str) -> None:
    for fact, path in paths_of(name, 1).items():
        sentences = told(name, 1, fact)
        assert len(sentences) == len(path.steps)
        assert not any("\n" in each or each.endswith(".") or "→ ," in each for each in sentences)


def test_a_way_of_another_study_is_refused() -> None:
    path = paths_of("lab_opening", 0)["state", "Conversation", "No answer"]
    with pytest.raises(RiseError):
        describe_path(shipped("greeting"), path)
    wrong = Path(path.begun, path.beginning, (PathStep(Move("end", "R_Nod", 3, "succeeded"), path.end),))
    with pytest.raises(RiseError, match="step 1"):
        describe_path(shipped("lab_opening"), wrong)
    other = replace(path, steps=(replace(path.steps[0], situation=path.end), *path.steps[1:]))
    with pytest.raises(RiseError, match="step 1"):
        describe_path(shipped("lab_opening"), other)
