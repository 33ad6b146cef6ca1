"""What a session begins with, and why one cannot begin: its memory is what its condition says."""

from __future__ import annotations

import pytest
from msgspec.structs import replace

from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.run.protocol.session_options import SessionOptions
from rise_engine.run.protocol.session_start import first_input, set_conflicts, start_problems, start_remarks
from rise_engine.scenario.loader import load
from rise_engine.scenario.model import Condition, Scenario

CONDITIONS = {
    "calm": Condition({"voice": "low", "form": {"kind": "short"}}),
    "loud": Condition({"voice": "high", "gaze": True}),
    "light": Condition(label_only=True),
}


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    found = load("scenarios/greeting").scenario
    assert found is not None
    return replace(found, conditions=CONDITIONS)


def assigning(*behaviors: str, condition: str = "calm") -> SessionOptions:
    tasks = tuple(Submit(function="assignValue", behavior=behavior) for behavior in behaviors)
    return SessionOptions("x", condition=condition, first_tasks=tasks)


def test_the_first_input_has_what_the_condition_sets(scenario: Scenario) -> None:
    started = first_input(scenario, SessionOptions("x", participant="P07", condition="calm"))
    assert started == SessionStarted(participant="P07", condition="calm", memory=CONDITIONS["calm"].memory)
    assert first_input(scenario, SessionOptions("x", condition="light")) == SessionStarted(condition="light")
    assert first_input(scenario, SessionOptions("x")) == SessionStarted()


@pytest.mark.parametrize("condition", ["", "calm", "loud", "light"])
def test_what_can_begin(scenario: Scenario, condition: str) -> None:
    assert start_problems(scenario, SessionOptions("x", condition=condition)) == []


def test_a_name_that_is_none_cannot(scenario: Scenario) -> None:
    problems = start_problems(scenario, SessionOptions("x", condition="clam"))
    assert len(problems) == 1 and "did you mean `calm`?" in problems[0]


def test_a_real_session_without_a_condition_cannot(scenario: Scenario) -> None:
    real = replace(scenario, mode="real")
    assert "name one of `calm`, `loud`, `light`" in start_problems(real, SessionOptions("x"))[0]
    assert start_problems(real, SessionOptions("x", condition="light")) == []


@pytest.mark.parametrize(
    ("behavior", "problem"),
    [
        ('{"voice": "low"}', "`voice` cannot be set together with the condition `calm`, which sets it"),
        ('{"form.kind": "long"}', "`form.kind` cannot be set together with the condition `calm`, which sets"),
        ("form.kind = 3", "`form.kind` cannot be set"),
        (
            "gaze = true",
            "`gaze` cannot be set together with the condition `calm`: it defines the condition `loud`",
        ),
    ],
)
def test_what_makes_a_condition_cannot_be_set_beside_it(scenario: Scenario, behavior: str, problem: str) -> None:
    found = start_problems(scenario, assigning("other = 3", behavior))
    assert len(found) == 1 and problem in found[0]


def test_every_conflict_is_said(scenario: Scenario) -> None:
    assert len(start_problems(scenario, assigning('{"voice": 1, "gaze": 2, "other": 3}', "form = 3"))) == 3


@pytest.mark.parametrize(
    "options",
    [
        assigning("other = 3"),
        assigning("voice = ", "(("),
        assigning("voice = 'high'", condition=""),
        SessionOptions("x", condition="calm", first_tasks=(Submit(function="say", behavior="voice = 3"),)),
    ],
    ids=["another key", "unreadable", "no condition", "no assignment"],
)
def test_everything_else_can_be_set(scenario: Scenario, options: SessionOptions) -> None:
    """In debug mode without a condition anything can be tried out; what cannot be read its own task says."""
    assert start_problems(scenario, options) == []


@pytest.mark.parametrize(
    ("started", "pieces"),
    [
        (
            SessionStarted(),
            ["session.factors.gaze`", "session.factors.pace`, which has no value: this session is not"],
        ),
        (
            SessionStarted(study="tea", factors={"pase": "slow", "gaze": "far"}),
            ["`session.factors.pace`, which has no value: the study has no such factor; did you mean `pase`?"],
        ),
        (SessionStarted(study="tea", factors={"pace": "slow", "gaze": "far"}), []),
    ],
)
def test_a_factor_that_has_no_value_is_told(started: SessionStarted, pieces: list[str]) -> None:
    scenario = load("scenarios/greeting").scenario
    assert scenario is not None and start_remarks(scenario, started) == []
    remarks = start_remarks(replace(scenario, factors_read=frozenset({"pace", "gaze"})), started)
    assert [piece in remark for piece, remark in zip(pieces, remarks, strict=True)] == [True] * len(pieces)


def test_what_the_plan_of_a_study_sets_cannot_be_set_beside_it(scenario: Scenario) -> None:
    """There the scenario's own conditions say nothing."""
    started = SessionStarted(study="tea", condition="slow+far", memory={"pace": 3})
    found = set_conflicts(scenario, started, assigning("pace = 4", "voice = 'high'").first_tasks)
    assert found == ["`pace` cannot be set together with the condition `slow+far`, which sets it"]
    assert set_conflicts(scenario, SessionStarted(study="tea"), assigning("pace = 4").first_tasks) == []
