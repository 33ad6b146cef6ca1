"""What the robot and the rules would do at once if a rule entered a state, in words. Pure; knows no screen."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rise_engine.author.drawing.rule_text import functions_in
from rise_engine.kernel.behaviors import describe_behavior
from rise_engine.scenario.model import Function, Rule, Scenario, State, normal_topic
from rise_tui.model.failures import fill_known
from rise_tui.model.speech_actions import message_of
from rise_tui.rendering.text import shorten

_VERBS = {"stopCommunicationRobotAct": "stops", "stopInteractionRule": "stops the rule", "assignValue": "sets"}
NOTHING = "does nothing but wait"
ENDS = "ends the rule"


def entry_lines(scenario: Scenario, state: State, memory: Mapping[str, Any], width: int, most: int = 6) -> list[str]:
    """What `onEntry` would do, a line for each function, of at most `width` cells; of more than `most`, a count."""
    lines = [
        ("perhaps " if not sure else "") + _function_text(scenario, function, memory)
        for function, sure in functions_in(state.on_entry)
    ]
    lines += [] if state.transitions else [ENDS]
    if len(lines) > most:
        lines = [*lines[: most - 1], f"and {len(lines) - most + 1} more"]
    return [shorten(line, width) for line in lines] or [NOTHING]


def entry_summary(scenario: Scenario, rule: Rule, state: str, memory: Mapping[str, Any]) -> str:
    """The first thing that the robot would say or do, and how many others there are."""
    lines = entry_lines(scenario, rule.states[state], memory, 10_000, 10_000)
    spoken = next((line for line in lines if "“" in line), lines[0])
    return spoken if len(lines) == 1 else f"{spoken}, and {len(lines) - 1} more"


def _function_text(scenario: Scenario, function: Function, memory: Mapping[str, Any]) -> str:
    match function.name:
        case "startCommunicationRobotAct":
            return (
                f"says {words}"
                if (words := _words_of(scenario, function.argument, memory))
                else (f"starts {function.argument}")
            )
        case "startInteractionRule":
            return f"starts the rule {describe_behavior(function.name, function.behavior)}"
        case "raiseEventTopic":
            return f"raises {normal_topic(function.argument)}"
        case _:
            return f"{_VERBS[function.name]} {function.argument}"


def _words_of(scenario: Scenario, name: str, memory: Mapping[str, Any]) -> str:
    """All that an act says, with the memory's values as they are now; of variants the first."""
    return " ".join(f"“{text}”" for text in _texts(scenario, name, memory))


def _texts(scenario: Scenario, name: str, memory: Mapping[str, Any]) -> Iterator[str]:
    act = scenario.acts.get(name)
    for action in act.actions if act is not None else ():
        if (message := message_of(scenario, action.calls[0])) is not None:
            yield fill_known(message, memory)
