"""The emulation behind `rise1_compat`: splits a text as the public LogicExpressionParser does (2024 version, point as
decimal sign, comma as separator). It has two entries, one for truth values and one for numbers, that call each other.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from rise_engine.errors import RiseError
from rise_engine.expression.errors import ExpressionError
from rise_engine.expression.functions import CONSTANTS, NUMERIC
from rise_engine.expression.nodes import (
    Chain,
    Compare,
    FunctionCall,
    Key,
    Literal,
    Logic,
    NamedConstant,
    Negative,
    Node,
    Not,
    Power,
)
from rise_engine.expression.tokens import number_of, unquote

_TEXT = re.compile(r'"(?:[^"\\]|\\.)*"|' + r"'(?:[^'\\]|\\.)*'", re.DOTALL)
_BUDGET = 20
"""The parser's own limit; it counts at number literals only."""
_MOST_LEVELS = 150
"""Where this emulation gives up, far beyond what authors write."""
_OPEN, _CLOSE = "$B", "§"
_TEXT_MARK = re.compile(r"\ue000(\d+)\ue001")
_BRACKET = re.compile(r"[()]")
_BRACKET_MARK = re.compile(r"\$B(\d+)§")
_NUMBER = re.compile(r"\s*[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?\s*", re.ASCII)
_TEXT_OPERATOR = re.compile(r"(?<=[\w\s§\ue001])\b(starts\s+with|ends\s+with|contains)\b")
_LOGIC = (("or", " or ", "||"), ("xor", " xor ", "^"), ("and", " and ", "&&"))
_COMPARISONS = ("==", "!=", ">=", ">", "<=", "<")
_FUNCTIONS = frozenset(NUMERIC) | {"rand"}


class Rise1RefusalError(RiseError):
    """RISE's own parser would refuse this condition; the message says why in an author's words."""


def split_as_rise1(text: str) -> Node:
    """What the parser makes of a text that stands as a condition. Raises Rise1RefusalError."""
    return _Splitter().split(text)


class _Splitter:
    __slots__ = ("brackets", "levels", "texts")

    def __init__(self) -> None:
        self.brackets: list[str] = []
        self.texts: list[str] = []
        self.levels = 0

    def split(self, text: str) -> Node:
        masked = _TEXT.sub(self._hide_text, text) if "\ue000" not in text else "$"
        if "$" in masked or _CLOSE in masked:
            raise Rise1RefusalError("it has a character that the parser uses for itself")
        return self._split_truth(masked.replace(" = ", " == "), _BUDGET)

    def _split_truth(self, text: str, budget: int) -> Node:
        """The entry for truth values."""
        return self._descend(self._truth, text, budget)

    def _split_number(self, text: str, budget: int) -> Node:
        """The entry for numbers: the sides of comparisons, and arguments."""
        return self._descend(self._number, text, budget)

    def _descend(self, split: Callable[[str, int], Node], text: str, budget: int) -> Node:
        if self.levels > _MOST_LEVELS:
            raise Rise1RefusalError("it is nested too deeply")
        text = self._cut_out_brackets(text)
        self.levels += 1
        try:
            return split(text, budget - 1)
        finally:
            self.levels -= 1

    def _truth(self, text: str, budget: int) -> Node:
        for operator, *spellings in _LOGIC:
            for spelling in spellings:
                if spelling in text:
                    return self._logic(operator, text.split(spelling), budget)
        for operator in _COMPARISONS:
            if operator in text:
                sides = [side for side in text.split(operator) if side]
                if len(sides) != 2:
                    raise Rise1RefusalError(f"`{operator}` must have a value on each side")
                return Compare(operator, self._split_number(sides[0], budget), self._split_number(sides[1], budget))
        word = _TEXT_OPERATOR.search(text)
        if word is not None and text[: word.start()].strip() and text[word.end() :].strip():
            left, right = (
                self._split_number(text[: word.start()], budget),
                self._split_number(text[word.end() :], budget),
            )
            return Compare(" ".join(word[1].split()), left, right)
        if text.startswith("not "):
            return Not(self._split_truth(text[4:], budget))
        if text.startswith("!"):
            return Not(self._split_truth(text[1:], budget))
        if text in ("true", "false"):
            return Literal(text == "true")
        if _BRACKET_MARK.search(text):
            return self._split_truth(self._bracket_content(text), budget)
        return self._leaf(text) or self._fall_back(text, budget)

    def _number(self, text: str, budget: int) -> Node:
        if "," in text:  # a list outside a function: only its first value counts
            values = [self._split_number(part, budget) for part in text.split(",") if part.strip()]
            return values[0] if values else Literal(0)
        if "+" in text:
            parts = [part for part in text.split("+") if part.strip()]
            return _chain([("+", self._split_number(part, budget), "-" in part) for part in parts])
        for sign, inverse in (("+", "-"), ("*", "/")):
            if sign == "*" and "*" in text:
                return _chain([("*", self._split_number(part, budget), "/" in part) for part in text.split("*")])
            if inverse in text:
                first, *others = text.split(inverse)
                steps = [(sign, self._split_number(first, budget), False)] if first.strip() else []
                steps += [(inverse, self._split_number(part, budget), False) for part in others if part.strip()]
                return _chain(steps)
        if "^" in text:
            base, _, exponent = text.partition("^")
            return Power(self._split_number(base, budget), self._split_number(exponent, budget))
        name, mark, after = text.partition(_OPEN)
        if mark and name.strip() in _FUNCTIONS:
            return FunctionCall(name.strip(), self._arguments(self._bracket_content(mark + after), budget))
        if _BRACKET_MARK.search(text):
            return self._split_number(self._bracket_content(text), budget)
        if _NUMBER.fullmatch(text):
            return Literal(number_of(text.strip()))  # in truth a double; how exact it is makes no other reading
        leaf = self._leaf(text)
        if leaf is not None:
            return leaf
        if budget <= 0:
            raise Rise1RefusalError("it cannot split this into values and operators")
        return self._split_truth(text, budget)

    def _cut_out_brackets(self, text: str) -> str:
        """The text with a mark for each of its outermost brackets."""
        text = text.strip()
        if "(" not in text:
            return text
        pieces: list[str] = []
        at = start = level = 0
        for mark in _BRACKET.finditer(text):
            if mark[0] == "(":
                if level == 0:
                    start = mark.start()
                level += 1
            elif level > 0:
                level -= 1
                if level == 0:
                    if mark.start() == start + 1:
                        raise Rise1RefusalError("a bracket is empty or not closed")
                    pieces += (text[at:start], f"{_OPEN}{len(self.brackets)}{_CLOSE}")
                    self.brackets.append(text[start + 1 : mark.start()])
                    at = mark.end()
        if level:
            raise Rise1RefusalError("a bracket is empty or not closed")
        return "".join(pieces) + text[at:]

    def _logic(self, operator: str, parts: list[str], budget: int) -> Node:
        operands: list[Node] = []
        for part in parts:
            if part := part.strip():
                operand = self._split_truth(part, budget)
                bracketed = _BRACKET_MARK.fullmatch(part)
                # `a or b || c` is split in two steps, but it is one chain.
                if isinstance(operand, Logic) and operand.operator == operator and not bracketed:
                    operands.extend(operand.operands)
                else:
                    operands.append(operand)
        if not operands:
            raise Rise1RefusalError("there is nothing but operators")
        return operands[0] if len(operands) == 1 else Logic(operator, tuple(operands))

    def _arguments(self, text: str, budget: int) -> tuple[Node, ...]:
        text = self._cut_out_brackets(text)
        return tuple(self._split_number(part, budget - 1) for part in text.split(",") if part.strip())

    def _bracket_content(self, text: str) -> str:
        """What the first bracket holds, whatever stands around it."""
        match = _BRACKET_MARK.search(text)
        if match is None:
            raise Rise1RefusalError("it cannot be read")
        return self.brackets[int(match[1])]

    def _leaf(self, text: str) -> Node | None:
        mark = _TEXT_MARK.fullmatch(text)
        if mark is not None:
            quoted = self.texts[int(mark[1])]
            try:
                return Literal(unquote(quoted, quoted, 0))
            except ExpressionError as error:
                raise Rise1RefusalError(error.message) from None
        first = text[:1]
        if text in ("true", "false") or " " in text or not (first == "_" or (first.isascii() and first.isalpha())):
            return None
        if text == "null":
            return Literal(None)
        name = _TEXT_MARK.sub(lambda match: self.texts[int(match[1])], text)
        return NamedConstant(name) if name in CONSTANTS else Key(name)

    def _fall_back(self, text: str, budget: int) -> Node:
        if budget <= 0 or not text:
            raise Rise1RefusalError("it cannot split this into values and operators" if text else "a value is missing")
        if text.isascii() is False and text[0].isalpha() and not text[0].isascii():
            raise Rise1RefusalError(f"a key must begin with a letter from a to z or `_`, not with `{text[0]}`")
        return self._split_number(text, budget)

    def _hide_text(self, match: re.Match[str]) -> str:
        self.texts.append(match[0])
        return f"\ue000{len(self.texts) - 1}\ue001"


def _chain(steps: list[tuple[str, Node, bool]]) -> Node:
    """One chain of what was split in two steps: at `+` and then at `-`, or at `*` and then at `/`.

    The third of each step says that its part was split again, without brackets, so its own chain belongs to this one.
    """
    if not steps:
        raise Rise1RefusalError("there is nothing but operators")
    (sign, first, split), *others = steps
    rest: list[tuple[str, Node]] = []
    if sign == "-":
        first = Negative(first)
    elif sign == "/":
        first, rest = Literal(1), [("/", first)]
    elif split and isinstance(first, Chain):
        rest, first = list(first.rest), first.first
    for sign, node, split in others:
        if split and isinstance(node, Chain):
            rest += [(sign, node.first), *node.rest]
        else:
            rest.append((sign, node))
    return Chain(first, tuple(rest)) if rest else first
