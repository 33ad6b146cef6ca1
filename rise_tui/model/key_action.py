"""The request of a key, a click or Enter on a row, and what the rules wait for. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from msgspec import Struct
from msgspec.structs import replace

from rise_engine.author.drawing.conditions import is_met
from rise_engine.author.drawing.rule_text import ENDINGS, parse_rule_result
from rise_engine.author.drawing.study_keys import ACT, StudyKeys, transitions_of
from rise_engine.scenario.model import KeyBinding, Scenario

HELD_KEY_SECONDS = 0.15
"""Seconds. The same key sooner than this is a held key, not a second press."""


class KeyAction(Struct, frozen=True):
    """A task for the engine, and the protection that its key needs."""

    function: str
    behavior: str
    debounce: float = 0.5
    """Seconds in which a second press counts as the same press."""
    hold: bool = False
    """Whether it needs a second press, or Enter (console.md 2.4)."""
    calling_type: str = ""


MARK_CUE = KeyAction("markCue", "")
UNDO_CUE = KeyAction("undoCue", "")
NEXT_FILLER = KeyAction("nextFiller", "")


def start_action(scenario: Scenario, function: str, behavior: str, calling_type: str = "") -> KeyAction:
    """A start with the scenario's settings. Only an act can need two presses."""
    settings = scenario.settings_of(behavior)
    return KeyAction(function, behavior, settings.debounce, function == ACT and settings.hold, calling_type)


def action_of_key(scenario: Scenario, key: KeyBinding) -> KeyAction:
    """The request of a scenario's key."""
    action = start_action(scenario, key.function, key.behavior)
    return replace(action, behavior=key.task_behavior)


class ExpectedInputs(NamedTuple):
    """What a wizard can usefully start now."""

    acts: frozenset[str] = frozenset()
    rules: frozenset[str] = frozenset()
    events: frozenset[str] = frozenset()
    """Topics without their slash, including those of acts and rules."""


def find_expected_inputs(
    keys: StudyKeys, states: Mapping[str, str | None], memory: Mapping[str, Any]
) -> ExpectedInputs:
    """Find what the rules wait for. `states`: the state of each running rule. `memory`: the working memory.

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
