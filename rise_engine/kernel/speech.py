"""The act of a task: one of the scenario's, or free speech, which is a temporary act with one action."""

from __future__ import annotations

from rise_engine.kernel.core import Task
from rise_engine.scenario.model import Act, Action, ActionCall, Scenario
from rise_engine.scenario.parameters import LANGUAGE, MESSAGE
from rise_engine.scenario.speech.ssml import begins_as_ssml, literal_ssml
from rise_engine.scenario.speech.template import Template

SAY = "say"
"""The function of the task, and the name of the act and its only action in records and events (`/say_end`)."""
SPEECH = "Speech"


def find_act(scenario: Scenario, task: Task) -> Act:
    """Return the act that a task of the scheduler runs."""
    return _speech_act(scenario, task.behavior) if task.function == SAY else scenario.acts[task.behavior]


def act_name(task: Task) -> str:
    """The name of a task's act in records and events."""
    return SAY if task.function == SAY else task.behavior


def why_not_speak(scenario: Scenario) -> str:
    """Why the scenario's robot cannot speak; empty: it can."""
    spec = scenario.robot.actions.get(SPEECH)
    if spec is not None and (spec.supported or spec.substitute is not None):
        return ""
    return f"{scenario.robot.name} cannot speak"


def _speech_act(scenario: Scenario, text: str) -> Act:
    literal = literal_ssml(text) if begins_as_ssml(text) else text  # a wizard types text, not markup
    message = Template(literal, (literal,))  # literal: braces are spoken
    spec, parameters = scenario.robot.actions[SPEECH], {MESSAGE: message}
    if scenario.says_language and LANGUAGE in spec.parameters:
        parameters[LANGUAGE] = Template(scenario.language, (scenario.language,))
    return Act(SAY, (Action(SAY, (ActionCall(SPEECH, parameters),)),), frozenset(spec.channels))
