"""The values of the real parser: all must agree (see data/README.md)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from rise_engine.expression import Expression, ExpressionError
from tests.expression.numbers import as_number

_FILE = Path(__file__).parent / "data" / "upstream-cases.tsv"
ROWS = [line.split("\t") for line in _FILE.read_text(encoding="utf-8").splitlines()[1:]]


def test_the_file_is_whole() -> None:
    assert len(ROWS) == 131


@pytest.mark.parametrize(("text", "memory", "read_as", "value"), ROWS)
def test_same_as_upstream(text: str, memory: str, read_as: str, value: str) -> None:
    expression_text, values = json.loads(text), json.loads(memory)
    if value == "REFUSED":
        with pytest.raises(ExpressionError):
            Expression.parse(expression_text)
        return
    expression = Expression.parse(expression_text)
    result: Any = (
        expression.as_condition(values)
        if read_as == "condition"
        else as_number(expression_text, values, rand=lambda: 0.5)
    )
    expected = json.loads(value)
    assert result == pytest.approx(expected, rel=1e-15, abs=0)
    assert isinstance(result, bool) == (read_as == "condition")
