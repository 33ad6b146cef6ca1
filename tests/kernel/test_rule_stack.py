"""Who waits for what: the lists that find the taker of an event are right after whatever has happened."""

from __future__ import annotations

from random import Random

import pytest

from rise_engine.expression import Expression
from rise_engine.kernel import Kernel
from rise_engine.kernel.inputs import SessionStarted, Submit
from rise_engine.kernel.rule_stack import rank
from rise_engine.scenario.model import Function, RobotProfile, Rule, Scenario, State, Transition

TOPICS = ("a", "b", "c")
RULES = tuple(f"R{number}" for number in range(5))


def scenario(random: Random) -> Scenario:
    """Rules of two or three states, which wait for the same few topics and watch the same key."""
    rules = {}
    for name in RULES:
        names = [f"s{number}" for number in range(random.randint(2, 3))]
        states = {}
        for state in names:
            transitions = [
                Transition(topic, None, None, random.choice([*names, None]))
                for topic in random.sample(TOPICS, random.randint(1, 2))
            ]
            if random.random() < 0.3:
                transitions.append(Transition(None, Expression.parse("k > 2"), None, random.choice(names)))
            on_exit = (Function("raiseEventTopic", "/c"),) if random.random() < 0.2 else ()
            states[state] = State(state, (), on_exit, tuple(transitions))
        rules[name] = Rule(name, "s0", states, priority=random.choice([0, 1, 2]))
    robot = RobotProfile("none", "none", "none", {})
    return Scenario("test", "/", "debug", robot, {}, rules, {"k": 0}, topics=frozenset(TOPICS))


def check(kernel: Kernel) -> None:
    """Each rule but the top one waits, in stack order, for the events that its state takes; each watches its keys."""
    stack = kernel.rules.stack
    running = list(stack.values())
    assert running == sorted(running, key=rank)
    assert stack.top is (running[-1] if running else None)
    for topic in kernel.core.topics.values():
        assert list(topic.wait_list) == [run for run in running[:-1] if topic in run.state.by_topic]
    watching = {run.name for run in running if run.state.watch_lists}
    for run in running:
        for watch_list in run.state.watch_lists:
            assert {other.name for other in watch_list} == watching


@pytest.mark.parametrize("seed", range(20))
def test_the_lists_fit_the_stack(seed: int) -> None:
    random = Random(seed)
    kernel = Kernel(scenario(random), seed)
    kernel.handle(SessionStarted())
    moves = [
        *(("startInteractionRule", name) for name in RULES),
        *(("stopInteractionRule", name) for name in random.sample(RULES, 2)),
        *(("raiseEventTopic", topic) for topic in TOPICS * 3),
        *(("assignValue", f"k = {value}") for value in (0, 3)),
    ]
    promoted = 0
    for _ in range(100):
        top = kernel.rules.stack.top
        function, behavior = random.choice(moves)
        kernel.handle(Submit(function=function, behavior=behavior, source="wizard:anna"))
        check(kernel)
        promoted += function == "raiseEventTopic" and kernel.rules.stack.top is not top
    assert promoted, "another rule has taken an event"
