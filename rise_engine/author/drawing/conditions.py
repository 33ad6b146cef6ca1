"""Whether a condition holds now, and its parts as the author wrote them. Pure."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, Literal, NamedTuple

from rise_engine.expression import EvaluationError, Expression, LanguageError
from rise_engine.expression.nodes import Logic, with_all_brackets

Joint = Literal["and", "or", ""]

_PIECE = re.compile(r'"(?:[^"\\]|\\.)*"|\'(?:[^\'\\]|\\.)*\'|[()\[\]]|&&|\|\||[^\W\d][\w.]*', re.DOTALL)
_LEVELS = {"(": 1, "[": 1, ")": -1, "]": -1}
_JOINTS = {"and": ("and", "&&"), "or": ("or", "||")}


def is_met(condition: Expression | None, memory: Mapping[str, Any]) -> bool:
    """Return whether a condition holds with these values: `None` always holds, a condition with an error never does."""
    if condition is None:
        return True
    try:
        return condition.as_condition(memory)
    except EvaluationError:
        return False


class ConditionParts(NamedTuple):
    joint: Joint
    """The operator between them; empty for a condition of one part."""
    parts: tuple[Expression, ...]


@lru_cache(512)
def split_condition(condition: Expression) -> ConditionParts:
    """Split a condition at its top-level `and` or `or`; `xor` is not split."""
    root = condition.root
    if not isinstance(root, Logic) or root.operator not in _JOINTS:
        return ConditionParts("", (condition,))
    try:
        texts = _split_text(condition.text, _JOINTS[root.operator])
        found = tuple(Expression.parse(text) for text in texts)
        if tuple(part.root for part in found) != root.operands:  # the text's own pieces mean something else
            found = tuple(Expression.parse(with_all_brackets(operand)) for operand in root.operands)
    except LanguageError:
        return ConditionParts("", (condition,))
    return ConditionParts("and" if root.operator == "and" else "or", found)


def _split_text(text: str, joints: tuple[str, ...]) -> list[str]:
    """Split the text at these words where they are outside of brackets and quotes."""
    bare = text.strip()
    while bare.startswith("(") and _find_closing(bare) == len(bare) - 1:
        bare = bare[1:-1].strip()
    pieces, depth, start = [], 0, 0
    for found in _PIECE.finditer(bare):
        depth += _LEVELS.get(found[0], 0)
        if not depth and found[0] in joints:
            pieces.append(bare[start : found.start()].strip())
            start = found.end()
    return [*pieces, bare[start:].strip()]


def _find_closing(text: str) -> int:
    """Find where the bracket that opens a text is closed."""
    depth = 0
    for found in _PIECE.finditer(text):
        depth += _LEVELS.get(found[0], 0)
        if not depth:
            return found.start()
    return -1
