"""Compiled arithmetic on IEEE doubles. Operands are closures that give floats; nothing here can raise."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from rise_engine.expression.environment import Environment
from rise_engine.expression.functions import divide, power

Number: TypeAlias = Callable[[Environment], float]


def chain(first: Number, rest: list[tuple[str, Number]]) -> Number:
    """A sum or a product, from left to right."""
    steps = [(_STEPS[operator], operand) for operator, operand in rest]

    def run(env: Environment) -> float:
        total = first(env)
        for step, operand in steps:
            total = step(total, operand(env))
        return total

    return run


def exponentiation(base: Number, exponent: Number) -> Number:
    """`base ^ exponent`."""
    return lambda env: power(base(env), exponent(env))


def negative(operand: Number) -> Number:
    """Unary minus."""
    return lambda env: -operand(env)


def call(function: Callable[..., float], arguments: list[Number]) -> Number:
    """A function of numbers."""
    return lambda env: function(*[argument(env) for argument in arguments])


_STEPS: dict[str, Callable[[float, float], float]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": divide,
}
