"""Compiled truth: `and`, `or`, `xor`, `not`. `and` and `or` stop as soon as the result is known."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from rise_engine.expression.environment import Environment

Condition: TypeAlias = Callable[[Environment], bool]


def negation(operand: Condition) -> Condition:
    """`not`."""
    return lambda env: not operand(env)


def combine(operator: str, operands: list[Condition]) -> Condition:
    """`or`, `xor` or `and` of two or more conditions."""

    def every(env: Environment) -> bool:
        for operand in operands:  # noqa: SIM110  # `all()` with a generator takes three times as long
            if not operand(env):
                return False
        return True

    def some(env: Environment) -> bool:
        for operand in operands:  # noqa: SIM110
            if operand(env):
                return True
        return False

    def odd(env: Environment) -> bool:
        return sum(operand(env) for operand in operands) % 2 == 1

    return {"and": every, "or": some, "xor": odd}[operator]
