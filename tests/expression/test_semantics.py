"""What expressions mean, case by case (semantics.md 8)."""

from __future__ import annotations

import math
from typing import Any

import pytest

from rise_engine.expression import Environment, EvaluationError, Expression, lookup
from tests.expression.numbers import as_number

MEMORY: dict[str, Any] = {
    "t": True,
    "f": False,
    "n": 5,
    "m": 3,
    "half": 0.5,
    "neg": -1,
    "name": "Andre",
    "empty": "",
    "nothing": None,
    "list": [1, "two", True, [3]],
    "no_list": [],
    "person": {"name": "Ada", "tags": ["a", "b"], "age": 36},
    "person.flat": "flat",
    "starts": "abc",
    "ends": "c",
    "with": "a",
    "contains": "b",
    "größe": 180,
    "text_number": "1",
    "huge": 10**400,
}

CONDITIONS = {
    # precedence
    "not n > 3": False,
    "not n > 30": True,
    "!n > 3": False,
    "not f == f": False,
    "n > m == true": True,
    "f == n < m": True,
    "t or f and f": True,
    "t xor t and f": True,
    "t or t xor t": True,
    "not f and f": False,
    "t == not f": True,
    "-2^2 == 0 - 4": True,
    "2^-1 = half": True,
    "2^3 == 8": True,
    "2 - -3 == 5": True,
    "--3 == 3": True,
    "10 - 2 - 3 == 5": True,
    "49/49 == 1": True,
    "not(t)": False,
    "f or(t)": True,
    "1 + n > m * 2 - 1": True,
    "n - (m - 1) == 3": True,
    # white space
    "t\tand\nnot\r\nf": True,
    'name starts \n with "An"': True,
    # truth
    "neg": False,
    "half and n": True,
    "name": True,
    "empty": False,
    "nothing": False,
    "list": True,
    "no_list": False,
    "person": True,
    "0/0": False,
    '"x"': True,
    '""': False,
    "null": False,
    "t xor name": False,
    "t xor t xor t": True,
    # equality
    '"1" = 1': False,
    '"1" != 1': True,
    "text_number = 1": False,
    "t = 1": True,
    "f == 0": True,
    "t == 2": False,
    "nothing = null": True,
    "nothing = 0": False,
    "nothing = f": False,
    'nothing = ""': False,
    "0/0 == 0/0": False,
    "0/0 != 0/0": True,
    "list = list": True,
    "list != person": True,
    "n=5": True,
    "5 = n": True,
    # order
    '"a" < "b"': True,
    '"Z" < "a"': True,
    'name >= "Andre"': True,
    'name > "Andre"': False,
    'name < "B"': True,
    'name <= "A"': False,
    "3 < n": True,
    "m <= n": True,
    "t > f": True,
    "n >= 5 and n <= 5": True,
    # texts
    'name starts with "An"': True,
    'name starts with "an"': False,
    'name ends with "re"': True,
    'name contains "ndr"': True,
    'not name contains "x"': True,
    "name contains 'x' or t": True,
    '"Andre" starts with name': True,
    "list contains 1": True,
    'list contains "1"': False,
    'list contains "two"': True,
    "list contains 2": False,
    "person contains 'age'": True,
    "person contains 'Ada'": False,
    "lower(name) = 'andre'": True,
    "length(name) = 5": True,
    "length(list) == 4 and length(person) == 3": True,
    # contextual words
    "starts starts with with": True,
    "starts ends with ends": True,
    "starts contains contains": True,
    "contains = 'b'": True,
    # keys
    "person.name = 'Ada'": True,
    "person.tags.1 = 'b'": True,
    "person.flat = 'flat'": True,
    "list.1 = 'two'": True,
    "list.3.0 = 3": True,
    "größe > 179": True,
    "defined(n)": True,
    "defined(nothing)": True,
    "defined(person.name)": True,
    "defined(person.other)": False,
    "defined(gone)": False,
    # missing
    "gone": False,
    "not gone": True,
    "gone = 0": True,
    "gone = false": True,
    "gone = ''": True,
    "gone = null": True,
    "null == gone": True,
    "gone != 1": True,
    "gone == other": True,
    "gone = name": False,
    "gone = empty": True,
    "gone = no_list": False,
    "gone < 1": True,
    "gone < 'a'": True,
    "gone < name": True,
    "name > gone": True,
    "gone >= other": True,
    "gone + 1 == 1": True,
    "gone starts with ''": True,
    "name starts with gone": True,
    "gone contains 'a'": False,
    "gone contains 3": False,
    "length(gone) == 0": True,
    "lower(gone) == ''": True,
    "list.9 == null": True,
    "list.x == null": True,
    "name.x == null": True,
    # short circuit: the right side would be an error
    "t or name > 3": True,
    "f and name > 3": False,
    # functions in conditions
    "abs(neg)": True,
    "clamp01(n) == 1": True,
    "min(n, m, 1) == 1": True,
    "huge > 1": True,
    "huge + 0 == 1/0": True,
}


@pytest.mark.parametrize(("text", "expected"), CONDITIONS.items())
def test_condition(text: str, expected: bool) -> None:
    assert Expression.parse(text).as_condition(MEMORY) is expected


NUMBERS = {
    "4/2": 2,
    "7/2": 3.5,
    "half + half": 1,
    "-2^2": -4,
    "+3": 3,
    "+.5": 0.5,
    "n - +3": 2,
    "-+3": -3,
    "+2^2": 4,
    "max(+1, + 2)": 2,
    "2^3^2": 512,
    "t + t": 2,
    "t ^ n": 1,
    "2 ^ t": 2,
    "1e-3": 0.001,
    "1E3": 1000,
    ".5": 0.5,
    "5.": 5,
    "1/0": math.inf,
    "-1/0": -math.inf,
    "10^400": math.inf,
    "(-10)^401": -math.inf,
    "10^400^400": math.inf,
    "0^-1": math.inf,
    "huge": math.inf,
    "-huge": -math.inf,
    "2^53 - 1": 2**53 - 1,
    "exp(1000)": math.inf,
    "ln(0)": -math.inf,
    "floor(-1.5)": -2,
    "ceil(1.2)": 2,
    "round(2.5)": 2,
    "floor(1/0)": math.inf,
    "lerp(10, 20, 2)": 30,
    "clamp(5, 6, 1)": 6,
    "180 * d2r": math.pi,
    "pi * r2d": 180,
    "max(1, t, 3, n)": 5,
    "n > 3": 1,
    "gone": 0,
    "not gone": 1,
    "true": 1,
    "rand(4)": 1,
    "rand(4, 8)": 5,
}


@pytest.mark.parametrize(("text", "expected"), NUMBERS.items())
def test_number(text: str, expected: float) -> None:
    result = as_number(text, MEMORY, rand=lambda: 0.25)
    assert result == pytest.approx(expected, rel=1e-15)
    assert type(result) is type(expected)


@pytest.mark.parametrize(
    "text",
    [
        "0/0",
        "sqrt(-1)",
        "asin(2)",
        "ln(-1)",
        "(-8)^half",
        "sin(1/0)",
        "min(0/0, 1)",
        "max(1, 0/0)",
        "1/0 - 1/0",
        "round(0/0)",
    ],
)
def test_no_number(text: str) -> None:
    assert math.isnan(as_number(text, MEMORY))


VALUES: dict[str, Any] = {
    "n": 5,
    "n + 1": 6,
    "n / 2": 2.5,
    "5.0": 5,
    "t": True,
    "n > 3": True,
    "t and n": True,
    "name": "Andre",
    "lower(name)": "andre",
    "length(name)": 5,
    "'a\\n\\u00e9\\\\'": "a\né\\",
    '"it\'s"': "it's",
    '"\\ud83d\\ude00"': "😀",
    "null": None,
    "nothing": None,
    "gone": None,
    "list": MEMORY["list"],
    "person": MEMORY["person"],
    "-3": -3,
    "pi": math.pi,
    "12345678901": 12345678901,
}


@pytest.mark.parametrize(("text", "expected"), VALUES.items())
def test_value(text: str, expected: Any) -> None:
    result = Expression.parse(text).value(MEMORY)
    assert result == expected
    assert type(result) is type(expected)


ERRORS = {
    "name > 3": "Andre",
    "3 > name": "Andre",
    "name < list": "a list",
    "list > list": "a list",
    "nothing > 1": "null",
    "person < person": "an object",
    "name + 1": "Andre",
    "'1' + 1": '"1"',
    "-name": "Andre",
    "nothing * 2": "null",
    "list ^ 2": "a list",
    "abs(name)": "Andre",
    "n starts with 'a'": "the number 5",
    "name ends with 5": "the number 5",
    "n contains 5": "the number 5",
    "name contains 1": "the number 1",
    "person contains 1": "the number 1",
    "nothing starts with ''": "null",
    "length(n)": "the number 5",
    "lower(n)": "the number 5",
    "rand(1) > 0": "chance",
}


@pytest.mark.parametrize(("text", "named"), ERRORS.items())
def test_values_that_do_not_fit(text: str, named: str) -> None:
    expression = Expression.parse(text)
    with pytest.raises(EvaluationError) as caught:
        expression.as_condition(MEMORY)
    assert named in str(caught.value)
    assert caught.value.text == text


@pytest.mark.parametrize("text", ["name", "nothing", "list", "lower(name)"])
def test_what_has_no_number(text: str) -> None:
    with pytest.raises(EvaluationError):
        as_number(text, MEMORY)


def test_constants_are_hidden_by_keys() -> None:
    expression = Expression.parse("e > 3")
    assert expression.as_condition({}) is False
    assert expression.as_condition({"e": 4}) is True
    assert expression.keys == frozenset()
    assert expression.constants == {"e"}


def test_keys() -> None:
    expression = Expression.parse("a.b > 1 and not c or defined(d) and pi < 4 and e.x")
    assert expression.keys == {"a.b", "c", "d", "e.x"}
    assert expression.constants == {"pi"}


def test_missing_keys_are_reported_as_they_are_met() -> None:
    expression = Expression.parse("f and unread or gone.x > 1 or name starts with away or defined(quiet)")
    missing: set[str] = set()
    expression.as_condition(MEMORY, missing=missing)
    assert missing == {"gone.x", "away"}
    bare: set[str] = set()
    assert Expression.parse("nowhere").value(MEMORY, missing=bare) is None
    assert bare == {"nowhere"}


def test_rand_draws_once_for_each_call() -> None:
    draws = iter([0.5, 0.25])
    assert as_number("rand(2) + rand(10, 20)", {}, rand=lambda: next(draws)) == 13.5
    assert next(draws, None) is None


def test_one_environment_serves_while_the_memory_changes() -> None:
    memory: dict[str, Any] = {"n": 1}
    env = Environment(memory)
    condition = Expression.parse("n > 3").compiled_condition
    assert condition(env) is False
    memory["n"] = 4
    assert condition(env) is True


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a and b or not c == 1", "(a and b) or (not (c == 1))"),
        ("a || b or c && d", "a or b or (c and d)"),
        ("10 - 2 - -3 * 4", "10 - 2 - ((-3) * 4)"),
        ("-2^-n", "-(2 ^ (-n))"),
        ("max(a+1,'x')", 'max(a + 1, "x")'),
        ("name  starts   with 'An'", 'name starts with "An"'),
        ("((a))", "a"),
    ],
)
def test_explicit(text: str, expected: str) -> None:
    assert Expression.parse(text).with_all_brackets == expected


@pytest.mark.parametrize(
    ("text", "key"), [("a", "a"), (" (a.b) ", "a.b"), ("not a", None), ("pi", None), ("true", None)]
)
def test_bare_key(text: str, key: str | None) -> None:
    assert Expression.parse(text).bare_key == key


def test_expressions_are_values() -> None:
    expression = Expression.parse("n > 3")
    assert expression == Expression.parse("n > 3") != Expression.parse("n>3")
    assert len({expression, Expression.parse("n > 3")}) == 1
    assert expression.as_condition({"n": 4})


@pytest.mark.parametrize(
    ("key", "expected"),
    [
        ("n", (True, 5)),
        ("person.name", (True, "Ada")),
        ("person.flat", (True, "flat")),
        ("person.tags.0", (True, "a")),
        ("person.tags.-1", (False, None)),
        ("person.tags.²", (False, None)),
        ("nothing", (True, None)),
        ("gone.name", (False, None)),
    ],
)
def test_lookup(key: str, expected: tuple[bool, Any]) -> None:
    assert lookup(MEMORY, key) == expected


@pytest.mark.slow
def test_long_chains_are_shallow() -> None:
    assert Expression.parse(" or ".join(["f"] * 10_000 + ["t"])).as_condition(MEMORY) is True
    assert Expression.parse(" xor ".join(["t"] * 9_999)).as_condition(MEMORY) is True
    assert Expression.parse(" and ".join(["t"] * 9_999 + ["f"])).as_condition(MEMORY) is False
    assert as_number("+".join(["1"] * 10_000), {}) == 10_000
    assert as_number("1" + "*2/2" * 5_000, {}) == 1


def test_lists_nested_beyond_reason_do_not_crash() -> None:
    def nested() -> list[Any]:
        deep: list[Any] = []
        for _ in range(100_000):
            deep = [deep]
        return deep

    a, b = nested(), nested()
    try:
        assert Expression.parse("a == b").as_condition({"a": a, "b": b}) is False
    finally:
        for deep in (a, b):  # taken apart step by step: freeing it at once would recurse as well
            while deep:
                deep = deep.pop()


# --- texts that are joined ---


@pytest.mark.parametrize(
    ("expression", "memory", "value"),
    [
        ("'Hello ' + name", {"name": "Anna"}, "Hello Anna"),
        ("a + b + a", {"a": "x", "b": "y"}, "xyx"),
        ("a + (b + 'c')", {"a": "x", "b": "y"}, "xyc"),
        ("texts[language] + '!'", {"texts": {"de": "Hallo"}, "language": "de"}, "Hallo!"),
        ("'Hello ' + nobody", {}, "Hello "),
        ("nobody + nothing", {}, 0),
        ("a + b", {"a": 2, "b": 3}, 5),
        ("a + b", {"a": 2, "b": True}, 3),
        ("lower(name) + '_' + name", {"name": "Bo"}, "bo_Bo"),
        ("length(a + b)", {"a": "ab", "b": "c"}, 3),
        ("a + b = 'xy'", {"a": "x", "b": "y"}, True),
        ("not (a + b)", {"a": "", "b": ""}, True),
    ],
)
def test_plus_joins_texts(expression: str, memory: dict[str, Any], value: Any) -> None:
    assert Expression.parse(expression).value(memory) == value


@pytest.mark.parametrize(
    ("expression", "memory"),
    [("'Number ' + n", {"n": 3}), ("a + b", {"a": "x", "b": 1}), ("a + b + c", {"a": 1, "b": 2, "c": "x"})],
)
def test_plus_of_a_text_and_a_number_is_refused_with_the_remedy(expression: str, memory: dict[str, Any]) -> None:
    with pytest.raises(EvaluationError, match=r"joins texts or adds numbers.*with braces"):
        Expression.parse(expression).value(memory)


def test_a_sum_draws_once_by_chance() -> None:
    draws = iter([0.0, 0.99])
    sum_of_words = Expression.parse("words[floor(rand(2))] + words[floor(rand(2))]")
    assert sum_of_words.value({"words": ["a", "b"]}, lambda: next(draws)) == "ab"
