"""Faults that an exploration of all ways through the shipped studies has found, each played: they are gone."""

from __future__ import annotations

from functools import cache
from itertools import pairwise

import pytest

from rise_engine.kernel.records import TaskRecord
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Scenario
from tests.kernel.harness import Session
from tests.scenarios.played import SCENARIOS

OWN_STEPS = [
    ("Welcome", "R_Welcome"),
    *(
        (f"Task {n}, {step}", f"R_Task{n}_{act}")
        for n in range(1, 5)
        for step, act in (("introduction", "Intro"), *((f"step {k}", f"Step{k}") for k in range(1, 5)))
    ),
    ("Goodbye", "R_Goodbye"),
]
"""LabLinking's speaking states, in their order, each with the act that it starts."""


@cache
def study(name: str) -> Scenario:
    scenario = load(SCENARIOS / name).scenario
    assert scenario is not None
    return scenario


def begin(name: str, rule: str) -> Session:
    session = Session(study(name))
    session.rule(rule)
    return session


def confirm_cancels(session: Session) -> None:
    """The robot has stopped what it was told to stop."""
    for goal in list(session.cancels):
        if goal in session.goals:
            session.report(goal, "canceled")
    session.cancels.clear()


def unfinished(session: Session, act: str) -> int:
    """How many of an act run or wait."""
    last = {each.id: each.status for each in session.records if isinstance(each, TaskRecord) and each.behavior == act}
    return sum(status in ("PENDING", "ACTIVE", "CANCELING") for status in last.values())


def act_of(session: Session, goal: str) -> str:
    """The act that an action of the robot belongs to."""
    task = int(goal.split("/")[0])
    return next(each.behavior for each in session.records if isinstance(each, TaskRecord) and each.id == task)


def acts_of(session: Session) -> set[str]:
    """The acts of which the robot does something."""
    return {act_of(session, goal) for goal in session.goals}


def end_of(session: Session, act: str, status: str = "succeeded") -> None:
    """The robot does all of an act, or its first action fails."""
    while goals := [goal for goal in session.goals if act_of(session, goal) == act]:
        session.report(goals[0], status)
        session.wait(3)
        confirm_cancels(session)
        if status == "failed":
            session.wait(3)  # where it is repeated, after a pause


# --- greeting --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("robot", ["at once", "slowly"])
@pytest.mark.parametrize("hello", [False, True])
def test_a_person_detector_that_flickers_queues_nothing(robot: str, hello: bool) -> None:
    session = begin("greeting", "Greeting")
    for _ in range(50):
        session.assign("person_near = true")
        if hello:
            session.event("/H_greets")
        session.assign("person_near = false")
        if robot == "at once":
            confirm_cancels(session)
        assert unfinished(session, "R_Notice") <= 2, "one that is being stopped, and the next"
        session.wait(0.02)
    session.assign("person_near = true")
    confirm_cancels(session)
    session.event("/H_greets")
    confirm_cancels(session)
    assert "R_Greeting" in acts_of(session), "nothing stands before the greeting"


def test_a_greeting_that_failed_is_not_taken_for_one() -> None:
    session = begin("greeting", "Greeting")
    session.assign("person_near = true")
    end_of(session, "R_Notice")
    session.event("/H_greets")
    end_of(session, "R_Greeting", "failed")
    assert session.states["Greeting"] == "Visitor is here" and session.memory["person_greeted"] is False
    session.event("/H_greets")
    assert session.states["Greeting"] == "Greet", "the next hello is answered with a greeting, not with a nod"
    end_of(session, "R_Greeting")
    assert session.states["Greeting"] == "Introduce" and session.memory["person_greeted"] is True


def test_who_has_left_is_forgotten_in_one_step() -> None:
    """A state of its own for that had a transition that could never be taken."""
    session = begin("greeting", "Greeting")
    session.assign("person_name = 'Anna'")
    for value in ("true", "false"):
        session.assign(f"person_near = {value}")
    session.wait(10.1)
    assert session.states["Greeting"] == "Nobody" and session.memory["person_name"] is None
    session.assign("person_near = true")
    assert session.states["Greeting"] == "Visitor comes"


def test_the_end_of_the_first_sign_is_not_that_of_the_second() -> None:
    session = begin("greeting", "Greeting")
    for value in ("true", "false", "true"):
        session.assign(f"person_near = {value}")
    confirm_cancels(session)
    assert session.states["Greeting"] == "Visitor comes", "the second one is still to be shown"
    end_of(session, "R_Notice")
    assert session.states["Greeting"] == "Visitor is here"


# --- lab_opening -----------------------------------------------------------------------------------------------------


def in_conversation() -> Session:
    session = begin("lab_opening", "Opening")
    session.event("/gaze/robot")
    end_of(session, "R_Welcome")
    end_of(session, "R_Introduction")
    assert session.states == {"Opening": "Conversation", "Conversation": "Listening"}
    return session


def moving_the_head(session: Session) -> set[str]:
    actions = session.scenario.robot.actions
    return {act_of(session, goal) for goal, start in session.goals.items() if "gaze" in actions[start.type].channels}


@pytest.mark.parametrize("leaves", ["/gaze/nothing", "/H_goodbye"])
def test_thinking_and_the_default_pose_do_not_move_the_head_at_once(leaves: str) -> None:
    session = in_conversation()
    session.event("/H_question")
    assert "R_Thinking" in acts_of(session)
    session.event(leaves)
    for _ in range(20):
        assert len(moving_the_head(session)) <= 1, session.goals
        confirm_cancels(session)
        for goal in list(session.goals)[:1]:
            session.report(goal)
        session.wait(1)
    assert session.states == {"Opening": "Nobody"}


@pytest.mark.parametrize(("asks", "act"), [("/H_kitchen", "R_Kitchen"), ("/H_studio", "R_Studio")])
def test_nobody_is_told_of_a_room_and_the_next_guest_is_noticed(asks: str, act: str) -> None:
    session = in_conversation()
    session.event(asks)
    session.event("/gaze/nothing")
    assert session.cancels, "it stops"
    assert session.states == {"Opening": "Default pose"}
    session.event("/gaze/robot")
    confirm_cancels(session)
    assert session.states == {"Opening": "Welcome"}
    assert unfinished(session, act) == 0
    end_of(session, "R_Welcome")
    end_of(session, "R_Introduction")
    assert session.states == {"Opening": "Conversation", "Conversation": "Listening"}


def test_a_room_that_could_not_be_told_is_a_question_without_answer() -> None:
    session = in_conversation()
    session.event("/H_kitchen")
    end_of(session, "R_Kitchen", "failed")
    assert session.states["Conversation"] == "No answer" and session.memory["questions_without_answer"] == 1


# --- lablinking ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("task", ["2.5", "'two'", "0", "5", "null", "''"])
def test_any_task_leads_out_of_the_start(task: str) -> None:
    session = Session(study("lablinking"))
    session.assign(f"task = {task}")
    session.rule("Table setting")
    assert session.states == {"Table setting": "Welcome"}


@pytest.mark.parametrize("task", [1, 2, 3, 4])
def test_after_a_stop_the_task_goes_on(task: int) -> None:
    session = Session(study("lablinking"))
    session.assign(f"task = {task}")
    session.rule("Table setting")
    assert session.states == {"Table setting": f"Task {task}, introduction"}


def test_every_speaking_state_waits_for_its_own_act() -> None:
    """An act that the wizard has started by hand ends first: the rule does not go on before its own has ended."""
    session = Session(study("lablinking"))
    for number, (state, act) in enumerate(OWN_STEPS):
        session.act(act)
        if number:
            session.event("/next")
        else:
            session.rule("Table setting")
        assert session.states == {"Table setting": state}
        end_first(session, act)
        assert session.states == {"Table setting": state}, "that was the other one"
        end_of(session, act)
        assert session.states.get("Table setting") != state
    assert session.states == {} and session.memory["study_finished"] is True


def end_first(session: Session, act: str) -> None:
    """The robot does all of the first of several acts of one name."""
    tasks = [each.id for each in session.records if isinstance(each, TaskRecord) and each.behavior == act]
    first = min(id for id in tasks if any(goal.startswith(f"{id}/") for goal in session.goals))
    while goals := [goal for goal in session.goals if goal.startswith(f"{first}/")]:
        session.report(goals[0])
        session.wait(3)


def test_what_was_not_said_is_said_again_or_left_out_on_purpose() -> None:
    """It does not count as said: the wizard is asked, and `next` does not walk through the study meanwhile."""
    session = Session(study("lablinking"))
    session.rule("Table setting")
    for (state, act), (_, next_act) in pairwise([*OWN_STEPS, ("Finished", "")]):
        for again in ("repeatAct", "goOn"):
            end_of(session, act, "failed")
            session.event("/next")
            assert session.states == {"Table setting": state}, "nothing goes on by itself"
            session.submit(again, act if again == "repeatAct" else str(last_task(session, act)))
        if next_act:
            session.event("/next")
            assert next_act in acts_of(session)
    assert session.states == {} and session.memory["study_finished"] is True


@pytest.mark.parametrize("end", ["lost", "canceled by an emergency stop"])
def test_the_gaze_goes_on_when_the_robot_is_back_and_not_after_an_emergency_stop(end: str) -> None:
    session = begin("greeting", "Gaze")
    session.assign("person_near = true")
    if end == "lost":
        session.robot("lost")
        session.wait(60)
        session.robot("connected")
    else:
        session.report(next(iter(session.goals)), "canceled")
    session.wait(60)
    assert [act_of(session, goal) for goal in session.goals] == (["R_FollowGaze"] if end == "lost" else [])
    if end != "lost":
        session.submit("repeatAct", "R_FollowGaze")
    for _ in range(3):
        session.report(next(iter(session.goals)))
        assert [act_of(session, goal) for goal in session.goals] == ["R_FollowGaze"]


def last_task(session: Session, act: str) -> int:
    return max(each.id for each in session.records if isinstance(each, TaskRecord) and each.behavior == act
               and each.function == "startCommunicationRobotAct")  # fmt: skip
