"""The cone of influence: the memory keys that can affect what happens. Exploring ignores all others."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from rise_engine.author.explore.act_traits import keys_read, keys_without_fallback
from rise_engine.expression import Assignment, Expression, ExpressionError
from rise_engine.scenario.model import (
    SESSION,
    SESSION_STATES,
    Block,
    Function,
    If,
    OneOf,
    Scenario,
    conditions_in,
    functions_in,
)


def keys_that_matter(
    scenario: Scenario, memories: Sequence[Mapping[str, Any]], properties: Iterable[Expression] = ()
) -> list[str]:
    """Return the memory keys whose values affect what happens, in a fixed order.

    Arguments:
        scenario: the scenario with the rules and acts that read them.
        memories: possible memories at the beginning.
        properties: conditions that will be evaluated in each situation.

    A key that the same block has set before does not count for a condition: its value depends only on the keys in its
    assignment.
    """
    matter = {key.partition(".")[0] for expression in properties for key in _reads(expression)}
    writes = [*_assignments_of_keys(scenario)]
    for rule in scenario.rules.values():
        for state in rule.states.values():
            for transition in state.transitions:
                for expression in transition.expressions:
                    matter |= _heads(_reads(expression))
            for block in state.blocks:
                writes += _assignments_in(block)
                _add_reads_of_block(block, {}, matter)
    started = memories or [{}]
    emptied = {each.key.partition(".")[0] for each in writes if _may_be_null(each)}
    for act in scenario.acts.values():
        matter |= {
            key
            for key in _heads(keys_without_fallback(act))
            if key in emptied or any(each.get(key) is None for each in started)
        }
    changed = True
    while changed:
        before = len(matter)
        for assignment in writes:
            if assignment.key.partition(".")[0] in matter:
                matter |= _heads(assignment.keys)
        changed = len(matter) > before
    matter -= scenario.tables.keys()
    known = {key for memory in started for key in memory} | set(scenario.known_keys)
    known |= {assignment.key for assignment in writes}
    if scenario.reads_session:
        matter.add(SESSION)
        known.add(SESSION)
    return sorted(key for key in known if key.partition(".")[0] in matter)


def assignments_of(scenario: Scenario) -> Iterator[Assignment]:
    """Yield all assignments that rules and keys can make."""
    yield from _assignments_of_keys(scenario)
    for rule in scenario.rules.values():
        yield from (each.assignment for each in rule.functions if each.assignment is not None)


def _may_be_null(assignment: Assignment) -> bool:
    """Return whether an assignment can remove a key's value: its result can be null."""
    expression = assignment.expression
    if expression is None:
        return assignment.literal is None or isinstance(assignment.literal, dict)
    return expression.text.strip() == "null" or expression.bare_key is not None or expression.gives_parts


def parts_of_session_read(scenario: Scenario) -> frozenset[str]:
    """Return the parts of `session` that rules and acts read: `speaking`, `cue`, `condition`, ..."""
    if not scenario.reads_session:
        return frozenset()
    keys = {key for act in scenario.acts.values() for key in keys_read(act)}
    for rule in scenario.rules.values():
        for state in rule.states.values():
            for block in state.blocks:
                keys |= {key for assignment in _assignments_in(block) for key in assignment.keys}
                keys |= {key for condition in conditions_in(block) for key in condition.keys}
            for transition in state.transitions:
                keys |= {key for expression in transition.expressions for key in expression.keys}
    parts = {key.split(".")[1] for key in keys if key.startswith(f"{SESSION}.")}
    if SESSION in keys:
        parts |= {"participant", "condition", "factors", "language", *SESSION_STATES}
    return frozenset(parts)


def _reads(expression: Expression) -> frozenset[str]:
    return expression.keys | expression.constants


def _heads(keys: Iterable[str]) -> set[str]:
    return {key.partition(".")[0] for key in keys}


def _add_reads_of_block(block: Block, made_of: dict[str, set[str]], matter: set[str]) -> None:
    """Add the keys that the conditions of a block read.

    :param made_of: the keys that the block has set before, each with the keys in its assignment.
    """
    for statement in block:
        match statement:
            case Function(assignment=assignment):
                if assignment is not None and assignment.target is None and "." not in assignment.key:
                    made_of[assignment.key] = _resolve(_heads(assignment.keys), made_of)
            case If():
                arms = []
                for branch in statement.branches:
                    if branch.condition is not None:
                        matter |= _resolve(_heads(_reads(branch.condition)), made_of)
                    arm = dict(made_of)
                    _add_reads_of_block(branch.block, arm, matter)
                    arms.append(arm)
                if statement.branches[-1].condition is not None:
                    arms.append(dict(made_of))
                _join(made_of, arms)
            case OneOf():
                arms = [dict(made_of) for _ in statement.choices]
                for choice, arm in zip(statement.choices, arms, strict=True):
                    _add_reads_of_block((choice,), arm, matter)
                _join(made_of, arms)


def _resolve(keys: set[str], made_of: dict[str, set[str]]) -> set[str]:
    """Return the keys from before the block on which the values of these keys depend."""
    return {source for key in keys for source in made_of.get(key, (key,))}


def _join(made_of: dict[str, set[str]], arms: list[dict[str, set[str]]]) -> None:
    """Join branches: keep the keys that every branch has set, made of the keys of all branches."""
    everywhere = set.intersection(*(set(arm) for arm in arms))
    made_of.clear()
    made_of.update({key: set().union(*(arm[key] for arm in arms)) for key in everywhere})


def _assignments_in(block: Block) -> Iterator[Assignment]:
    return (each.assignment for each in functions_in(block) if each.assignment is not None)


def _assignments_of_keys(scenario: Scenario) -> Iterator[Assignment]:
    for key in scenario.keys.values():
        if key.function == "assignValue":
            try:
                yield from Assignment.parse_all(key.behavior)
            except ExpressionError:
                continue  # this key is refused each time it is pressed
