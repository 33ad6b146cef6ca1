"""Properties that hold for every expression, with random ones as witnesses."""

from __future__ import annotations

import math
from contextlib import suppress
from functools import partial
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from rise_engine.expression import EvaluationError, Expression, ExpressionError
from tests.expression.numbers import as_number

KEYS = ("a", "b", "c.d", "n", "m", "x")
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False, allow_infinity=False) | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("abd"), inner, max_size=3),
    max_leaves=5,
)
MEMORIES = st.dictionaries(st.sampled_from([*KEYS, "c", "pi"]), JSON)
WORDS = [
    *KEYS, "1", "2.5", "1e3", '"t"', "''", "true", "false", "null", "pi", "(", ")", "(", ")", ",", "and", "or", "xor",
    "not", "!", "&&", "||", "=", "==", "!=", "<", "<=", ">", ">=", "+", "-", "*", "/", "^", "starts with", "ends with",
    "contains", "abs(", "max(", "rand(", "length(", "lower(", "defined(", " ", "\n", "%", "'",
    "[", "]", "[", "]", "].a", "a[0]", "a[n].b", "shuffle(", "sample(", "latin(", "range(",
]  # fmt: skip

# Any shape of expression, types be damned.
ATOMS = st.sampled_from([*KEYS, "0", "1", "2.5", '"t"', "true", "null", "pi", "rand(1)"])
BINARY = ["and", "or", "xor", "==", "!=", "<", "<=", ">", ">=", "+", "-", "*", "/", "^", "starts with", "contains"]
SHAPES = st.recursive(
    ATOMS,
    lambda inner: (
        st.builds("({} {} {})".format, inner, st.sampled_from(BINARY), inner)
        | st.builds("({}{})".format, st.sampled_from(["not ", "-", "!"]), inner)
        | st.builds("{}({})".format, st.sampled_from(["abs", "sqrt", "ln", "length", "lower", "shuffle"]), inner)
        | st.builds("{}({}, {})".format, st.sampled_from(["max", "atan2", "pow", "sample", "latin"]), inner, inner)
        | st.builds("{}[{}]".format, st.sampled_from(["a", "c.d", "shuffle(a)", "range(n)"]), inner)
        | st.builds("a[{}].{}".format, inner, st.sampled_from(["b", "d.0"]))
    ),
    max_leaves=12,
)


def outcome(text: str, memory: dict[str, Any]) -> list[Any]:
    """What an expression gives in all three readings; errors are values, NaN is made comparable."""
    results: list[Any] = []
    expression = Expression.parse(text)
    for read in (expression.as_condition, partial(as_number, text), expression.value):
        try:
            result = read(memory, rand=lambda: 0.5)
        except EvaluationError:
            result = "ERROR"
        results.append(repr(result))
    return results


@given(st.text() | st.lists(st.sampled_from(WORDS), max_size=30).map(" ".join))
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        Expression.parse(text)
    except ExpressionError as error:
        assert 1 <= error.column <= len(text) + 1
        assert error.message


@given(SHAPES, MEMORIES)
def test_evaluation_gives_a_value_or_an_evaluation_error(text: str, memory: dict[str, Any]) -> None:
    expression = Expression.parse(text)
    for read, types in (
        (expression.as_condition, bool),
        (partial(as_number, text), (int, float)),
        (expression.value, (bool, int, float, str, list, dict, type(None))),
    ):
        with suppress(EvaluationError):  # anything else fails the test
            assert isinstance(read(memory, rand=lambda: 0.5), types)


@given(SHAPES, MEMORIES)
def test_the_explicit_form_means_the_same(text: str, memory: dict[str, Any]) -> None:
    expression = Expression.parse(text)
    again = Expression.parse(expression.with_all_brackets)
    assert again.with_all_brackets == expression.with_all_brackets
    assert again.keys == expression.keys
    assert outcome(again.text, memory) == outcome(text, memory)


@given(SHAPES, MEMORIES)
def test_no_key_is_read_that_is_not_listed(text: str, memory: dict[str, Any]) -> None:
    expression = Expression.parse(text)
    read: set[str] = set()
    with suppress(EvaluationError):
        expression.as_condition(memory, rand=lambda: 0.5, missing=read)
    assert read <= expression.keys


# Well-typed expressions without redundant brackets, against Python's own reading of the same precedences.
NUMBERS = st.recursive(
    st.sampled_from(["n", "m", "1", "2", "0.5"]),
    lambda inner: st.builds("{} {} {}".format, inner, st.sampled_from("+-*"), inner) | st.builds("({})".format, inner),
    max_leaves=8,
)
COMPARISONS = st.builds("{} {} {}".format, NUMBERS, st.sampled_from(["<", "<=", ">", ">=", "==", "!="]), NUMBERS)
TRUTHS = st.recursive(
    st.sampled_from(["a", "b"]) | COMPARISONS,
    lambda inner: (
        st.builds("{} {} {}".format, inner, st.sampled_from(["and", "or"]), inner)
        | st.builds("not {}".format, inner)
        | st.builds("({})".format, inner)
    ),
    max_leaves=10,
)


@given(TRUTHS, st.booleans(), st.booleans(), st.integers(-5, 5), st.integers(-5, 5))
def test_conditions_agree_with_python(text: str, a: bool, b: bool, n: int, m: int) -> None:
    memory = {"a": a, "b": b, "n": n, "m": m}
    assert Expression.parse(text).as_condition(memory) is eval(text, {}, memory)


@given(NUMBERS, st.integers(-50, 50), st.integers(-50, 50))
def test_numbers_agree_with_python(text: str, n: int, m: int) -> None:
    result = as_number(text, {"n": n, "m": m})
    assert result == eval(text, {}, {"n": float(n), "m": float(m)})
    assert isinstance(result, int) == (math.isfinite(result) and result == int(result) and -(2**63) <= result < 2**63)
