"""scenarios/negation: what the robot does, in order, while its scripted session runs (paper, section 5.2.2)."""

from __future__ import annotations

import csv

import pytest

from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import TaskRecord
from rise_engine.scenario.loader import load
from tests.kernel.harness import Session
from tests.scenarios.conftest import Play
from tests.scenarios.played import SCENARIOS

with (SCENARIOS / "negation" / "tables" / "instructions.csv").open(encoding="utf-8", newline="") as table:
    ROWS = list(csv.DictReader(table))


def begun() -> Session:
    """A session in which the robot has said the first instruction."""
    scenario = load(SCENARIOS / "negation").scenario
    assert scenario is not None
    session = Session(scenario)
    session.rule("Instructions")
    session.finish_all()
    assert session.states == {"Instructions": "Wait"}
    return session


def test_the_states_of_the_rule(play: Play) -> None:
    session = play("negation")
    session.check_sound()
    said = ("Instruct", "Wait")
    right = (*said, "Praise", "Next")
    assert session.states("Instructions") == [
        *("Start", "Welcome"),
        *right,
        *(*said, "Correct", *right),
        *(*said, "Apologise", *right),
        *(*said, "Prompt", "Wait", "Prompt", "Praise", "Next"),
        *right,
        *(*right, "Break", "Pause", "Go on"),
        *(right * 6),
        *("Goodbye", "Finished"),
    ]
    assert (session.values("mistakes")[-1], session.values("repairs")[-1], session.values("prompts")[-1]) == (1, 1, 2)
    assert session.values("study_finished")[-1] is True


@pytest.mark.parametrize(("condition", "column"), [("negation", "negation"), ("no negation", "plain")])
def test_each_instruction_is_said_in_the_words_of_the_condition(play: Play, condition: str, column: str) -> None:
    session = play("negation", "--condition", condition)
    said = [
        record["parameters"]["message"]
        for record in session.of("action", act="R_Instruct", type="Speech", status="started")
    ]
    order = session.values("order")[-1]
    assert sorted(order) == list(range(12)) and order != sorted(order)
    assert list(dict.fromkeys(said)) == [ROWS[row][column] for row in order]
    assert len(said) == 14, "the second and the third twice"


def test_another_seed_is_another_order(play: Play) -> None:
    assert play("negation").values("order")[-1] != play("negation", "--seed", "2").values("order")[-1]


def test_a_key_that_is_pressed_early_counts_when_the_robot_has_finished() -> None:
    session = begun()
    session.event("/done")
    assert session.states == {"Instructions": "Praise"}
    session.do(Submit(function="raiseEventTopic", behavior='{"event": "/done", "keep": "3s"}', source="wizard:w"))
    while session.memory["i"] < 2:
        session.report(next(iter(session.goals)))
    assert session.states == {"Instructions": "Instruct"}, "it counted for the second one, once that was said"


def test_silence_is_not_counted_while_it_is_the_robots_turn() -> None:
    session = begun()
    session.wait(11)
    session.submit("markCue")
    session.wait(30)
    assert session.states == {"Instructions": "Wait"}


def test_what_could_not_be_said_waits_for_a_decision() -> None:
    session = begun()
    session.event("/done")
    while session.states == {"Instructions": "Praise"}:
        session.report(next(iter(session.goals)))
    for _ in range(2):  # once more by itself
        for goal in list(session.goals):
            session.report(goal, "failed")
        session.wait(2)
    assert session.states == {"Instructions": "Not said"}
    session.event("/done")
    assert session.states == {"Instructions": "Not said"}, "nobody has heard it"
    session.event("/skip")
    assert session.states == {"Instructions": "Instruct"} and session.memory["i"] == 2


@pytest.mark.parametrize("number", range(1, 13))
def test_an_instruction_by_hand_does_not_move_the_rule_on(number: int) -> None:
    session = begun()
    for _ in range(number - 1):
        session.event("/skip" if session.states == {"Instructions": "Wait"} else "/go_on")
        session.finish_all()
        if session.states == {"Instructions": "Pause"}:
            session.event("/go_on")
            session.finish_all()
    session.act("R_Instruct")
    session.event("/not_understood")
    hand = max(each.id for each in session.records if isinstance(each, TaskRecord) and each.source == "wizard:w"
               and each.behavior == "R_Instruct")  # fmt: skip
    while goals := [goal for goal in session.goals if goal.startswith(f"{hand}/")]:
        session.report(goals[0])
    assert session.states == {"Instructions": "Apologise"}
