"""The syntax tree. Chains of one level (`a or b or c`, `a + b - c`) are one node, so that long ones stay shallow."""

from __future__ import annotations

from collections.abc import Iterator
from math import isinf
from typing import NamedTuple, TypeAlias


class Literal(NamedTuple):
    value: bool | int | float | str | None


class Key(NamedTuple):
    """A memory key, with its dots."""

    name: str


class NamedConstant(NamedTuple):
    """`pi`, `e`, `r2d` or `d2r`. A memory key of the same name hides it."""

    name: str


class Part(NamedTuple):
    """`items[i].text`: a part of the value of a key or a call."""

    base: Node
    """A Key or a FunctionCall."""
    steps: tuple[str | Node, ...]
    """An index first; then indexes and names after a dot."""
    written: str
    """As written in the expression. Records use it as the name of the part."""

    @property
    def indexes(self) -> Iterator[Node]:
        """The nodes in its brackets."""
        return (step for step in self.steps if not isinstance(step, str))


class Defined(NamedTuple):
    """`defined(key)`: true if the key exists, whatever its value. With `part`: true if that part exists."""

    name: str
    part: Part | None = None


class SituationTest(NamedTuple):
    """`in('Main', 'Start')`, `rule('Main')`, `runs('R_Yes')`, `waits('R_Yes')`: only in a property of a study."""

    function: str
    names: tuple[str, ...]


class Not(NamedTuple):
    operand: Node


class Negative(NamedTuple):
    operand: Node


class Logic(NamedTuple):
    """`operator` is or, xor, and."""

    operator: str
    operands: tuple[Node, ...]


class Compare(NamedTuple):
    """`operator` is ==, !=, <, <=, >, >=, starts with, ends with, contains."""

    operator: str
    left: Node
    right: Node


class Chain(NamedTuple):
    """Sums (+, -) or products (*, /), applied from left to right."""

    first: Node
    rest: tuple[tuple[str, Node], ...]


class Power(NamedTuple):
    base: Node
    exponent: Node


class FunctionCall(NamedTuple):
    function: str
    arguments: tuple[Node, ...]


Node: TypeAlias = (
    Literal
    | Key
    | NamedConstant
    | Part
    | Defined
    | SituationTest
    | Not
    | Negative
    | Logic
    | Compare
    | Chain
    | Power
    | FunctionCall
)

_ATOMS = (Literal, Key, NamedConstant, Part, Defined, SituationTest, FunctionCall)


def children(node: Node) -> Iterator[Node]:
    """The nodes directly below."""
    match node:
        case Not(operand) | Negative(operand):
            yield operand
        case Logic(_, operands) | FunctionCall(_, operands):
            yield from operands
        case Compare(_, left, right) | Power(left, right):
            yield left
            yield right
        case Chain(first, rest):
            yield first
            for _, operand in rest:
                yield operand
        case Part(base):
            yield base
            yield from node.indexes
        case Defined(_, Part() as part):  # only the existence of its key is tested
            yield from part.indexes


def walk(node: Node) -> Iterator[tuple[Node, int]]:
    """Yield every node of a tree with its level, from 1. Not recursive, so it can walk any tree."""
    waiting = [(node, 1)]
    while waiting:
        node, level = waiting.pop()
        yield node, level
        waiting.extend((child, level + 1) for child in children(node))


def depth(node: Node) -> int:
    """Levels of the tree; a leaf has 1."""
    return max(level for _, level in walk(node))


def read_keys(node: Node) -> frozenset[str]:
    """The keys whose value the tree reads."""
    return frozenset(each.name for each, _ in walk(node) if isinstance(each, Key))


def may_join(node: Node) -> bool:
    """Whether `+` may join texts in a node: a sum without a part that is certainly a number."""
    return (
        isinstance(node, Chain)
        and all(sign == "+" for sign, _ in node.rest)
        and all(_may_be_text(operand) for operand in (node.first, *(operand for _, operand in node.rest)))
    )


def _may_be_text(node: Node) -> bool:
    match node:
        case Literal(value):
            return isinstance(value, str)
        case FunctionCall(function, _):
            return function == "lower"
        case Chain():
            return may_join(node)
        case _:
            return isinstance(node, Key | Part)


def with_all_brackets(node: Node) -> str:
    """The expression with brackets around every part, operators as words, and equality as `==`."""
    match node:
        case Key(name) | NamedConstant(name):
            return name
        case Literal(value):
            return literal_text(value)
        case Part(base, steps):
            inner = (f".{step}" if isinstance(step, str) else f"[{with_all_brackets(step)}]" for step in steps)
            return with_all_brackets(base) + "".join(inner)
        case Defined(name, part):
            return f"defined({name if part is None else with_all_brackets(part)})"
        case SituationTest(function, names):
            return f"{function}({', '.join(map(literal_text, names))})"
        case Not(operand):
            return f"not {_bracket(operand)}"
        case Negative(operand):
            return f"-{_bracket(operand)}"
        case Logic(operator, operands):
            return f" {operator} ".join(map(_bracket, operands))
        case Compare(operator, left, right):
            return f"{_bracket(left)} {operator} {_bracket(right)}"
        case Chain(first, rest):
            return _bracket(first) + "".join(f" {operator} {_bracket(operand)}" for operator, operand in rest)
        case Power(base, exponent):
            return f"{_bracket(base)} ^ {_bracket(exponent)}"
        case FunctionCall(function, arguments):
            return f"{function}({', '.join(map(with_all_brackets, arguments))})"


def literal_text(value: bool | int | float | str | None) -> str:
    """A literal in the form of an expression."""
    if value is None:
        return "null"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return _quote(value)
    return number_text(value)


def number_text(value: int | float) -> str:
    """A number with a point and, if possible, without an exponent sign, which RISE's parser does not accept."""
    text = repr(value)
    if "e-" in text:
        plain = f"{value:.30f}".rstrip("0")
        return plain if float(plain) == value else text
    return "inf" if isinstance(value, float) and isinf(value) else text.replace("e+", "e")


def _bracket(node: Node) -> str:
    text = with_all_brackets(node)
    return text if isinstance(node, _ATOMS) else f"({text})"


def _quote(value: str) -> str:
    quote = "'" if '"' in value and "'" not in value else '"'
    escaped = value.replace("\\", "\\\\").replace("\n", "\\n").replace("\t", "\\t").replace("\r", "\\r")
    return quote + escaped.replace(quote, "\\" + quote) + quote
