"""The functions of the language: those of RISE's parser, with the results of IEEE arithmetic instead of exceptions.

All take and return doubles. A domain error gives NaN and an overflow gives infinity, as in the C library. `rand`,
`length`, `lower`, `defined` and the functions that return lists need more than numbers: their arity is here, their code
in the modules `compiler` and `operators`.

The signatures describe every function for `rise-engine eval --functions`, for messages, and for
docs/reference/conditions.md, which a test compares with them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from math import copysign, inf, nan
from typing import NamedTuple

# --- signatures -------------------------------------------------------------------------------------------------------


class Signature(NamedTuple):
    """A function in written form."""

    name: str
    written: tuple[str, ...]
    """Each way to call it."""
    meaning: str
    """Its result and its arguments, with their units."""
    example: str
    result: str
    """The result of the example as `rise-engine eval` shows it; a range for `rand`."""

    @property
    def usage(self) -> str:
        """All ways to call it, in backquotes."""
        return " or ".join(f"`{each}`" for each in self.written)


def _declare(calls: str, meaning: str, example: str, result: str) -> Signature:
    """Build a signature from the ways to call a function, separated by `or`."""
    return Signature(calls.partition("(")[0], tuple(calls.split(" or ")), meaning, example, result)


SIGNATURES: tuple[Signature, ...] = (
    _declare(
        "rand(most) or rand(least, most)",
        "a number by chance, from `least` (0 if left out) up to, but without, `most`; a new one each time, from the "
        "session's seed. A whole number from 1 to 6: `floor(rand(1, 7))`",
        "floor(rand(1, 7))",
        "1 to 6",
    ),
    _declare("length(value)", "how many characters a text has, entries a list, keys an object", "length('Anna')", "4"),
    _declare("lower(text)", "the text in small letters", "lower('Yes, PLEASE')", '"yes, please"'),
    _declare("defined(key)", "whether the memory has this key, whatever its value", "defined(nobody)", "false"),
    _declare(
        "range(n) or range(first, end)",
        "a list of whole numbers, from `first` (0 if left out) up to, but without, the last argument",
        "range(2, 5)",
        "[2, 3, 4]",
    ),
    _declare(
        "shuffle(list)",
        "the same entries in an order by chance, from the session's seed",
        "shuffle(range(5))",
        "[2, 1, 0, 4, 3]",
    ),
    _declare(
        "sample(list, n)",
        "n different entries of a list, drawn by chance, from the session's seed",
        "sample(range(100), 3)",
        "[49, 97, 53]",
    ),
    _declare(
        "latin(list, k)",
        "row k (from 0 on, then again from the start) of the balanced Latin square of a list: for as many participants "
        "as it has entries (with an odd number: twice as many), every entry has every place and follows every other "
        "one, equally often",
        "latin(range(4), 1)",
        "[1, 2, 0, 3]",
    ),
    _declare("abs(x)", "x without its sign", "abs(-2.5)", "2.5"),
    _declare("floor(x)", "the largest whole number that is not above x", "floor(-2.5)", "-3"),
    _declare("ceil(x)", "the smallest whole number that is not below x", "ceil(2.1)", "3"),
    _declare("round(x)", "the nearest whole number; of two, the even one", "round(2.5)", "2"),
    _declare("min(a, b, ...)", "the smallest of two or more numbers", "min(3, 1, 2)", "1"),
    _declare("max(a, b, ...)", "the largest of two or more numbers", "max(3, 1, 2)", "3"),
    _declare("clamp(x, low, high)", "x, but not below `low` and not above `high`", "clamp(12, 0, 10)", "10"),
    _declare("clamp01(x)", "x, but not below 0 and not above 1", "clamp01(1.5)", "1"),
    _declare("lerp(a, b, t)", "the number between a (t = 0) and b (t = 1)", "lerp(10, 20, 0.25)", "12.5"),
    _declare("sqrt(x)", "the square root", "sqrt(9)", "3"),
    _declare("pow(x, y)", "x to the power of y, as `x ^ y`", "pow(2, 10)", "1024"),
    _declare("exp(x)", "e to the power of x", "exp(0)", "1"),
    _declare("ln(x)", "the natural logarithm", "ln(e)", "1"),
    _declare("log10(x)", "the logarithm to base 10", "log10(1000)", "3"),
    _declare("sin(x)", "the sine; x in radians (`x * d2r` for degrees)", "sin(90 * d2r)", "1"),
    _declare("cos(x)", "the cosine; x in radians", "cos(0)", "1"),
    _declare("tan(x)", "the tangent; x in radians", "tan(0)", "0"),
    _declare("asin(x)", "the angle in radians, -pi/2 to pi/2, whose sine is x", "asin(1) * r2d", "90"),
    _declare("acos(x)", "the angle in radians, 0 to pi, whose cosine is x", "acos(1)", "0"),
    _declare("atan(x)", "the angle in radians, -pi/2 to pi/2, whose tangent is x", "atan(0)", "0"),
    _declare("atan2(y, x)", "the angle in radians, -pi to pi, of the direction (x, y)", "atan2(1, 0) * r2d", "90"),
)
"""The most common functions come first."""


SITUATION_SIGNATURES: tuple[Signature, ...] = (
    _declare(
        "in('Rule', 'State')",
        "whether this rule runs and is in this state",
        "in('Greeting', 'Nobody')",
        "true or false",
    ),
    _declare("rule('Rule')", "whether this rule runs", "not rule('Conversation')", "true or false"),
    _declare(
        "runs('Act')", "whether this act runs, at least once", "runs('R_LookAhead') and runs('R_Nod')", "true or false"
    ),
    _declare("waits('Act')", "whether this act waits to be run, at least once", "waits('R_Greeting')", "true or false"),
)
"""Functions that only a property of a study can call (docs/reference/scenario.md)."""


def find_signature(name: str) -> Signature | None:
    """The function of that name, or None."""
    return next((each for each in (*SIGNATURES, *SITUATION_SIGNATURES) if each.name == name), None)


CONSTANTS = {"pi": math.pi, "e": math.e, "r2d": 180 / math.pi, "d2r": math.pi / 180}
"""Multiply by `r2d` to turn radians into degrees, by `d2r` for the reverse. A memory key of that name hides them."""

ANY_NUMBER_OF_ARGUMENTS = 1000
"""Maximum number of arguments of functions that accept any number."""


def divide(a: float, b: float) -> float:
    """Divide as IEEE does: x/0 gives infinity with the proper sign, 0/0 gives NaN."""
    try:
        return a / b
    except ZeroDivisionError:
        return nan if a == 0 or a != a else copysign(inf, a) * copysign(1.0, b)


def power(a: float, b: float) -> float:
    """Raise to a power as IEEE does: without exceptions, and always as a double."""
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


def _nan_if_any_nan(function: Callable[..., float]) -> Callable[..., float]:
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
    "min": _nan_if_any_nan(min),
    "max": _nan_if_any_nan(max),
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
"""The minimum and maximum number of arguments of every function of expressions."""

SITUATION_ARITY = {"in": 2, "rule": 1, "runs": 1, "waits": 1}
"""The functions that only a property of a study can call, with their number of names."""
