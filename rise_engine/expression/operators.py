"""Compiled operators: truth, comparisons and arithmetic. Operands are closures of one argument, the environment.

It also has the functions that return lists: `range`, `shuffle`, `sample`, `latin` (semantics.md 8.6).

`below(n)` returns a random whole number from 0 up to n, exclusive. The number and order of its calls must stay the
same, so that sessions can be replayed.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any, TypeAlias

from rise_engine.expression.environment import MISSING, Environment, Json, contains, describe, equal
from rise_engine.expression.errors import EvaluationError
from rise_engine.expression.functions import divide

# --- lists ------------------------------------------------------------------------------------------------------------

MAX_ENTRIES = 10_000
"""Maximum length of a list that one of these functions accepts or returns."""
_LARGEST = 2**53
"""The largest whole number up to which all doubles are exact."""
LIST_FUNCTIONS = frozenset({"range", "shuffle", "sample", "latin"})
CHANCE_FUNCTIONS = frozenset({"rand", "shuffle", "sample"})

Below = Callable[[int], int]


def shuffle(entries: list[Any], below: Below) -> list[Any]:
    """All entries in random order (Fisher and Yates, from the end). Draws one number less than there are entries."""
    result = entries.copy()
    for last in range(len(result) - 1, 0, -1):
        picked = below(last + 1)
        result[last], result[picked] = result[picked], result[last]
    return result


def sample(entries: list[Any], count: int, below: Below) -> list[Any]:
    """`count` different entries in the order of drawing. Draws one number for each."""
    rest = entries.copy()
    result = []
    for _ in range(count):
        picked = below(len(rest))
        result.append(rest[picked])
        rest[picked] = rest[-1]  # the last entry fills the gap
        rest.pop()
    return result


def latin_row(entries: list[Any], row: int) -> list[Any]:
    """A row of the balanced Latin square of the entries (Williams 1949).

    The square has as many rows as entries if their number is even. If it is odd, it has twice as many, and the second
    half is the first half backwards. Row numbers wrap around.
    """
    size = len(entries)
    if size == 0:
        return []
    turn, backwards = row % size, size % 2 == 1 and row // size % 2 == 1
    order = [(turn + (-(place // 2) if place % 2 == 0 else (place + 1) // 2)) % size for place in range(size)]
    result = [entries[at] for at in order]
    return result[::-1] if backwards else result


class ListCall:
    """The compiled operand of a call of such a function."""

    __slots__ = ("_list", "_name", "_numbers", "_text")

    def __init__(self, name: str, entries: Operand | None, numbers: list[Number], text: str) -> None:
        """`entries`: the list, None for `range`; `numbers`: the other arguments."""
        self._name = name
        self._list = entries
        self._numbers = numbers
        self._text = text

    def __call__(self, env: Environment) -> list[Any]:
        entries = self._entries(env)
        numbers = [self._whole(number(env)) for number in self._numbers]
        match self._name:
            case "range":
                first, end = (0, *numbers)[-2:]
                self._check_count(max(0, end - first))
                return list(range(first, end))
            case "latin":
                self._check_not_negative(numbers[0])
                return latin_row(entries, numbers[0])
        if env.below is None:
            raise self._error(f"there is no source of chance here, so `{self._name}` has no value")
        if self._name == "shuffle":
            return shuffle(entries, env.below)
        self._check_not_negative(numbers[0])
        if numbers[0] > len(entries):
            raise self._error(f"`sample` cannot draw {numbers[0]} different entries from a list of {len(entries)}")
        return sample(entries, numbers[0], env.below)

    def _entries(self, env: Environment) -> list[Json]:
        """The list; empty if its key does not exist."""
        value = self._list(env) if self._list is not None else MISSING
        if value is MISSING:
            return []
        if not isinstance(value, list):
            raise self._error(f"`{self._name}` takes a list, not {describe(value)}")
        self._check_count(len(value))
        return value

    def _whole(self, number: float) -> int:
        if not -_LARGEST <= number <= _LARGEST or number != int(number):
            raise self._error(f"`{self._name}` takes whole numbers, not {number!r}")
        return int(number)

    def _check_not_negative(self, number: int) -> None:
        if number < 0:
            raise self._error(f"`{self._name}` takes no number below 0, as {number} is")

    def _check_count(self, count: int) -> None:
        if count > MAX_ENTRIES:
            raise self._error(f"`{self._name}` is for lists of at most {MAX_ENTRIES:,} entries, not {count:,}")

    def _error(self, message: str) -> EvaluationError:
        return EvaluationError(message, self._text)


Condition: TypeAlias = Callable[[Environment], bool]
Number: TypeAlias = Callable[[Environment], float]
"""Returns an IEEE double. Operations on such operands alone cannot raise."""
Operand: TypeAlias = Callable[[Environment], Json]
Refuse: TypeAlias = Callable[[Json, Json], Exception]
"""Makes the error for two operands that do not fit each other."""

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
    """Compile `or`, `xor` or `and` of several conditions. `and` and `or` stop once the result is known."""

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
    """Compile any comparison. `refuse` makes the error for values that do not fit."""
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
    """Compile `<`, `<=`, `>`, `>=` of numbers (booleans count as 1 and 0) or of texts (by code point)."""

    def is_ordered(env: Environment) -> bool:
        a, b = left(env), right(env)
        if a is MISSING:
            a = "" if isinstance(b, str) else 0
        if b is MISSING:
            b = "" if isinstance(a, str) else 0
        if isinstance(a, list):  # Python would order two lists
            raise refuse(a, b)
        try:
            return compare(a, b)
        except TypeError:
            raise refuse(a, b) from None

    return is_ordered


def _compile_affix(has_affix: Callable[[str, str], bool], left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """Compile `starts with` and `ends with` of texts."""

    def has_it(env: Environment) -> bool:
        a, b = left(env), right(env)
        a = "" if a is MISSING else a
        b = "" if b is MISSING else b
        if isinstance(a, str) and isinstance(b, str):
            return has_affix(a, b)
        raise refuse(a, b)

    return has_it


def _compile_contains(left: Operand, right: Operand, refuse: Refuse) -> Condition:
    """Compile `contains`: part of a text, entry of a list, key of an object."""

    def is_contained(env: Environment) -> bool:
        a, b = left(env), right(env)
        try:
            return contains(a, b)
        except TypeError:
            raise refuse(a, b) from None

    return is_contained


def compile_chain(first: Number, rest: list[tuple[str, Number]]) -> Number:
    """Compile a sum or a product, from left to right."""
    steps = [(_STEPS[sign], operand) for sign, operand in rest]

    def run(env: Environment) -> float:
        total = first(env)
        for step, operand in steps:
            total = step(total, operand(env))
        return total

    return run


def compile_call(function: Callable[..., float], arguments: list[Number]) -> Number:
    """Compile a function of numbers."""
    return lambda env: function(*[argument(env) for argument in arguments])
