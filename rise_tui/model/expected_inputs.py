"""What the present states of the running rules wait for: the acts, rules and events that are due. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from rise_engine.scenario.model import Scenario
from rise_tui.model.conditions import holds
from rise_tui.model.rule_text import ENDINGS, events_raised_by
from rise_tui.model.study_keys import transitions_of


class ExpectedInputs(NamedTuple):
    """What a wizard would be right to start now."""

    acts: frozenset[str] = frozenset()
    rules: frozenset[str] = frozenset()
    events: frozenset[str] = frozenset()
    """Topics without their slash, those of acts and rules among them."""


class ExpectedInputFinder:
    """Knows of each rule of a scenario which events it raises."""

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._raised = {name: events_raised_by(rule) for name, rule in scenario.rules.items()}

    def find(self, states: Mapping[str, str | None], memory: Mapping[str, Any]) -> ExpectedInputs:
        """`states`: the running rules with the state in which each is. `memory`: the working memory.

        A transition whose condition does not hold now waits for nothing: its event would be lost.
        """
        events = frozenset(
            transition.event
            for name, state in states.items()
            for transition in transitions_of(self._scenario, name, state)
            if transition.event is not None and holds(transition.condition, memory)
        )
        acts = {name for name in self._scenario.acts if any(name + ending in events for ending in ENDINGS)}
        rules = {name for name, raised in self._raised.items() if name not in states and raised & events}
        rules |= {name for name in self._scenario.rules if name not in states and f"{name}_end" in events}
        return ExpectedInputs(frozenset(acts), frozenset(rules), events)
