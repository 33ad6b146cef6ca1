"""Every function says what it takes and gives, and the documentation says the same."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from rise_engine.cli import main
from rise_engine.expression import Expression, ExpressionError
from rise_engine.expression.functions import ANY_NUMBER_OF_ARGUMENTS, ARITY, SIGNATURES, Signature

DOCS = Path(__file__).parents[2] / "docs" / "reference" / "conditions.md"


def test_every_function_has_one() -> None:
    assert sorted(each.name for each in SIGNATURES) == sorted(ARITY)


@pytest.mark.parametrize("each", SIGNATURES, ids=lambda each: each.name)
def test_it_is_true(each: Signature) -> None:
    counts = {len(re.findall(r"[\w.]+", call.partition("(")[2])) for call in each.written}
    least, most = ARITY[each.name]
    if most == ANY_NUMBER_OF_ARGUMENTS:
        assert all(call.endswith(", ...)") for call in each.written) and counts == {least + 1}
    else:
        assert counts == {*range(least, most + 1)}
    assert each.name in each.example
    if each.name == "rand":
        drawn = {Expression.parse(each.example).value({}, lambda at=at: at / 100) for at in range(100)}  # type: ignore[misc]
        low, _, high = each.result.partition(" to ")
        assert drawn == {*range(int(low), int(high) + 1)}
    else:
        shown = CliRunner().invoke(main, ["eval", each.example]).output
        value = json.loads(shown.splitlines()[0].removeprefix("value"))
        assert (
            value == pytest.approx(json.loads(each.result))
            if isinstance(value, float)
            else json.dumps(value) == each.result
        )


def test_the_documentation_has_the_same_table() -> None:
    rows = [f"| {each.usage} | {each.meaning} | `{each.example}` | `{each.result}` |" for each in SIGNATURES]
    table = "\n".join(("| function | gives | example | result |", "|---|---|---|---|", *rows))
    assert table in DOCS.read_text("utf-8")


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("rand()", "write `rand(most)` or `rand(least, most)`: a number by chance"),
        ("clamp(1, 2)", "write `clamp(x, low, high)`"),
        ("atan2(1)", "write `atan2(y, x)`: the angle in radians"),
        ("min(1)", "write `min(a, b, ...)`"),
        ("abs(1,5)", "numbers have a point"),
    ],
)
def test_a_wrong_number_of_arguments_names_it(text: str, hint: str) -> None:
    with pytest.raises(ExpressionError) as error:
        Expression.parse(text)
    assert hint in error.value.hint


def test_eval_lists_them() -> None:
    result = CliRunner().invoke(main, ["eval", "--functions"])
    assert result.exit_code == 0
    for each in SIGNATURES:
        assert ", ".join(each.written) in result.output and f"    {each.example} = {each.result}" in result.output
    told = json.loads(CliRunner().invoke(main, ["eval", "--functions", "--json"]).output)
    assert [each["name"] for each in told["functions"]] == [each.name for each in SIGNATURES]
    assert CliRunner().invoke(main, ["eval"]).exit_code == 2
