"""Compiled operators: truth, comparisons and arithmetic. Operands are closures of one argument, the environment."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, TypeAlias

from rise_engine.expression.environment import MISSING, Environment, Json
from rise_engine.expression.functions import divide
from rise_engine.expression.values import contains, equal

Condition: TypeAlias = Callable[[Environment], bool]
Number: TypeAlias = Callable[[Environment], float]
"""Gives an IEEE double. What is computed of such operands alone cannot raise."""
Operand: TypeAlias = Callable[[Environment], Json]
Refuse: TypeAlias = Callable[[Json, Json], Exception]
"""Makes the error for two operands that do not fit."""

_ORDERINGS: dict[str, Callable[[Any, Any], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_AFFIXES: dict[str, Callable[[str, str], bool]] = {"starts with": str.startswith, "ends with": str.endswith}
_STEPS: dict[str, Callable[[float, float], float]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": divide,
}


def compile_logic(symbol: str, operands: list[Condition]) -> Condition:
    """`or`, `xor` or `and` of two or more conditions; `and` and `or` stop as soon as the result is known."""

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

    return {"and": every, "or": some, "xor": odd}[symbol]


def compile_comparison(symbol: str, left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """Any of the comparisons; of values that do not fit it raises what `refuse` makes."""
    if symbol == "==":
        return lambda env: equal(left(env), right(env))
    if symbol == "!=":
        return lambda env: not equal(left(env), right(env))
    if symbol == "contains":
        return _compile_contains(left, right, refuse)
    if symbol in _AFFIXES:
        return _compile_affix(_AFFIXES[symbol], left, right, refuse)
    return _compile_ordering(_ORDERINGS[symbol], left, right, refuse)


def _compile_ordering(compare: Callable[[Any, Any], bool], left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """`<`, `<=`, `>`, `>=` of numbers (booleans count as 1 and 0) or of texts (by code point)."""

    def is_ordered(env: Environment) -> bool:
        a, b = left(env), right(env)
        if a is MISSING:
            a = "" if isinstance(b, str) else 0
        if b is MISSING:
            b = "" if isinstance(a, str) else 0
        if isinstance(a, list):  # two lists are the one pair that Python would order
            raise refuse(a, b)
        try:
            return compare(a, b)
        except TypeError:
            raise refuse(a, b) from None

    return is_ordered


def _compile_affix(has_affix: Callable[[str, str], bool], left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """`starts with` and `ends with` of texts."""

    def has_it(env: Environment) -> bool:
        a, b = left(env), right(env)
        a = "" if a is MISSING else a
        b = "" if b is MISSING else b
        if isinstance(a, str) and isinstance(b, str):
            return has_affix(a, b)
        raise refuse(a, b)

    return has_it


def _compile_contains(left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """`contains`: part of a text, entry of a list, key of an object."""

    def is_contained(env: Environment) -> bool:
        a, b = left(env), right(env)
        try:
            return contains(a, b)
        except TypeError:
            raise refuse(a, b) from None

    return is_contained


def compile_chain(first: Number, rest: list[tuple[str, Number]]) -> Number:
    """A sum or a product, from left to right."""
    steps = [(_STEPS[sign], operand) for sign, operand in rest]

    def run(env: Environment) -> float:
        total = first(env)
        for step, operand in steps:
            total = step(total, operand(env))
        return total

    return run


def compile_call(function: Callable[..., float], arguments: list[Number]) -> Number:
    """A function of numbers."""
    return lambda env: function(*[argument(env) for argument in arguments])
