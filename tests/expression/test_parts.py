"""Parts of values by index: what is read and set, and the one ending of what is not there (semantics.md 8.4, 8.5)."""

from __future__ import annotations

import copy
from collections.abc import Sequence
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
    MissingPartError,
)
from rise_engine.expression.assignment import MAX_BYTES

MEMORY: dict[str, Any] = {
    "items": [{"text": "one", "n": 1, "none": None}, {"text": "two", "n": 2, "in": [[7, 8]]}],
    "i": 1,
    "order": [1, 0],
    "texts": {"A": ["x", "y"], "B b": "z", "3": "third", "": "empty"},
    "condition": "A",
    "person": {"names": ["Ada", "Eve"]},
    "flat.key": [5],
    "flat": {"key": [6]},
    "e": [1, 2, 3],
    "half": 0.5,
    "name": "text",
    "yes": True,
}

READ = {
    "items[0].text": "one",
    "items[i].text": "two",
    "items[order[i]].text": "one",
    "items[i - 1].n + 1": 2,
    "items[2 - 1].text": "two",
    "items[half * 2].text": "two",
    "items[0]['text']": "one",
    "items[0][name]": "one",
    "items[1].in[0][1]": 8,
    "items[1].in.0.1": 8,
    "items[i].in[0].1": 8,
    "items [ 0 ].text": "one",
    "items[0].none": None,
    "texts[condition][1]": "y",
    "texts['B b']": "z",
    "texts[3]": "third",
    "texts[1 + 2]": "third",
    "texts['']": "empty",
    "person.names[1]": "Eve",
    "flat.key[0]": 5,
    "e[2]": 3,
    "order[0] = 1 and not items[0].none": True,
    "-order[0]": -1,
    "order[0] ^ 2 + 1": 2,
    "length(items[1].in)": 1,
    "lower(items[0].text) starts with 'o'": True,
    "items[0] = items[order[1]]": True,
    "range(5)[4]": 4,
    "defined(items[1].in)": True,
    "defined(items[0].none)": True,
    "defined(items[0].in)": False,
    "defined(items[9])": False,
    "defined(nobody[0])": False,
    "defined(items[order[7]].text)": False,
    "defined(name[0])": False,
}


@pytest.mark.parametrize(("text", "expected"), READ.items())
def test_read(text: str, expected: object) -> None:
    value = Expression.parse(text).value(MEMORY)
    assert (value, type(value)) == (expected, type(expected))


MISSING = {
    "items[2].text": "`items` has the entries 0 to 1, and no 2",
    "items[-1]": "`items` has the entries 0 to 1, and no -1",
    "person.names[5]": "`person.names` has the entries 0 to 1, and no 5",
    "e[0][0]": "`e[0]` is the number 1, which has no parts",
    "items[half]": "whole numbers from 0 on, not by the number 0.5",
    "items['0']": "whole numbers from 0 on, not by `0`",
    "items[yes]": "whole numbers from 0 on, not by true",
    "items[null]": "whole numbers from 0 on, not by null",
    "items[nobody]": "whole numbers from 0 on, not by a key that does not exist",
    "items[0 / 0]": "whole numbers from 0 on, not by the number nan",
    "items[i].in[0].2": "`items[i].in[0]` is a list",
    "items[0].txt": "`items[0]` has no `txt`",
    "items[order[i]].in": "`items[order[i]]` has no `in`",
    "items[0].none.x": "`items[0].none` is null, which has no parts",
    "items[0].text[0]": '`items[0].text` is the text "one", which has no parts',
    "texts['C']": "`texts` has no `C`",
    "texts[true]": "true names nothing in `texts`",
    "texts[order]": "a list names nothing in `texts`",
    "texts[0.5]": "the number 0.5 names nothing in `texts`",
    "nobody[0]": "the memory has no `nobody`",
    "person.ages[0]": "the memory has no `person.ages`",
    "range(0)[0]": "`range(0)` has no entries, and no 0",
    "range(1)[1]": "`range(1)` has one entry, 0, and no 1",
}


@pytest.mark.parametrize(("text", "why"), MISSING.items())
def test_what_is_not_there_has_one_ending(text: str, why: str) -> None:
    expression = Expression.parse(text)
    for read in (expression.value, expression.as_condition, Expression.parse(f"1 + ({text})").value):
        with pytest.raises(MissingPartError) as error:
            read(MEMORY)
        assert str(error.value).startswith("missing-part: ") and why in str(error.value)


def test_an_error_in_an_index_is_that_error() -> None:
    with pytest.raises(EvaluationError, match="is not a number") as error:
        Expression.parse("defined(items[name + 1])").value(MEMORY)
    assert not isinstance(error.value, MissingPartError)


KEYS = {
    "items[i].text": ({"items", "i"}, {"items"}),
    "items[order[i]].text = name": ({"items", "order", "i", "name"}, {"items", "order"}),
    "items[length(items) - 1]": ({"items"}, set()),
    "defined(items[i])": ({"items", "i"}, {"items"}),
    "defined(items[i]) and defined(items)": ({"items", "i"}, set()),
    "shuffle(a)[b]": ({"a", "b"}, set()),
    "e[0]": ({"e"}, {"e"}),
    "a.b[c.d]": ({"a.b", "c.d"}, {"a.b"}),
    "'[' = a": ({"a"}, set()),
}


@pytest.mark.parametrize(("text", "expected"), KEYS.items())
def test_keys(text: str, expected: tuple[set[str], set[str]]) -> None:
    expression = Expression.parse(text)
    assert (expression.keys, expression.keys_of_parts_only) == expected
    assert expression.constants == set()


def test_what_was_read_is_collected_under_its_written_name() -> None:
    parts: dict[str, Any] = {}
    env = Environment(MEMORY, parts=parts)
    text = "items[ order[i] ].text = 'one' and items[9].n > 1 and items[0].n = 1"
    with pytest.raises(MissingPartError):
        Expression.parse(text).compiled_condition(env)
    assert parts == {"items[ order[i] ].text": "one", "order[i]": 0, "items[9].n": None}


SET = {
    "items[i].text = 'new'": ("items", 1, "text", "new"),
    "items[order[i]].done = true": ("items", 0, "done", True),
    "items[0] = i": ("items", 0, 1),
    "texts[condition][0] = 'w'": ("texts", "A", 0, "w"),
    "texts['C'] = [1, 2]": ("texts", "C", [1, 2]),
    "texts[7] = null": ("texts", "7", None),
    "person.names[1] = 'Lin'": ("person", "names", 1, "Lin"),
    "flat.key[0] = 9": ("flat.key", 0, 9),
    "items[1].in.0.1 = items[0]": ("items", 1, "in", [[7, MEMORY["items"][0]]]),
    "items[0].text = word": ("items", 0, "text", "word"),
}


@pytest.mark.parametrize(("text", "expected"), SET.items())
def test_set(text: str, expected: tuple[Any, ...]) -> None:
    key, *way, value = expected
    before = copy.deepcopy(MEMORY)
    changed, whole = Assignment.parse(text).entry(Environment(MEMORY))
    assert before == MEMORY, "what was there is copied"
    assert (changed, reach(whole, way)) == (key, value)


NOT_SET = {
    "items[2].text = 1": "`items` has the entries 0 to 1, and no 2",
    "items[length(items)] = 1": "`items` has the entries 0 to 1, and no 2",
    "items[0].a.b = 1": "`items[0]` has no `a`",
    "items['x'] = 1": "whole numbers from 0 on",
    "nobody[0] = 1": "the memory has no `nobody`",
    "person.ages[0] = 1": "the memory has no `person.ages`",
    "name[0] = 'T'": '`name` is the text "text", which has no parts',
    "items[0].none.x = 1": "`items[0].none` is null, which has no parts",
    "texts[true] = 1": "true names nothing in `texts`",
    "items[0] = items[7]": "and no 7",
}


@pytest.mark.parametrize(("text", "why"), NOT_SET.items())
def test_nothing_is_set_where_nothing_is(text: str, why: str) -> None:
    with pytest.raises(MissingPartError) as error:
        Assignment.parse(text).entry(Environment(MEMORY))
    assert str(error.value).startswith("missing-part: ") and why in str(error.value)


REFUSED = [
    ("items[0 = 1", 6, "add `]`"),
    ("items[] = 1", 6, "there is nothing between"),
    ("items[0]", 9, "write `items[0] = value`"),
    ("items[0] == 1", 10, "write a single `=`"),
    ("items[0] += 1", 10, "write `items[0] = items[0] + ...`"),
    ("items[0] 1", 10, "there must be a `=`"),
    ("items[0]. = 1", 9, "there must be a `=`"),
    ("items[0 +] = 1", 10, "a value is missing"),
    ("items[0] = ", 12, "there is no value after the `=`"),
    ("items[0] .x = 1", 10, "there must be a `=`"),
    ("shuffle(x)[0] = 1", 8, "is not allowed in a key"),
]


@pytest.mark.parametrize(("text", "column", "part"), REFUSED)
def test_refused(text: str, column: int, part: str) -> None:
    with pytest.raises(ExpressionError) as error:
        Assignment.parse(text)
    assert part in str(error.value) and error.value.column == column


def test_the_right_side_comes_first_and_all_read_what_was_before() -> None:
    drawn = iter([0.9, 0.1])
    env = Environment({"a": [0, 0], "i": 1}, lambda: next(drawn))
    assert Assignment.parse("a[floor(rand(2))] = rand(1)").entry(env) == ("a", [0.9, 0])
    assert Assignment.parse("a[i] = a").entry(env) == ("a", [0, [0, 0]])


def test_a_value_does_not_grow_without_end() -> None:
    memory: dict[str, Any] = {"a": [0, "x" * 40_000], "b": [0] * 1_000, "big": ["y" * MAX_BYTES]}
    with pytest.raises(EvaluationError, match=r"would have .* bytes as JSON; at most 100,000 are allowed"):
        for _ in range(3):
            _, memory["a"] = Assignment.parse("a[0] = a").entry(Environment(memory))
    assert Assignment.parse("copy = big").entry(Environment(memory))[1] is memory["big"], "as it always was"
    with pytest.raises(EvaluationError, match="bytes as JSON"):
        Assignment.parse("copy = big").entry(Environment(memory), limited=True)
    nested: Any = []
    for _ in range(70):
        nested = [nested]
    with pytest.raises(EvaluationError, match="nested too deeply"):
        Assignment.parse("b[0] = c").entry(Environment({"b": [0], "c": nested}))


# --- whatever the value is --------------------------------------------------------------------------------------------

JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-5, 5) | st.text(max_size=3),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=3), inner, max_size=4),
    max_leaves=12,
)


def all_paths(value: Any) -> list[tuple[int | str, ...]]:
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [path for step, each in inner for path in ((step,), *((step, *rest) for rest in all_paths(each)))]


@given(st.lists(JSON, min_size=1, max_size=4) | st.dictionaries(st.text(max_size=3), JSON, min_size=1), JSON, st.data())
def test_what_is_set_is_what_is_read(value: Any, new: Any, data: st.DataObject) -> None:
    path = data.draw(st.sampled_from(all_paths(value)))
    memory = {"value": value, "new": new, **{f"k{at}": step for at, step in enumerate(path)}}
    written = "value" + "".join(f"[k{at}]" for at in range(len(path)))
    before = copy.deepcopy(memory)
    key, memory["value"] = Assignment.parse(f"{written} = new").entry(Environment(memory))
    assert key == "value" and before["value"] == value
    assert Expression.parse(written).value(memory) == new
    for other in all_paths(value):
        if other[: len(path)] != path and path[: len(other)] != other:
            assert reach(memory["value"], other) == reach(value, other), "nothing else has changed"


def reach(value: Any, path: Sequence[int | str]) -> Any:
    for step in path:
        value = value[step]
    return value
