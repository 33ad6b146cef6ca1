"""Who takes part, and in which condition."""

from __future__ import annotations

from pathlib import Path

import pytest
from msgspec.structs import replace

from rise_engine.scenario import load
from rise_engine.scenario.study import condition_problem, conditions

GREETING = Path(__file__).parents[2] / "scenarios" / "greeting"


@pytest.mark.parametrize(
    ("study", "condition", "problem"),
    [
        ({}, "", ""),
        ({}, "anything", ""),
        ({"conditions": "A"}, "anything", ""),
        ({"conditions": ["A", "B"]}, "", ""),
        ({"conditions": ["A", "B"]}, "B", ""),
        ({"conditions": ["hesitation", "no hesitation"]}, "hesitaton", "did you mean `hesitation`?"),
        ({"conditions": ["A", "B"]}, "C", "it has `A`, `B`"),
        ({"conditions": ["A", 2]}, "2", "it has `A`"),
    ],
)
def test_a_condition_is_one_of_the_study_s(study: dict[str, object], condition: str, problem: str) -> None:
    scenario = load(GREETING).scenario
    assert scenario is not None
    scenario = replace(scenario, study=study)
    found = condition_problem(scenario, condition)
    assert problem in found and bool(problem) == bool(found)
    assert all(isinstance(one, str) for one in conditions(scenario))
