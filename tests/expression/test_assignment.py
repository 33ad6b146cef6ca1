"""`assignValue`: what can be assigned to what, and what the memory holds afterwards."""

from __future__ import annotations

import copy
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rise_engine.expression import (
    Assignment,
    Environment,
    EvaluationError,
    Expression,
    ExpressionError,
    assigned_entry,
    lookup,
)

MEMORY: dict[str, Any] = {"n": 5, "name": "Ada", "person": {"age": 36, "at": {"x": 1}}, "list": [1, [2]], "a.b": 1}

VALUES = {
    "interaction_finished = true": ("interaction_finished", True),
    "x=1": ("x", 1),
    " n = n + 1 ": ("n", 6),
    "x = n / 2": ("x", 2.5),
    "x = -3": ("x", -3),
    "x = n > 3 and true": ("x", True),
    "x = null": ("x", None),
    'x = "a = b"': ("x", "a = b"),
    'x = "a\\n\\"b\\""': ("x", 'a\n"b"'),
    "x = 'single'": ("x", "single"),
    'x = [1, -2.5, {"a": null}]': ("x", [1, -2.5, {"a": None}]),
    'person.age = {"years": 1}': ("person.age", {"years": 1}),
    "x = Andre": ("x", "Andre"),
    "x = name": ("x", "Ada"),
    "x = person.age": ("x", 36),
    "x = known": ("x", None),
    "x = known.part": ("x", None),
    "x = pi * 0": ("x", 0),
    '{"x": {"a": [1, true]}}': ("x", {"a": [1, True]}),
    '{"a key": "v"}': ("a key", "v"),
    "größe = 1": ("größe", 1),
}


@pytest.mark.parametrize(("text", "expected"), VALUES.items())
def test_assigned(text: str, expected: tuple[str, Any]) -> None:
    assignment = Assignment.parse(text)
    value = assignment.evaluate(Environment(MEMORY), known_keys={"known"})
    assert (assignment.key, value) == expected
    assert type(value) is type(expected[1])


def test_the_keys_of_the_right_side() -> None:
    assignment = Assignment.parse("n = n + gone.x")
    assert assignment.keys == {"n", "gone.x"}
    assert assignment.bare_word is None
    assert Assignment.parse("n = word").bare_word == "word"
    assert Assignment.parse("n = [1]").keys == frozenset()
    assert Assignment.parse("n = true").bare_word is None
    missing: set[str] = set()
    Assignment.parse("x = known").evaluate(Environment(MEMORY, missing=missing), {"known"})
    assert missing == {"known"}


REFUSED = [
    ("", 1, "empty"),
    ("x", 2, "write `x = value`"),
    ("= 1", 1, "no key before"),
    ("x =", 4, "no value after"),
    ("x == 1", 3, "write a single `=`"),
    ("x := 1", 3, "write a single `=`"),
    ("x += 1", 3, "write `x = x + ...`"),
    ("2x = 1", 1, "begin it with a letter"),
    ("my-key = 1", 3, "is not allowed in a key"),
    ("my key = 1", 4, "a key has no blanks"),
    ("n² = 1", 2, "write `^2`"),
    ("true = 1", 1, "cannot be a key"),
    ("x = 1 +", 8, "missing after `+`"),
    ("x = Andre Miller", 11, 'put a text in quotes: `"Andre Miller"`'),
    ("x = (1", 5, "add `)`"),
    ("x = [1, 2", 5, "not valid JSON: this array is never closed"),
    ("x = [1, 'a']", 9, "double quotation marks"),
    ("x = [1] 2", 9, "something follows"),
    ("x = [NaN]", 6, "NaN is not a JSON value"),
    ("x = [-Infinity]", 6, "-Infinity is not a JSON value"),
    ("x = [1e999]", 6, "too large"),
    ('x = {"a": 1, "a": 2}', 14, "there twice"),
    ('x = ["\\ud800"]', 7, "half of a character"),
    ("x = [" + "1" * 5000 + "]", 6, "64 bits"),
    ("x = " + "[" * 5000, 69, "more than 64 deep"),
    ("x = " + "[" * 150 + "]" * 150, 69, "more than 64 deep"),
    ("{}", 1, "has no key"),
    ('{"": 1}', 1, "cannot be empty"),
    ('{"a": 1, "b": 2}', 1, "more than one key"),
    ('{"a": 1, "a": 2}', 10, "there twice"),
    (" {key: 1}", 3, "not valid JSON"),
    ('x = ["\ud800"]', 7, "half of a character"),
    ("x = [“a”]", 6, "typographic quotation mark"),
    ("x = [1,\u00a02]", 8, "only looks like a blank"),
    ("x = " + "1" * 100_000, 1, "longer than"),
]


@pytest.mark.parametrize(("text", "column", "part"), REFUSED, ids=[text[:30] for text, _, _ in REFUSED])
def test_refused(text: str, column: int, part: str) -> None:
    with pytest.raises(ExpressionError) as caught:
        Assignment.parse(text)
    assert part in str(caught.value)
    assert caught.value.column == column
    assert text.startswith(caught.value.text)


@pytest.mark.parametrize("text", ["x = 1/0", "x = 0/0", "x = -1/0", "x = name + 1"])
def test_what_a_memory_cannot_hold(text: str) -> None:
    with pytest.raises(EvaluationError):
        Assignment.parse(text).evaluate(Environment(MEMORY))


def test_several_keys_at_once() -> None:
    text = '{"b": 1, "a": [2]}'
    assignments = Assignment.parse_all(text)
    assert [(assignment.key, assignment.literal) for assignment in assignments] == [("b", 1), ("a", [2])]
    assert len(set(assignments)) == 2


STORED = {
    "new": ("new", 0),
    "n": ("n", 0),
    "new.part": ("new.part", 0),
    "name.part": ("name.part", 0),
    "a.b": ("a.b", 0),
    "person.age": ("person", {"age": 0, "at": {"x": 1}}),
    "person.city": ("person", {"age": 36, "at": {"x": 1}, "city": 0}),
    "person.at.x": ("person", {"age": 36, "at": {"x": 0}}),
    "person.home.street": ("person", {"age": 36, "at": {"x": 1}, "home": {"street": 0}}),
    "list.0": ("list", [0, [2]]),
    "list.1.0": ("list", [1, [0]]),
}


@pytest.mark.parametrize(("key", "expected"), STORED.items())
def test_stored(key: str, expected: tuple[str, Any]) -> None:
    before = copy.deepcopy(MEMORY)
    top, value = assigned_entry(MEMORY, key, 0)
    assert (top, value) == expected
    assert before == MEMORY, "the memory itself must not change"
    assert lookup({**MEMORY, top: value}, key) == (True, 0)


@pytest.mark.parametrize("key", ["person.age.years", "list.2", "list.x", "list.0.x", "list.1.7"])
def test_no_place_to_store(key: str) -> None:
    with pytest.raises(EvaluationError):
        assigned_entry(MEMORY, key, 0)


PARTS = st.sampled_from(["a", "b", "0", "1"])
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(PARTS, inner, max_size=3),
    max_leaves=8,
)
KEYS = st.lists(PARTS, min_size=1, max_size=4).map(".".join)


@given(st.dictionaries(KEYS, JSON, max_size=4), KEYS, JSON)
def test_what_is_stored_is_read_back(memory: dict[str, Any], key: str, value: Any) -> None:
    before = copy.deepcopy(memory)
    try:
        top, new = assigned_entry(memory, key, value)
    except EvaluationError:
        assert memory == before
        return
    assert memory == before
    assert lookup({**memory, top: new}, key) == (True, value)


@given(
    st.text() | st.lists(st.sampled_from(["x", " ", "=", "[", "{", '"a"', ":", "1", ",", "]", "}", "."])).map("".join)
)
def test_any_text_is_read_or_refused(text: str) -> None:
    try:
        Assignment.parse_all(text)
    except ExpressionError as error:
        assert 1 <= error.column <= len(text) + 1


@pytest.mark.parametrize(
    ("right", "value"),
    [
        ("1732150000000000001", 1732150000000000001),
        ("-1732150000000000001", -1732150000000000001),
        ("9223372036854775807", 2**63 - 1),
        ("-9223372036854775808", -(2**63)),
        ("9223372036854775808", 2.0**63),
        ("2^60 + 0", 2**60),
        ("1e18", 10**18),
    ],
)
def test_whole_numbers_of_64_bits(right: str, value: object) -> None:
    stored = Assignment.parse(f"a = {right}").evaluate(Environment({}))
    assert stored == value and type(stored) is type(value)
    assert Expression.parse(f"a == {right}").as_condition({"a": stored})


@pytest.mark.parametrize("text", ["a = [9223372036854775808]", '{"a": -9223372036854775809}'])
def test_json_of_more_than_64_bits(text: str) -> None:
    with pytest.raises(ExpressionError, match=r"64 bits.*as a text"):
        Assignment.parse(text)


def test_one_depth_for_all() -> None:
    assert Assignment.parse("a = " + "[" * 64 + "]" * 64).literal
    with pytest.raises(ExpressionError, match="64"):
        Assignment.parse("a = " + "[" * 65 + "]" * 65)
    deep = Assignment.parse("a = " + "[" * 63 + "]" * 63).literal
    assert assigned_entry({"o": {}}, "o.x", deep) == ("o", {"x": deep})
    with pytest.raises(EvaluationError, match="64"):
        assigned_entry({"o": {}}, "o.x.y", deep)
    with pytest.raises(EvaluationError, match="64"):
        assigned_entry({"o": {}}, "o" + ".x" * 65, 1)
    assert assigned_entry({"o": {}}, "o" + ".x" * 64, 1)[0] == "o"
    memory: dict[str, object] = {"o": {}}
    with pytest.raises(EvaluationError, match="64"):
        for _ in range(100):  # an object put into itself, again and again
            top, value = assigned_entry(memory, "o.o", memory["o"])
            memory[top] = value
