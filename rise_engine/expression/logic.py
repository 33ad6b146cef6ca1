"""Compiled truth: `and`, `or`, `xor`, `not`. `and` and `or` stop as soon as the result is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from rise_engine.expression.environment import Env
from rise_engine.expression.values import truth

Condition: TypeAlias = Callable[[Env], bool]


def key_truth(key: str) -> Condition:
    """A bare key as a condition."""

    def holds(env: Env) -> bool:
        try:
            value = env.memory[key]
        except KeyError:
            value = env.absent(key, False)
        if value is True:
            return True
        return False if value is False else truth(value)

    return holds


def key_falsehood(key: str) -> Condition:
    """`not key`."""

    def holds(env: Env) -> bool:
        try:
            value = env.memory[key]
        except KeyError:
            value = env.absent(key, False)
        if value is True:
            return False
        return True if value is False else not truth(value)

    return holds


def negation(operand: Condition) -> Condition:
    """`not`."""
    return lambda env: not operand(env)


def combine(operator: str, operands: list[Condition]) -> Condition:
    """`or`, `xor` or `and` of two or more conditions."""
    if len(operands) > 2:
        return _combine_many(operator, operands)
    left, right = operands
    if operator == "and":
        return lambda env: left(env) and right(env)
    if operator == "or":
        return lambda env: left(env) or right(env)
    return lambda env: left(env) is not right(env)


def _combine_many(operator: str, operands: list[Condition]) -> Condition:
    def every(env: Env) -> bool:
        for operand in operands:  # noqa: SIM110  # `all()` with a generator takes twice as long
            if not operand(env):
                return False
        return True

    def some(env: Env) -> bool:
        for operand in operands:  # noqa: SIM110
            if operand(env):
                return True
        return False

    def odd(env: Env) -> bool:
        return sum(operand(env) for operand in operands) % 2 == 1

    return {"and": every, "or": some, "xor": odd}[operator]
