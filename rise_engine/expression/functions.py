"""The functions of the language: those of RISE's parser, with the results of IEEE arithmetic instead of exceptions.

All take and give doubles. A domain error gives NaN, an overflow infinity, as in the C library. `rand`, `length`,
`lower` and `defined` need more than numbers; their arity is here, their meaning in the compiler, and that of the
functions which give lists in `lists`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from math import copysign, inf, nan

CONSTANTS = {"pi": math.pi, "e": math.e, "r2d": 180 / math.pi, "d2r": math.pi / 180}
"""`r2d` turns radians into degrees when multiplied, `d2r` the reverse. A memory key of the same name hides them."""

ANY_NUMBER_OF_ARGUMENTS = 1000
"""Upper bound for functions that take any number of arguments."""


def divide(a: float, b: float) -> float:
    """IEEE division: by zero gives infinity with the proper sign, 0/0 gives NaN."""
    try:
        return a / b
    except ZeroDivisionError:
        return nan if a == 0 or a != a else copysign(inf, a) * copysign(1.0, b)


def power(a: float, b: float) -> float:
    """IEEE power: never an exception, and never a number longer than a double."""
    try:
        return math.pow(a, b)
    except OverflowError:
        return -inf if a < 0 and math.fmod(b, 2) else inf
    except ValueError:
        # A zero to a negative power, or the root of a negative number.
        if a != 0:
            return nan
        return copysign(inf, a) if math.fmod(b, 2) in (1.0, -1.0) else inf


def _without_errors(function: Callable[[float], float]) -> Callable[[float], float]:
    def guarded(x: float) -> float:
        try:
            return function(x)
        except ValueError:
            return nan
        except OverflowError:
            return inf

    return guarded


def _logarithm(function: Callable[[float], float]) -> Callable[[float], float]:
    def logarithm(x: float) -> float:
        return function(x) if x > 0 else -inf if x == 0 else nan

    return logarithm


def _rounding(function: Callable[[float], float]) -> Callable[[float], float]:
    def rounded(x: float) -> float:
        return float(function(x)) if math.isfinite(x) else x

    return rounded


def _of_numbers(function: Callable[..., float]) -> Callable[..., float]:
    def extreme(*numbers: float) -> float:
        return nan if any(number != number for number in numbers) else function(numbers)

    return extreme


def _clamp(x: float, low: float, high: float) -> float:
    return low if x < low else high if x > high else x


NUMERIC: dict[str, Callable[..., float]] = {
    "sin": _without_errors(math.sin),
    "cos": _without_errors(math.cos),
    "tan": _without_errors(math.tan),
    "asin": _without_errors(math.asin),
    "acos": _without_errors(math.acos),
    "atan": math.atan,
    "atan2": math.atan2,
    "abs": abs,
    "floor": _rounding(math.floor),
    "ceil": _rounding(math.ceil),
    "round": _rounding(round),
    "min": _of_numbers(min),
    "max": _of_numbers(max),
    "exp": _without_errors(math.exp),
    "ln": _logarithm(math.log),
    "log10": _logarithm(math.log10),
    "sqrt": _without_errors(math.sqrt),
    "pow": power,
    "lerp": lambda a, b, t: a + (b - a) * t,
    "clamp": _clamp,
    "clamp01": lambda x: _clamp(x, 0.0, 1.0),
}

ARITY: dict[str, tuple[int, int]] = {
    **dict.fromkeys(NUMERIC, (1, 1)),
    "atan2": (2, 2),
    "min": (2, ANY_NUMBER_OF_ARGUMENTS),
    "max": (2, ANY_NUMBER_OF_ARGUMENTS),
    "pow": (2, 2),
    "lerp": (3, 3),
    "clamp": (3, 3),
    "rand": (1, 2),
    "length": (1, 1),
    "shuffle": (1, 1),
    "sample": (2, 2),
    "latin": (2, 2),
    "range": (1, 2),
    "lower": (1, 1),
    "defined": (1, 1),
}
"""Every function that an expression can call, with its least and largest number of arguments."""

SITUATION_ARITY = {"in": 2, "rule": 1, "runs": 1, "waits": 1}
"""The functions that only a property of a study can call, with their number of names: they ask how a session stands."""
