"""What can come from outside in a study that is explored: people, nodes, and how much of it is looked at."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain

from msgspec import Struct

from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import ActionReport, AnyInput, RobotChanged, Submit
from rise_engine.scenario.model import CUE_TOPICS, Function, Scenario, functions_in, normal_topic, result_topics

SOURCE = "wizard:explorer"
ENDS = ("succeeded", "failed", "stopped", "end")
"""What stands behind an act's name in the events that tell of its end."""


class World(Struct, frozen=True):
    """Who and what acts on the session, and within which bounds. An input that leads beyond one is not followed."""

    by_hand: bool = True
    """Also the keys that start an act."""
    nodes: bool = True
    """Events that no key and no rule raises come at any time."""
    stop: bool = False
    """Stop-all, its answer, and its release."""
    stop_again: bool = False
    """Stop-all also while everything is stopped."""
    releases: tuple[str, ...] = ("leave", "enter", "wait")
    """What becomes of all stopped rules at a release: each word is one input."""
    robot: bool = False
    """The link to the robot is lost and comes back."""
    cues: bool = False
    """The wizard marks the participant's cue, and takes it back."""
    more: tuple[Submit, ...] = ()
    """Other tasks that may come at any time, such as values that somebody types."""
    line: int = 1
    """Acts that wait."""
    beside: int = 2
    """Acts that run as `None`."""
    asked: int = 1
    """Failed acts that somebody is asked about."""
    kept: int = 1
    """Events that are kept."""
    faults: int = 0
    """Things that go wrong on one way: an action fails, the robot is lost, everything is stopped."""

    def exceeds(self, kernel: Kernel) -> bool:
        """Whether a session has gone beyond a bound."""
        runs = kernel.scheduler.runner.runs.values()
        beside = sum(run.task.calling_type == "None" for run in runs)
        asked, kept = kernel.failures.state.asked, kernel.rules.kept
        many = beside > self.beside or len(asked) > self.asked or len(kept) > self.kept
        return many or len(kernel.scheduler.waiting) > self.line


def is_fault(input: AnyInput) -> bool:
    """Whether something goes wrong by it."""
    match input:
        case ActionReport(status="failed") | RobotChanged(status="lost") | Submit(function="stopAll"):
            return True
    return False


def presses(scenario: Scenario, world: World) -> list[Submit]:
    """What people and nodes may ask for at any time, whatever has happened."""
    keys = [
        Submit(function=key.function, behavior=key.task_behavior, source=SOURCE)
        for key in scenario.keys.values()
        if world.by_hand or key.function != "startCommunicationRobotAct"
    ]
    events = [
        Submit(function="raiseEventTopic", behavior="/" + topic, source="ros:node")
        for topic in (sorted(external_topics(scenario)) if world.nodes else ())
    ]
    cues = [Submit(function="markCue", source=SOURCE)] if world.cues else []
    return [*keys, *events, *cues, *world.more]


def external_topics(scenario: Scenario) -> set[str]:
    """Topics that some rule waits for and that neither a key, nor a rule, nor the engine raises."""
    acts, rules = scenario.acts, scenario.rules
    by_engine = {f"{act}_{end}" for act in (*acts, "say") for end in ENDS} | {f"{rule}_end" for rule in rules}
    results = {topic for rule in rules.values() for _, topic in result_topics(rule)}
    by_rules = {normal_topic(each.argument) for each in _functions(scenario) if each.name == "raiseEventTopic"}
    by_keys = {normal_topic(key.behavior) for key in scenario.keys.values() if key.function == "raiseEventTopic"}
    return set(scenario.topics) - by_engine - results - by_rules - by_keys - set(CUE_TOPICS)


def _functions(scenario: Scenario) -> Iterator[Function]:
    states = (state for rule in scenario.rules.values() for state in rule.states.values())
    for state in states:
        blocks = (state.on_entry, state.on_exit, *(way.block for way in state.transitions))
        yield from chain.from_iterable(functions_in(block) for block in blocks)
