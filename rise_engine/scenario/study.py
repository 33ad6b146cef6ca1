"""What a scenario says about its study: the conditions that a session can be run in (`[study]` in scenario.toml)."""

from __future__ import annotations

from rise_engine.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.model import Scenario


def study_conditions(scenario: Scenario) -> tuple[str, ...]:
    """The study's conditions, in its order; empty when it lists none."""
    found = scenario.study.get("conditions")
    return tuple(name for name in found if isinstance(name, str)) if isinstance(found, list) else ()


def condition_problem(scenario: Scenario, condition: str) -> str:
    """Why a session cannot be run in this condition, or empty. Any is right where the study lists none."""
    known = study_conditions(scenario)
    if not condition or not known or condition in known:
        return ""
    near = did_you_mean(condition, known, limit=0)
    return f"this study has no condition {condition!r}{near}; it has {in_backquotes(known)}"
