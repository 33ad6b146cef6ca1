"""What a property of a study asks for the situation."""

from __future__ import annotations

from rise_engine.expression import Expression
from rise_engine.expression.nodes import SituationTest, walk


def situation_tests(expression: Expression) -> list[SituationTest]:
    """All that it asks."""
    return [node for node, _ in walk(expression.root) if isinstance(node, SituationTest)]
