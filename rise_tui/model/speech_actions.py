"""Which actions of a robot say something, and in which of their parameters the words are. Pure."""

from __future__ import annotations

from rise_engine.kernel.task_view import ActionView
from rise_engine.scenario.model import ActionCall, Scenario
from rise_engine.scenario.spoken import MESSAGE, SPEECH_CHANNEL
from rise_engine.scenario.ssml import plain_words
from rise_engine.scenario.template import Template, spoken_text


def message_name(scenario: Scenario, action: str) -> str:
    """The parameter of an action of the robot that holds what is said: its `message`, or else the first that is a text;
    empty for one that says nothing."""
    spec = scenario.robot.actions.get(action)
    if spec is None or SPEECH_CHANNEL not in spec.channels:
        return ""
    texts = [name for name, parameter in spec.parameters.items() if parameter.type == "text"]
    return MESSAGE if MESSAGE in texts else next(iter(texts), "")


def message_of(scenario: Scenario, call: ActionCall) -> Template | None:
    """What a call says, as it is written; None when it says nothing."""
    return call.parameters.get(message_name(scenario, call.type))


def words_of(scenario: Scenario, action: ActionView) -> str | None:
    """What is heard of an action, as it was sent, or for one that was left out as it is written; None when it says
    nothing."""
    name = message_name(scenario, action.type)
    return plain_words(spoken_text(action.parameters[name]).strip()) if name and name in action.parameters else None
