"""Reads tokens into a tree: a Pratt parser with the precedences of semantics.md 8.1, loosest to tightest:
or; xor; and; not; equality; ordering and text comparisons; sums; products; unary minus; power; calls, brackets, parts.

Comparisons of one level do not chain. The parser refuses anything that RISE's own parser would silently drop: text
beside a bracket, an unknown function, an operator without an operand.
"""

from __future__ import annotations

from typing import NamedTuple

from rise_engine.base.json_codec import MAX_LEVELS
from rise_engine.expression import parse_errors
from rise_engine.expression.errors import ExpressionError
from rise_engine.expression.functions import ARITY, CONSTANTS, SITUATION_ARITY
from rise_engine.expression.nodes import (
    Chain,
    Compare,
    Defined,
    FunctionCall,
    Key,
    Literal,
    Logic,
    NamedConstant,
    Negative,
    Node,
    Not,
    Part,
    Power,
    SituationTest,
    depth,
)
from rise_engine.expression.tokens import Token, tokenize

MAX_NESTING = 250
"""Maximum nesting of brackets and operators, as written."""
MAX_DEPTH = 100
"""Maximum levels of the resulting tree, to which redundant brackets add none. Far below Python's own limit."""

_OR, _XOR, _AND, _EQUALITY, _ORDERING, _SUM, _PRODUCT, _POWER = 1, 2, 3, 5, 6, 7, 8, 10
_LEVEL = {
    "or": _OR,
    "xor": _XOR,
    "and": _AND,
    **dict.fromkeys(("==", "!="), _EQUALITY),
    **dict.fromkeys(("<", "<=", ">", ">="), _ORDERING),
    **dict.fromkeys(("+", "-"), _SUM),
    **dict.fromkeys(("*", "/"), _PRODUCT),
    "^": _POWER,
}
_INDEX_HINT = "write a number, a key or a text in quotes: `items[0]`, `items[i]`"
_WORD_OPERATORS = frozenset({"starts", "ends", "contains"})
_VALUES = {"true": Literal(True), "false": Literal(False), "null": Literal(None)}


class Parsed(NamedTuple):
    """The result of parsing: the tree, the keys that it reads, and its constants (which a key may hide)."""

    root: Node
    keys: frozenset[str]
    constants: frozenset[str]


def parse(text: str, *, of_property: bool = False) -> Parsed:
    """Read an expression. Raises ExpressionError for any other text.

    :param of_property: whether it belongs to a property of a study, which can test the situation.
    """
    parser = _Parser(text, of_property)
    try:
        root = parser.parse_text()
    except RecursionError:  # the caller's own stack was nearly full
        raise parse_errors.too_deep_error(text, 0) from None
    # With few tokens the tree cannot be too deep: each level needs at least one token.
    if len(parser.tokens) > MAX_DEPTH and depth(root) > MAX_DEPTH:
        raise parse_errors.too_deep_error(text, 0)
    return Parsed(root, frozenset(parser.keys), frozenset(parser.constants))


class _Parser:
    __slots__ = ("at", "constants", "keys", "nesting", "of_property", "text", "tokens")

    def __init__(self, text: str, of_property: bool) -> None:
        self.text = text
        self.of_property = of_property
        self.tokens = tokenize(text)
        self.at = 0
        self.nesting = 0
        self.keys: set[str] = set()
        self.constants: set[str] = set()

    def parse_text(self) -> Node:
        """Read the whole text. Nothing may follow the expression."""
        root = self.parse_expression(_OR)
        if self.tokens[self.at].kind != "end":
            raise parse_errors.stray_token_error(self.text, self.tokens, self.at)
        return root

    def parse_expression(self, loosest: int) -> Node:
        """Read an expression whose operators bind at least as tightly as `loosest`."""
        self.nesting += 1
        if self.nesting > MAX_NESTING:
            raise parse_errors.too_deep_error(self.text, self.tokens[self.at].start)
        left = self.parse_operand(loosest)
        tokens = self.tokens
        while True:
            operator = tokens[self.at].kind
            level = _LEVEL.get(operator, 0)
            if not level and operator == "word" and tokens[self.at].value in _WORD_OPERATORS:
                level, operator = _ORDERING, tokens[self.at].value
            if level < loosest or not level:
                self.nesting -= 1
                return left
            if level <= _AND:
                operands = [left]
                while tokens[self.at].kind == operator:
                    self.at += 1
                    operands.append(self.parse_expression(level + 1))
                left = Logic(operator, tuple(operands))
            elif level <= _ORDERING:
                left = self.parse_comparison(left, operator, level)
            elif level <= _PRODUCT:
                rest = []
                while _LEVEL.get(sign := tokens[self.at].kind) == level:
                    self.at += 1
                    rest.append((sign, self.parse_expression(level + 1)))
                left = Chain(left, tuple(rest))
            else:
                self.at += 1
                left = Power(left, self.parse_expression(_POWER))

    def parse_comparison(self, left: Node, operator: str, level: int) -> Node:
        if operator in _WORD_OPERATORS:
            operator = self.read_word_operator()
        else:
            self.at += 1
        result = Compare(operator, left, self.parse_expression(level + 1))
        following = self.tokens[self.at]
        again = _LEVEL.get(following.kind) == level
        if again or (level == _ORDERING and following.kind == "word" and following.value in _WORD_OPERATORS):
            raise parse_errors.chained_comparison_error(self.text, result, following)
        return result

    def read_word_operator(self) -> str:
        """Read `starts with`, `ends with` or `contains`: operators after a value, plain keys elsewhere."""
        word = self.tokens[self.at]
        self.at += 1
        if word.value == "contains":
            return "contains"
        with_ = self.tokens[self.at]
        if with_.value != "with" or with_.kind != "word":
            raise ExpressionError(
                f"`{word.value}` needs its `with`", self.text, with_.start + 1, f"write `{word.value} with`"
            )
        self.at += 1
        return f"{word.value} with"

    def parse_operand(self, loosest: int) -> Node:
        token = self.tokens[self.at]
        kind = token.kind
        self.at += 1
        if kind == "word":
            called = self.tokens[self.at].kind == "("
            node = self.parse_call(token) if called else self.parse_name(token)
            return self.parse_parts(node, token) if self.tokens[self.at].kind == "[" else node
        if kind == "number" or kind == "text":
            return Literal(token.value)
        if kind in _VALUES:
            return _VALUES[kind]
        if kind == "(":
            inner = self.parse_expression(_OR)
            if self.tokens[self.at].kind != ")":
                raise parse_errors.unclosed_bracket_error(self.text, self.tokens, self.at, token)
            self.at += 1
            return inner
        if kind == "not":
            # `not` applies to the whole comparison, unless it is inside one: `a == not b`.
            return Not(self.parse_expression(max(_EQUALITY, loosest)))
        if kind == "-":
            return Negative(self.parse_expression(_POWER))
        if kind == "+" and self.tokens[self.at].kind == "number":  # RISE reads `+3` as 3
            self.at += 1
            return Literal(self.tokens[self.at - 1].value)
        raise parse_errors.missing_operand_error(self.text, self.tokens, self.at - 1)

    def parse_name(self, token: Token) -> Node:
        name: str = token.value
        if name in CONSTANTS and self.tokens[self.at].kind != "[":
            self.constants.add(name)
            return NamedConstant(name)
        if parse_errors.is_reserved_in_wrong_case(name):
            raise parse_errors.wrong_case_error(self.text, token)
        self.keys.add(name)
        return Key(name)

    def parse_parts(self, base: Node, first: Token) -> Part:
        """Read the steps after a key or a call: `[i].text`."""
        if isinstance(base, Key) and base.name.endswith("."):
            dot = first.end - 1
            raise ExpressionError("there is no dot before `[`", self.text, dot + 1, f"write `{base.name[:-1]}[`")
        steps: list[str | Node] = []
        tokens = self.tokens
        while (token := tokens[self.at]).kind in ("[", "names"):
            self.at += 1
            if token.kind == "names":
                steps += token.value[1:].split(".")
                continue
            if tokens[self.at].kind == "]":
                raise ExpressionError("there is nothing between `[` and `]`", self.text, token.start + 1, _INDEX_HINT)
            steps.append(self.parse_expression(_OR))
            if tokens[self.at].kind != "]":
                raise parse_errors.unclosed_bracket_error(self.text, tokens, self.at, token)
            self.at += 1
        if len(steps) >= MAX_LEVELS:
            message = f"this key has more than {MAX_LEVELS} parts"
            raise ExpressionError(message, self.text, first.start + 1, "no memory value is deeper")
        return Part(base, tuple(steps), self.text[first.start : tokens[self.at - 1].end])

    def parse_call(self, token: Token) -> Node:
        name: str = token.value
        if name in SITUATION_ARITY:
            return self.parse_situation_test(token)
        if name not in ARITY:
            raise parse_errors.unknown_function_error(self.text, token, of_property=self.of_property)
        first = self.at = self.at + 1
        if name == "defined":
            return self.parse_defined(token)
        arguments: list[Node] = []
        if self.tokens[self.at].kind != ")":
            arguments.append(self.parse_expression(_OR))
            while self.tokens[self.at].kind == ",":
                self.at += 1
                arguments.append(self.parse_expression(_OR))
            if self.tokens[self.at].kind != ")":
                raise parse_errors.unclosed_bracket_error(self.text, self.tokens, self.at, self.tokens[first - 1])
        least, most = ARITY[name]
        if not least <= len(arguments) <= most:
            raise parse_errors.argument_count_error(self.text, token, len(arguments), self.tokens[first : self.at])
        self.at += 1
        return FunctionCall(name, tuple(arguments))

    def parse_defined(self, token: Token) -> Node:
        key = self.tokens[self.at]
        part: Part | None = None
        if key.kind == "word":
            self.at += 1
            if self.tokens[self.at].kind == "[":
                part = self.parse_parts(Key(key.value), key)
        if key.kind != "word" or self.tokens[self.at].kind != ")":
            raise ExpressionError(
                "`defined` takes one key", self.text, key.start + 1, "write `defined(key)`, without quotes"
            )
        self.at += 1
        self.keys.add(key.value)
        return Defined(key.value, part)

    def parse_situation_test(self, token: Token) -> SituationTest:
        """Read `in('Main', 'Start')` or a similar test. Names are literal, so that they can be checked and renamed."""
        name: str = token.value
        if not self.of_property:
            raise parse_errors.situation_unknown_error(self.text, token)
        tokens, names = self.tokens, list[str]()
        opening = tokens[self.at]
        while len(names) < SITUATION_ARITY[name] and tokens[self.at].kind in ("(", ","):
            self.at += 1
            if tokens[self.at].kind != "text" or not tokens[self.at].value.strip():
                raise parse_errors.situation_names_error(self.text, token, tokens[self.at])
            names.append(tokens[self.at].value)
            self.at += 1
        if tokens[self.at].kind == "end":
            raise parse_errors.unclosed_bracket_error(self.text, tokens, self.at, opening)
        if tokens[self.at].kind != ")" or len(names) < SITUATION_ARITY[name]:
            raise parse_errors.situation_names_error(self.text, token, tokens[self.at])
        self.at += 1
        return SituationTest(name, tuple(names))
