"""What the present states of the running rules wait for: the acts, rules and events that are due. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from rise_engine.author.drawing.conditions import is_met
from rise_engine.author.drawing.rule_text import ENDINGS, parse_rule_result
from rise_engine.author.drawing.study_keys import StudyKeys, transitions_of


class ExpectedInputs(NamedTuple):
    """What a wizard would be right to start now."""

    acts: frozenset[str] = frozenset()
    rules: frozenset[str] = frozenset()
    events: frozenset[str] = frozenset()
    """Topics without their slash, those of acts and rules among them."""


def find_expected_inputs(
    keys: StudyKeys, states: Mapping[str, str | None], memory: Mapping[str, Any]
) -> ExpectedInputs:
    """`states`: the running rules with the state in which each is. `memory`: the working memory.

    A transition whose condition does not hold now waits for nothing: its event would be lost.
    """
    scenario = keys.scenario
    events = frozenset(
        transition.event
        for name, state in states.items()
        for transition in transitions_of(scenario, name, state)
        if transition.event is not None and is_met(transition.condition, memory)
    )
    acts = {name for name in scenario.acts if any(name + ending in events for ending in ENDINGS)}
    rules = {
        name
        for name in scenario.rules
        if name not in states and (f"{name}_end" in events or keys.events_of_rule[name] & events)
    }
    rules |= {result[0] for event in events if (result := parse_rule_result(scenario, event)) is not None}
    rules -= states.keys()
    return ExpectedInputs(frozenset(acts), frozenset(rules), events)
