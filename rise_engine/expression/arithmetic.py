"""Compiled arithmetic on IEEE doubles. Operands are closures that give floats; nothing here can raise."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import TypeAlias

from rise_engine.expression.environment import Environment
from rise_engine.expression.functions import divide

Number: TypeAlias = Callable[[Environment], float]


def chain(first: Number, rest: list[tuple[str, Number]]) -> Number:
    """A sum or a product, from left to right."""
    steps = [(_STEPS[sign], operand) for sign, operand in rest]

    def run(env: Environment) -> float:
        total = first(env)
        for step, operand in steps:
            total = step(total, operand(env))
        return total

    return run


def call(function: Callable[..., float], arguments: list[Number]) -> Number:
    """A function of numbers."""
    return lambda env: function(*[argument(env) for argument in arguments])


_STEPS: dict[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": divide,
}
