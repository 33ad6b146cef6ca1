"""An expression as a number: what an arithmetic operator makes of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rise_engine.expression import Expression


def as_number(text: str, memory: Mapping[str, Any], rand: Callable[[], float] | None = None) -> int | float:
    """The number of an expression: true is 1, a key that does not exist 0. Raises EvaluationError for other values."""
    result: int | float = Expression.parse(f"0 + ({text})").value(memory, rand)
    return result
