"""The faults are in the studies that exploring is to find them in."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest

from rise_engine.kernel.inputs import Submit
from rise_engine.kernel.records import EventRecord, TaskRecord
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from tests.author.explore.naive import explore_naively
from tests.author.explore.world import World
from tests.kernel.harness import Session

STUDIES = Path(__file__).parent / "studies"


@cache
def study(name: str) -> Scenario:
    scenario = load(STUDIES / name).scenario
    assert scenario is not None
    return scenario


def begin(name: str, presses: str = "") -> Session:
    session = Session(study(name))
    press(session, presses)
    return session


def press(session: Session, keys: Iterable[str]) -> None:
    """Press keys of the study, one after the other."""
    for key in keys:
        binding = session.scenario.keys[key]
        session.do(Submit(function=binding.function, behavior=binding.task_behavior, source="wizard:w"))


def end(session: Session, act: str, status: str) -> None:
    """The robot does all of an act, or its first action fails and the others are stopped."""
    for _ in range(100):
        if act not in {run.task.behavior for run in session.kernel.scheduler.runner.runs.values()}:
            return
        goal = next(goal for goal in session.goals if act_of(session, goal) == act)
        session.report(goal, "canceled" if goal in session.cancels else status)
        session.wait(3)
    raise AssertionError(f"{act} does not end")


def act_of(session: Session, goal: str) -> str:
    runs = session.kernel.scheduler.runner.runs
    return runs[int(goal.split("/")[0])].task.behavior


def play_acts(session: Session) -> None:
    """The robot does all that it is asked for, and what comes of that."""
    for _ in range(100):
        if not session.goals:
            return
        session.report(next(iter(session.goals)))
        session.wait(0.5)
    raise AssertionError("the robot is never done")


def running(session: Session) -> set[str]:
    """The acts that run, and are not being stopped."""
    runs = session.kernel.scheduler.runner.runs.values()
    return {run.task.behavior for run in runs if run.cancel_reason is None and run.failure is None}


def unfinished(session: Session, act: str) -> int:
    """How many of an act run or wait."""
    last = {each.id: each.status for each in session.records if isinstance(each, TaskRecord) and each.behavior == act}
    return sum(status in ("PENDING", "ACTIVE") for status in last.values())


def taker(session: Session, topic: str) -> str | None:
    """The rule that has taken the last event of a topic."""
    events = [each for each in session.records if isinstance(each, EventRecord) and each.topic == topic]
    return events[-1].taken_by


# --- as they were shipped ---


def test_the_line_grows() -> None:
    session = begin("greeting", "b" + "aw" * 20)
    assert unfinished(session, "R_Notice") == 20


def test_a_visitor_is_never_greeted_after_one_failure() -> None:
    session = begin("greeting", "ba")
    end(session, "R_Notice", "succeeded")
    press(session, "h")
    end(session, "R_Greeting", "failed")
    assert session.states["Greeting"] == "Visitor is here"
    for _ in range(5):
        session.wait(20)
        press(session, "h")
        assert not {"R_Greeting", "R_Introduction"} & running(session)


def test_two_acts_move_the_head_at_once() -> None:
    session = begin("lab_opening", "og")
    play_acts(session)
    press(session, "qw")
    assert running(session) == {"R_Thinking", "R_LookAhead"}
    acts = study("lab_opening").acts
    assert acts["R_Thinking"].channels & acts["R_LookAhead"].channels == {"gaze"}


def test_a_guest_is_not_noticed() -> None:
    session = begin("lab_opening", "og")
    play_acts(session)
    press(session, "kwg")
    assert taker(session, "/gaze/robot") is None
    play_acts(session)
    assert session.states["Opening"] == "Nobody"


@pytest.mark.parametrize("task", ["2.5", "'two'"])
def test_a_value_leads_to_a_dead_end(task: str) -> None:
    session = begin("lablinking")
    session.assign(f"task = {task}")
    press(session, "t")
    for key in study("lablinking").keys:
        press(session, [key])
        play_acts(session)
    assert session.states["Table setting"] == "Start"


# --- with faults of our own ---


def test_the_quiz_has_no_way_out_for_a_value() -> None:
    session = begin("quiz", "b")
    play_acts(session)
    press(session, "knhbx")
    session.wait(1000)
    assert not session.goals and session.states["Quiz"] == "Judge"


@pytest.mark.slow
def test_a_key_of_the_quiz_does_nothing() -> None:
    found = explore_naively(study("quiz"), keys=("answer", "question"), world=World(by_hand=False, beside=1, faults=1))
    assert found.complete
    states = {rule.state for each in found.states for rule in each.rules}
    assert "Ready" in states and not states & {"Hint", "Hinted"}


def test_a_rule_of_the_quiz_waits_for_ever() -> None:
    session = begin("quiz", "b")
    play_acts(session)
    press(session, "r")
    assert session.states == {"Quiz": "Praised", "Praise": "Praise"}
    press(session, "n")
    for goal in session.cancels:
        session.report(goal, "canceled")
    session.wait(1000)
    assert not session.goals and session.states == {"Quiz": "Praised", "Praise": "Praise"}
    press(session, "xb")
    play_acts(session)
    press(session, "r")
    assert session.states["Quiz"] == "Praised" and not running(session), "it cannot be started any more"
