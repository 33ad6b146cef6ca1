"""Compiled comparisons: equality, order, beginnings and ends of texts, and what contains what."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, TypeAlias

from rise_engine.expression.environment import MISSING, Environment, Json
from rise_engine.expression.logic import Condition
from rise_engine.expression.values import contains, equal

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


def equals(left: Operand, right: Operand, negate: bool) -> Condition:
    """`==` and `!=` of anything."""
    if negate:
        return lambda env: not equal(left(env), right(env))
    return lambda env: equal(left(env), right(env))


def order(symbol: str, left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """`<`, `<=`, `>`, `>=` of numbers (booleans count as 1 and 0) or of texts (by code point)."""
    compare = _ORDERINGS[symbol]

    def ordered(env: Environment) -> bool:
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

    return ordered


def affix(symbol: str, left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """`starts with` and `ends with` of anything."""
    test = _AFFIXES[symbol]

    def holds(env: Environment) -> bool:
        a, b = left(env), right(env)
        a = "" if a is MISSING else a
        b = "" if b is MISSING else b
        if isinstance(a, str) and isinstance(b, str):
            return test(a, b)
        raise refuse(a, b)

    return holds


def includes(left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """`contains`: part of a text, entry of a list, key of an object."""

    def holds(env: Environment) -> bool:
        a, b = left(env), right(env)
        try:
            return contains(a, b)
        except TypeError:
            raise refuse(a, b) from None

    return holds
