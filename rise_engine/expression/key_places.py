"""Places of memory keys in conditions, assignments and texts with `{slots}`, and of names in properties."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise
from typing import Literal, NamedTuple

from rise_engine.base.json_codec import JsonError, JsonObject, read_json
from rise_engine.base.text import match_end
from rise_engine.expression.assignment import Assignment
from rise_engine.expression.errors import ExpressionError
from rise_engine.expression.expression import Expression
from rise_engine.expression.functions import SITUATION_ARITY
from rise_engine.expression.tokens import KEY, path_end, tokenize

_BLANKS = re.compile(r"\s*")
_SLOT = re.compile(r"\{\{|\{\s*+(?:\"[^\"]*+\"\s*+)?([^\W\d][\w.]*+)(\s*+\[)?")


class KeyPlace(NamedTuple):
    """A memory key in a text."""

    key: str
    """As written, with its dots. In `items[i].text`, `items` and `i` have separate places."""
    start: int
    is_set: bool = False
    """Whether it gets a value there."""
    may_be_text: bool = False
    """Whether it is the whole right side of an assignment: a key, or a text without quotation marks."""


class AskedName(NamedTuple):
    """The name of a rule, a state or an act in a property."""

    kind: Literal["rule", "state", "act"]
    name: str
    start: int
    """Its offset in the text, after the quotation mark."""
    length: int
    """Its length there, in characters."""
    rule: str = ""
    """The rule of a state."""


def names_in_property(text: str) -> Iterator[AskedName]:
    """Yield the names in a property with their places; none if it cannot be read.

    >>> [(each.kind, each.name, each.start) for each in names_in_property("runs('R_Yes') and in('Main', 'Start')")]
    [('act', 'R_Yes', 6), ('rule', 'Main', 22), ('state', 'Start', 30)]
    """
    try:
        Expression.parse_property(text)
        tokens = tokenize(text)
    except ExpressionError:
        return
    for at, token in enumerate(tokens):
        if token.kind != "word" or token.value not in SITUATION_ARITY or tokens[at + 1].kind != "(":
            continue
        first, place = tokens[at + 2], tokens[at + 2].start + 1
        length = first.end - first.start - 2
        if token.value in ("runs", "waits"):
            yield AskedName("act", first.value, place, length)
            continue
        yield AskedName("rule", first.value, place, length)
        if token.value == "in":
            second = tokens[at + 4]
            length = second.end - second.start - 2
            yield AskedName("state", second.value, second.start + 1, length, first.value)


def keys_in_expression(text: str, start: int = 0) -> Iterator[KeyPlace]:
    """Yield the keys of an expression or a property with their places; none if it cannot be read.

    :param start: the offset of the expression, which is added to the places.

    >>> [(each.key, each.start) for each in keys_in_expression("a > 2 and defined(b.c) or max(a, 1) > 0")]
    [('a', 0), ('b.c', 18), ('a', 30)]
    """
    try:
        keys, tokens = Expression.parse_property(text).keys, tokenize(text)
    except ExpressionError:
        return
    for token, following in pairwise(tokens):
        if token.kind == "word" and token.value in keys and following.kind != "(":
            yield KeyPlace(token.value, start + token.start)


def keys_in_assignment(text: str) -> Iterator[KeyPlace]:
    """Yield the keys that an assignment of either form sets or reads, with their places.

    >>> [(each.key, each.start, each.is_set) for each in keys_in_assignment("items[i].n = n + 1")]
    [('items', 0, True), ('i', 6, False), ('n', 13, False)]
    """
    try:
        assignments = Assignment.parse_all(text)
    except ExpressionError:
        return
    start = match_end(_BLANKS, text, 0)
    if text.startswith("{", start):
        yield from _keys_of_object(text, start)
        return
    (assignment,) = assignments
    yield KeyPlace(assignment.key, start, is_set=True)
    behind = match_end(KEY, text, start)
    if assignment.target is not None:
        behind = start + len(assignment.target.text)
        # the first key is the one that is set
        yield from list(keys_in_expression(assignment.target.text, start))[1:]
    at = text.index("=", behind) + 1
    if assignment.expression is not None:
        is_word = assignment.bare_word is not None
        yield from (place._replace(may_be_text=is_word) for place in keys_in_expression(text[at:].rstrip(), at))


def _keys_of_object(text: str, start: int) -> Iterator[KeyPlace]:
    try:
        value = read_json(text[start:], lambda key, at, first: None)
    except JsonError:
        return
    if isinstance(value, JsonObject):
        yield from (KeyPlace(member.key, start + member.key_at + 1, is_set=True) for member in value.members)


def keys_in_slots(text: str) -> Iterator[KeyPlace]:
    """Yield the keys in the braces of a text, even if the text has errors.

    >>> [(each.key, each.start) for each in keys_in_slots('{{no}} {", "who} {items[n + 1].text|x}')]
    [('who', 12), ('items', 18), ('n', 24)]
    """
    for slot in _SLOT.finditer(text):
        if slot.group(1) is None:
            continue
        end = path_end(text, slot.end() - 1) if slot.group(2) else -1
        if end >= 0:
            yield from keys_in_expression(text[slot.start(1) : end], slot.start(1))
        else:
            yield KeyPlace(slot.group(1), slot.start(1))
