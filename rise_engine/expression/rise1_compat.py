"""How RISE's own parser reads a text, to warn authors whose expression means something else there.

RISE builds on the public LogicExpressionParser (paper, section 4.2.2). That one has no tokens: it cuts out brackets,
looks for the loosest operator anywhere in the text and splits there. Text beside a bracket is dropped, `not` binds more
tightly than a comparison, `^` is xor wherever a truth value is wanted, empty operands vanish. This module emulates it,
and answers in our own syntax tree. What RISE added to that parser (`=`, texts, text operators) has no public source; it
is taken to work as the paper prints it: `=` with blanks as `==`, the rest as comparisons.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from itertools import count

from rise_engine.expression.errors import ExpressionError
from rise_engine.expression.expression import Expression
from rise_engine.expression.lists import LIST_FUNCTIONS
from rise_engine.expression.nodes import (
    Chain,
    Defined,
    FunctionCall,
    Key,
    Negative,
    Node,
    Part,
    Power,
    children,
    map_children,
    with_all_brackets,
)
from rise_engine.expression.rise1_splitter import Rise1RefusalError, split_as_rise1

_NAME = r"[A-Za-z_][\w.]*"
_VALUE = rf"""(?:{_NAME}|-?\d+(?:\.\d+)?|"[^"\\]*"|'[^'\\]*')"""
_SAFE = re.compile(
    rf"""(?:(?:not\ )?\(){{0,4}}
         (?:not\ {_NAME} | {_NAME}(?:(?:\ ?(?:==|!=|<=?|>=?)\ ?|\ (?:=|starts\ with|ends\ with|contains)\ ){_VALUE})?)
         \){{0,4}}
         (?:\ (?:and|or|xor)\ (?!$)|$)""",
    re.VERBOSE | re.ASCII,
)
_NUMBERS = (Chain, Power, Negative, FunctionCall)
_MANY = 100
"""Parts of values beyond which nothing is compared: nobody would read the warning."""
_DEEP = 10
"""Brackets from which RISE's limit on nesting may matter."""


def rise1_reading(text: str) -> str | None:
    """What RISE's parser would make of a condition, with all brackets explicit; null when it would refuse it."""
    try:
        return with_all_brackets(_make_canonical(split_as_rise1(text)))
    except Rise1RefusalError:
        return None


def rise1_difference(expression: Expression, tables: Collection[str] = ()) -> str | None:
    """A sentence for the author when RISE would read this condition differently or refuse it; null otherwise.

    RISE has neither index nor lists, and whoever writes `items[i].done` or `shuffle(items)` knows that this is not
    RISE's: nothing is said about it, nor about the length of one of these `tables`. What stands around is compared as
    if that were a plain key.
    """
    if isinstance(expression.root, FunctionCall) and expression.root.function in LIST_FUNCTIONS:
        return None
    text = expression.text
    written: dict[str, None] = dict.fromkeys(_texts_of_parts(expression.root, text)) if expression.parts else {}
    written.update(
        (f"length({name})", None) for name in expression.keys.intersection(tables) if f"length({name})" in text
    )
    if not written:
        return _difference(expression)
    if len(written) > _MANY:
        return None
    names: dict[str, str] = {}
    for part in sorted(written, key=len, reverse=True):
        name = next(each for number in count() if (each := f"part{number}") not in text)
        text, names[name] = text.replace(part, name), part
    try:
        difference = _difference(Expression.parse(text))
    except ExpressionError:  # a text in quotation marks holds the same characters
        return None
    for name, part in reversed(names.items()):
        difference = difference and difference.replace(name, part)
    return difference


def _texts_of_parts(node: Node, text: str) -> Iterator[str]:
    """The outermost parts as they are written, and with `defined(...)` around them."""
    if isinstance(node, Part):
        yield node.written
    elif isinstance(node, Defined):
        if node.part is not None:
            asked = f"defined({node.part.written})"
            yield asked if asked in text else node.part.written
    else:
        for child in children(node):
            yield from _texts_of_parts(child, text)


def _difference(expression: Expression) -> str | None:
    text = expression.text
    if _obviously_alike(text):
        return None
    try:
        theirs = _make_canonical(split_as_rise1(text))
    except Rise1RefusalError as refusal:
        return f"RISE refuses this: {refusal}{_find_remedy(expression)}"
    reading = with_all_brackets(theirs)
    if reading == with_all_brackets(_make_canonical(expression.root)):
        return None
    if isinstance(theirs, Key) and theirs.name not in expression.keys:
        return f"RISE reads `{reading}` as the name of one key{_find_remedy(expression)}"
    return f"RISE reads this as `{reading}`{_find_remedy(expression)}"


def _obviously_alike(text: str) -> bool:
    """Plain comparisons joined by words: nearly all conditions. A cheap test before the emulation."""
    if text.count("(") > _DEEP:
        return False
    at, end = 0, len(text)
    while at < end:
        match = _SAFE.match(text, at)
        if match is None:
            return False
        at = match.end()
    return True


def _find_remedy(expression: Expression) -> str:
    """A spelling that both read alike, if there is one, checked by reading it both ways."""
    explicit_text = expression.with_all_brackets
    whole = explicit_text if isinstance(expression.root, FunctionCall) else f"({explicit_text})"
    candidates = [explicit_text, f"{whole} > 0"] if isinstance(expression.root, _NUMBERS) else [explicit_text]
    for candidate in candidates:
        if candidate == expression.text:
            continue
        try:
            alike = rise1_reading(candidate) == with_all_brackets(_make_canonical(Expression.parse(candidate).root))
        except ExpressionError:
            continue
        if alike:
            return f"; write `{candidate}` to have the same meaning in both"
    return ""


def _make_canonical(node: Node) -> Node:
    """The same tree with differences of shape removed that make no difference of value: (-a) * b is -(a * b)."""
    node = map_children(node, _make_canonical)
    if isinstance(node, Chain) and isinstance(node.first, Negative) and node.rest[0][0] in "*/":
        return Negative(Chain(node.first.operand, node.rest))
    return node
