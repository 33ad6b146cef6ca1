"""How RISE's parser reads a text, and when authors are warned that it reads theirs differently."""

from __future__ import annotations

import pytest

from rise_engine.expression import Expression
from rise_engine.expression.rise1_compat import rise1_difference, rise1_reading

READINGS = {
    "a and b or c": "(a and b) or c",
    "a or b xor c": "a or (b xor c)",
    "not a == b": "(not a) == b",
    "not n > 10": "(not n) > 10",
    "!a == b": "(not a) == b",
    "a ^ 2 > 3": "a xor (2 > 3)",
    "2^3 == 8": "2 xor (3 == 8)",
    "(2^3) == 8": "(2 ^ 3) == 8",
    "(2 ^ 3 ^ 2) == 512": "(2 ^ (3 ^ 2)) == 512",
    "n > m == true": "(n > m) == true",
    "1 + n > 2": "(1 + n) > 2",
    "a == m + 1 > 2": "a == (m + (1 > 2))",
    "2 - -3 == 5": "(2 - 3) == 5",
    "a - b + c > 0": "(a - b + c) > 0",
    "a + b - c > 0": "(a + b - c) > 0",
    "8 * 4 / 2 == 16": "(8 * 4 / 2) == 16",
    "-a * b > 0": "(-(a * b)) > 0",
    "not(a)": "a",
    "not (a)": "not a",
    "!(a)": "not a",
    "(a) b": "a",
    "garbage (a)": "a",
    "2(3)": "3",
    "foo(7)": "7",
    "abs(n) > 3": "abs(n) > 3",
    "abs(n)": "n",
    "a and(b)": "b",
    "a &&": "a",
    "2 + == 2": "2 == 2",
    "n=5": "n=5",
    "n = 5": "n == 5",
    'not name = "x"': '(not name) == "x"',
    'name starts with "An"': 'name starts with "An"',
    'name contains "a or b"': 'name contains "a or b"',
    "a  and  b": "a and b",
    "t && !f": "t and (not f)",
    "a == b == c": None,
    "a AND b": None,
    "a\tand\tb": "a\tand\tb",
    "1e-3 > 0": None,
    "a * -1 > 0": None,
    "äx": None,
    "()": None,
    "(a": None,
    "": None,
    "$B9§": None,
    "a\ue0000\ue001": None,
    "a = '\\x'": None,
    "||": None,
    "not " * 3 + "a": "not (not (not a))",
    "(" * 500 + "a" + ")" * 500: None,
}


@pytest.mark.parametrize(("text", "expected"), READINGS.items(), ids=[text[:30] for text in READINGS])
def test_reading(text: str, expected: str | None) -> None:
    assert rise1_reading(text) == expected


ALIKE = [
    "H_interaction_detected",
    "interaction_finished",
    "not interaction_finished",
    "not a and not b",
    "(H_score > 3 and H_engaged) or not interaction_finished",
    '(H_score > 3 and name starts with "An") or not finished',
    "a.b = 'it is' and n != 3",
    "x > -1",
    "count * 2 - 1 == 3",
    "participant_number / 2 == 1",
    "a && b || c",
    "not (a > 3)",
    "(n > 3) == (m > 3)",
    "max(n, m) - min(n, m) > 2",
    "-2 * 3 < n",
    "a or b xor c and d",
    "((a) and (c))",
    "b == false",
    "name contains 'x' and not (n = 5)",
    "abs (n) > 1",
]


@pytest.mark.parametrize("text", ALIKE)
def test_no_warning(text: str) -> None:
    assert rise1_difference(Expression.parse(text)) is None


WARNED = {
    "not n > 3": "RISE reads this as `(not n) > 3`; write `not (n > 3)` to have the same meaning in both",
    "not a == b": "RISE reads this as `(not a) == b`; write `not (a == b)` to have the same meaning in both",
    'not name = "x"': 'RISE reads this as `(not name) == "x"`; write `not (name == "x")` to have the same meaning',
    "2^3 == 8": "RISE reads this as `2 xor (3 == 8)`; write `(2 ^ 3) == 8` to have the same meaning in both",
    "not(a)": "RISE reads this as `a`; write `not a` to have the same meaning in both",
    "2 - -3 == 5": "RISE reads this as `(2 - 3) == 5`; write `(2 - (-3)) == 5` to have the same meaning in both",
    "n=5": "RISE reads `n=5` as the name of one key; write `n == 5` to have the same meaning in both",
    'name="x"': 'RISE reads `name="x"` as the name of one key; write `name == "x"` to have the same meaning in both',
    "abs(n)": "RISE reads this as `n`; write `abs(n) > 0` to have the same meaning in both",
    "a ^ 2": "RISE reads this as `a xor 2`; write `(a ^ 2) > 0` to have the same meaning in both",
    "a and(b)": "RISE reads this as `b`; write `a and b` to have the same meaning in both",
    "length(name) > 3": "RISE reads this as `name > 3`",
    "a * -1 > 0": "RISE refuses this: a value is missing; write `(a * (-1)) > 0` to have the same meaning in both",
    "n > 1e-3": "write `n > 0.001` to have the same meaning in both",
    "a\tand b": "RISE refuses this: it cannot split this into values and operators; write `a and b`",
    "größe > 3 and äx": "RISE refuses this: a key must begin with a letter from a to z or `_`, not with `ä`",
    "n > m + 1 == a + 2 > 3": "RISE reads this as",
    "not not a == b": "RISE reads this as `(not (not a)) == b`",
}


@pytest.mark.parametrize(("text", "expected"), WARNED.items())
def test_warning(text: str, expected: str) -> None:
    warning = rise1_difference(Expression.parse(text))
    assert warning is not None
    assert expected in warning
    if "write" not in expected:
        return
    remedy = warning.rpartition("write `")[2].partition("` to have")[0]
    assert rise1_difference(Expression.parse(remedy)) is None
