"""Why a rule is in its state: the event, time or condition of each transition, and what the wizard can do. Pure."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from typing import Any, Literal, NamedTuple

from rise_engine.base.typed_values import format_value
from rise_engine.expression import Environment, EvaluationError, Expression, LanguageError, lookup
from rise_engine.expression.nodes import Logic, with_all_brackets
from rise_engine.scenario.model import (
    ALWAYS,
    CUE_TOPICS,
    Block,
    Delay,
    Function,
    If,
    OneOf,
    Rule,
    Scenario,
    Statement,
    Transition,
    normal_topic,
    result_topics,
)

# --- conditions -------------------------------------------------------------------------------------------------------


Joint = Literal["and", "or", ""]

_PIECE = re.compile(r'"(?:[^"\\]|\\.)*"|\'(?:[^\'\\]|\\.)*\'|[()\[\]]|&&|\|\||[^\W\d][\w.]*', re.DOTALL)
_LEVELS = {"(": 1, "[": 1, ")": -1, "]": -1}
_JOINTS = {"and": ("and", "&&"), "or": ("or", "||")}


def is_met(condition: Expression | None, memory: Mapping[str, Any]) -> bool:
    """Return whether a condition holds with these values: `None` always does, a condition with an error never does."""
    if condition is None:
        return True
    try:
        return condition.as_condition(memory)
    except EvaluationError:
        return False


class ConditionParts(NamedTuple):
    joint: Joint
    """The operator between them; empty: the condition has one part."""
    parts: tuple[Expression, ...]


@lru_cache(512)
def split_condition(condition: Expression) -> ConditionParts:
    """Split a condition at its top-level `and` or `or`; `xor` is not split."""
    root = condition.root
    if not isinstance(root, Logic) or root.operator not in _JOINTS:
        return ConditionParts("", (condition,))
    try:
        texts = _split_text(condition.text, _JOINTS[root.operator])
        found = tuple(Expression.parse(text) for text in texts)
        if tuple(part.root for part in found) != root.operands:  # the pieces of the text have another meaning
            found = tuple(Expression.parse(with_all_brackets(operand)) for operand in root.operands)
    except LanguageError:
        return ConditionParts("", (condition,))
    return ConditionParts("and" if root.operator == "and" else "or", found)


def _split_text(text: str, joints: tuple[str, ...]) -> list[str]:
    """Split the text at these words outside of brackets and quotes."""
    bare = text.strip()
    while bare.startswith("(") and _find_closing(bare) == len(bare) - 1:
        bare = bare[1:-1].strip()
    pieces, depth, start = [], 0, 0
    for found in _PIECE.finditer(bare):
        depth += _LEVELS.get(found[0], 0)
        if not depth and found[0] in joints:
            pieces.append(bare[start : found.start()].strip())
            start = found.end()
    return [*pieces, bare[start:].strip()]


def _find_closing(text: str) -> int:
    """Find the bracket that closes the text's first one."""
    depth = 0
    for found in _PIECE.finditer(text):
        depth += _LEVELS.get(found[0], 0)
        if not depth:
            return found.start()
    return -1


# --- labels -----------------------------------------------------------------------------------------------------------


def delay_text(delay: Delay) -> str:
    """Format a time for display: `8 s`, or the expression that gives it."""
    return delay.text if delay.seconds is None else f"{delay.seconds:g} s"


def transition_label(transition: Transition, *, condition: bool = False) -> str:
    """Return a short name of a transition: its event, time or condition; with `condition`, also an event's condition.

    >>> transition_label(Transition(event="next", target="Tea"))
    'next'
    """
    label = _waited_label(transition)
    if condition and transition.condition is not None and not transition.is_eventless:
        return f"{label} if {transition.condition.text}"
    return label


def _waited_label(transition: Transition) -> str:
    if transition.ended is not None:
        return f"{transition.ended} {' or '.join(transition.outcomes) or 'ended'}"
    if transition.event is not None:
        return transition.event
    if transition.after is not None:
        time = f"after {delay_text(transition.after)}"
        return time if transition.held is None else f"{time} of {transition.held.text}"
    condition = transition.condition.text if transition.condition is not None else ALWAYS
    return "at once" if condition == ALWAYS else condition


ENDINGS = {"_end": "to end", "_succeeded": "to succeed", "_failed": "to fail", "_stopped": "to be stopped"}
"""Endings that the engine raises as events: all of them for acts, only the first for rules."""
ENDING_VERBS = {"_end": "ends", "_succeeded": "succeeds", "_failed": "fails", "_stopped": "is stopped"}


MAX_PARTS = 20
"""Maximum number of parts of a value that are shown; above, only their number is."""


class Truth(NamedTuple):
    """The present value of a condition."""

    text: str
    values: str
    """The keys and parts that it reads, with their values: `task is 2, items[i].done is true`."""
    holds: bool
    error: str = ""


def _short_value(value: Any) -> str:
    """Format a value that is shown beside others; for a long list or object, give its size."""
    if isinstance(value, list | dict) and len(value) > MAX_PARTS:
        return f"{'a list' if isinstance(value, list) else 'an object'} of {len(value)}"
    return format_value(value)


def truth_of(expression: Expression, memory: Mapping[str, Any], shown: Callable[[Any], str] = _short_value) -> Truth:
    """Evaluate a condition over the present memory. `shown` formats each value that it reads."""
    parts: dict[str, Any] = {}
    holds, error = False, ""
    try:
        holds = expression.compiled_condition(Environment(memory, parts=parts))
    except EvaluationError as problem:
        error = str(problem)
    texts = {name: f"{name} is {shown(value)}" for name, value in parts.items() if value is not None or not error}
    for key in expression.keys - expression.keys_of_parts_only:
        found, value = lookup(memory, key)
        texts[key] = f"{key} is {shown(value)}" if found else f"{key} is not set"
    return Truth(expression.text, ", ".join(text for _, text in sorted(texts.items())), holds, error)


def wait_text(scenario: Scenario, transition: Transition) -> str:
    """Describe what a transition waits for."""
    if transition.after is not None:
        time = delay_text(transition.after)
        return f"{time} to pass" if transition.held is None else f"its condition to hold for {time}"
    if transition.ended is not None:
        return f"{transition.ended} {' or '.join(ENDINGS[end] for end in awaited_ends(transition))}"
    if transition.event is None:
        return "its condition alone"
    if (found := parse_engine_event(scenario, transition.event)) is not None:
        return f"{found[0]} {ENDINGS[found[1]]}"
    if (result := parse_rule_result(scenario, transition.event)) is not None:
        return f"the rule {result[0]} to end in {result[1]}"
    if transition.event in CUE_TOPICS:
        return "the participant's cue" if transition.event == CUE_TOPICS[0] else "the cue to be taken back"
    return f"event {transition.event}"


def engine_raises_text(scenario: Scenario, topic: str) -> str:
    """Return the sentence that the engine itself raises this event about an act or a rule; empty: another event."""
    found = parse_engine_event(scenario, topic)
    return f"{found[0]} raises this event itself when it {ENDING_VERBS[found[1]]}" if found is not None else ""


def parse_engine_event(scenario: Scenario, topic: str) -> tuple[str, str] | None:
    """Return the act or rule and the ending of an event that the engine raises."""
    for ending in ENDINGS:
        name = topic.removesuffix(ending)
        if name != topic and (name in scenario.acts or (name in scenario.rules and ending == "_end")):
            return name, ending
    return None


def parse_rule_result(scenario: Scenario, topic: str) -> tuple[str, str] | None:
    """Return the rule and its end state for an event by which the engine reports a rule's result."""
    for rule in scenario.rules.values():
        if topic.startswith(rule.name):
            for state, event in result_topics(rule):
                if event == topic:
                    return rule.name, state
    return None


def find_event_source(scenario: Scenario, topic: str) -> str | None:
    """Find the act or rule whose end raises this event; None: a failure or a stop, for which nothing is started."""
    found = parse_engine_event(scenario, topic)
    if found is not None:
        return found[0] if found[1] in ("_end", "_succeeded") else None
    result = parse_rule_result(scenario, topic)
    return result[0] if result is not None else None


def awaited_ends(transition: Transition) -> tuple[str, ...]:
    """Return the endings of its rule's own act that a transition awaits: `_end`, or the given ones."""
    return tuple(f"_{outcome}" for outcome in transition.outcomes) or ("_end",)


def find_awaited_act(scenario: Scenario, transition: Transition) -> str | None:
    """Find the act or rule whose end a transition waits for."""
    if transition.ended is not None:
        return transition.ended
    if transition.event is None:
        return None
    found = parse_engine_event(scenario, transition.event) or parse_rule_result(scenario, transition.event)
    return found[0] if found is not None else None


def events_raised_by(rule: Rule) -> frozenset[str]:
    """Collect all topics that a rule raises, without slash."""
    raised = (function.argument for function in rule.functions if function.name == "raiseEventTopic")
    return frozenset(map(normal_topic, raised))


def functions_in(
    block: Block | tuple[Statement, ...], *, sure: bool = True, memory: Mapping[str, Any] | None = None
) -> Iterator[tuple[Function, bool]]:
    """Yield every function of a block, and whether it always runs, whatever chance and the memory have.

    With `memory`, the block runs with these values: branches that do not hold are left out, until a function may have
    changed a value.
    """
    for statement in block:
        match statement:
            case Function():
                yield statement, sure
                memory = memory if statement.name in ("startCommunicationRobotAct", "raiseEventTopic") else None
            case If() if memory is not None:
                held = (branch.block for branch in statement.branches if is_met(branch.condition, memory))
                for function, certain in functions_in(next(held, ()), sure=sure, memory=memory):
                    yield function, certain
                    memory = None if function.assignment is not None else memory
            case If():
                for branch in statement.branches:
                    yield from functions_in(branch.block, sure=False)
            case OneOf():
                yield from functions_in(statement.choices, sure=False)
