"""The conditions of a scenario, and whether a session can be run in one (`[study]`, `[conditions.NAME]`)."""

from __future__ import annotations

import json

from rise_engine.base.nearest_name import did_you_mean, in_backquotes
from rise_engine.scenario.conditions import how_to_write
from rise_engine.scenario.model import Condition, Json, Scenario

_LONGEST_VALUE = 40
"""Characters of a value that a sentence shows."""


def study_conditions(scenario: Scenario) -> tuple[str, ...]:
    """The names of the conditions, in their order; empty when there are none. Also names that say nothing of what the
    robot does, as scenarios of earlier versions list them."""
    if scenario.conditions:
        return tuple(scenario.conditions)
    found = scenario.study.get("conditions")
    return tuple(name for name in found if isinstance(name, str)) if isinstance(found, list) else ()


def condition_problem(scenario: Scenario, condition: str) -> str:
    """Why a new session cannot be run in this condition, or empty.

    :param condition: its name; empty: in none, which is right in debug mode, and where the scenario has none.
    """
    known = study_conditions(scenario)
    if not condition:
        if scenario.conditions and scenario.mode == "real":
            return f"a real session is run in a condition of the study: name one of {in_backquotes(known)}"
        return ""
    if condition in scenario.conditions:
        return ""
    if condition in known:
        return f"the condition `{condition}` is only a name; in scenario.toml, {how_to_write(condition)}"
    if known:
        near = did_you_mean(condition, known, limit=0)
        return f"this study has no condition {condition!r}{near}; it has {in_backquotes(known)}"
    problem = f"this scenario has no conditions, and {condition!r} alone would change nothing that the robot does"
    return f"{problem}; in scenario.toml, {how_to_write(condition)}"


def condition_memory(scenario: Scenario, condition: str) -> dict[str, Json]:
    """What a session in this condition begins with, beside the start values; nothing for a name that is none."""
    found = scenario.conditions.get(condition)
    return {} if found is None else dict(found.memory)


def condition_label(scenario: Scenario, condition: str) -> str:
    """What screens call a condition: the label that it has, or its name."""
    found = scenario.conditions.get(condition)
    return (found.label if found is not None else "") or condition


def condition_sentence(condition: Condition) -> str:
    """What a condition sets, in words: `sets hesitation = true, pause = 600`."""
    if condition.label_only:
        return "sets nothing: what it stands for lies outside of the robot"
    values = ", ".join(f"{key} = {_value_text(value)}" for key, value in condition.memory.items())
    return f"sets {values}" if values else "sets nothing"


def _value_text(value: Json) -> str:
    text = json.dumps(value, ensure_ascii=False)
    return text if len(text) <= _LONGEST_VALUE else f"{text[: _LONGEST_VALUE - 1]}…"
