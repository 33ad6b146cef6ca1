"""Compiled comparisons. The common form, a key against a literal, has closures of its own: guards are hot."""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, TypeAlias

from rise_engine.expression.environment import MISSING, Env, Json
from rise_engine.expression.values import absent_equals, contains, equal

Condition: TypeAlias = Callable[[Env], bool]
Operand: TypeAlias = Callable[[Env], Json]
Refuse: TypeAlias = Callable[[Json, Json], Exception]
"""Makes the error for two operands that do not fit."""

_ORDERINGS: dict[str, Callable[[Any, Any], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_AFFIXES: dict[str, Callable[[str, str], bool]] = {"starts with": str.startswith, "ends with": str.endswith}


def key_equals(key: str, literal: Json, negate: bool) -> Condition:
    """`key == literal`, `key != literal`."""
    if_absent = absent_equals(literal) is not negate

    def equals(env: Env) -> bool:
        try:
            result: bool = env.memory[key] == literal
            return result
        except KeyError:
            value = env.absent(key, MISSING)
            return if_absent if value is MISSING else bool(value == literal)

    def differs(env: Env) -> bool:
        try:
            result: bool = env.memory[key] != literal
            return result
        except KeyError:
            value = env.absent(key, MISSING)
            return if_absent if value is MISSING else bool(value != literal)

    return differs if negate else equals


def equals(left: Operand, right: Operand, negate: bool) -> Condition:
    """`==` and `!=` of anything."""
    if negate:
        return lambda env: not equal(left(env), right(env))
    return lambda env: equal(left(env), right(env))


def key_order(symbol: str, key: str, literal: int | float | str, refuse: Refuse) -> Condition:
    """`key > literal` and its like. A key that does not exist is 0, or "" against a text.

    Python itself refuses to order JSON values of different types, so the check costs nothing while it passes.
    """
    empty: int | str = "" if isinstance(literal, str) else 0

    def value_of(env: Env) -> Any:
        return env.absent(key, empty)

    def greater(env: Env) -> bool:
        try:
            value = env.memory[key]
        except KeyError:
            value = value_of(env)
        try:
            result: bool = value > literal
            return result
        except TypeError:
            raise refuse(value, literal) from None

    def less(env: Env) -> bool:
        try:
            value = env.memory[key]
        except KeyError:
            value = value_of(env)
        try:
            result: bool = value < literal
            return result
        except TypeError:
            raise refuse(value, literal) from None

    def at_least(env: Env) -> bool:
        try:
            value = env.memory[key]
        except KeyError:
            value = value_of(env)
        try:
            result: bool = value >= literal
            return result
        except TypeError:
            raise refuse(value, literal) from None

    def at_most(env: Env) -> bool:
        try:
            value = env.memory[key]
        except KeyError:
            value = value_of(env)
        try:
            result: bool = value <= literal
            return result
        except TypeError:
            raise refuse(value, literal) from None

    return {">": greater, "<": less, ">=": at_least, "<=": at_most}[symbol]


def order(symbol: str, left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """`<`, `<=`, `>`, `>=` of numbers (booleans count as 1 and 0) or of texts (by code point)."""
    compare = _ORDERINGS[symbol]

    def ordered(env: Env) -> bool:
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


def key_affix(symbol: str, key: str, literal: str, refuse: Refuse) -> Condition:
    """`key starts with "text"`, `key ends with "text"`."""
    if symbol == "starts with":

        def starts(env: Env) -> bool:
            try:
                value = env.memory[key]
            except KeyError:
                value = env.absent(key, "")
            if value.__class__ is str:
                result: bool = value.startswith(literal)
                return result
            raise refuse(value, literal)

        return starts

    def ends(env: Env) -> bool:
        try:
            value = env.memory[key]
        except KeyError:
            value = env.absent(key, "")
        if value.__class__ is str:
            result: bool = value.endswith(literal)
            return result
        raise refuse(value, literal)

    return ends


def affix(symbol: str, left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """`starts with` and `ends with` of anything."""
    test = _AFFIXES[symbol]

    def holds(env: Env) -> bool:
        a, b = left(env), right(env)
        a = "" if a is MISSING else a
        b = "" if b is MISSING else b
        if isinstance(a, str) and isinstance(b, str):
            return test(a, b)
        raise refuse(a, b)

    return holds


def includes(left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """`contains`: part of a text, entry of a list, key of an object."""

    def holds(env: Env) -> bool:
        a, b = left(env), right(env)
        try:
            return contains(a, b)
        except TypeError:
            raise refuse(a, b) from None

    return holds
