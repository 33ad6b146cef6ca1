"""Where memory keys stand in conditions, assignments and texts with slots, to the character."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from itertools import pairwise

from rise_engine.expression.errors import ExpressionError
from rise_engine.expression.tokens import KEY, path_end, tokenize
from rise_engine.json_codec import JsonError, JsonObject, read_json

_SLOT_KEY = re.compile(r"""\{ \s*+ (?:"[^"]*+" \s*+)? ([^\W\d][\w.]*+)""", re.VERBOSE)


def keys_in_expression(text: str, start: int = 0, end: int | None = None) -> Iterator[tuple[int, int]]:
    """The places of keys, dotted ones whole; names of functions are none. Nothing of what cannot be read."""
    try:
        tokens = tokenize(text[start:end])
    except ExpressionError:
        return
    for token, following in pairwise(tokens):
        if token.kind == "word" and following.kind != "(":
            yield start + token.start, start + token.end


def keys_in_assignment(text: str) -> Iterator[tuple[int, int]]:
    """The places of keys in `key = value`, `items[i].done = true`, or a JSON object of keys and values."""
    if text.lstrip().startswith("{"):
        yield from json_keys(text)
        return
    key = KEY.match(text, len(text) - len(text.lstrip()))
    if key is None:
        return
    yield key.span()
    bracket = key.end() + len(text[key.end() :]) - len(text[key.end() :].lstrip())
    behind = key.end()
    if text.startswith("[", bracket):
        behind = path_end(text, bracket)
        if behind < 0:
            return
        yield from (place for place in keys_in_expression(text, key.start(), behind) if place[0] > key.start())
    equals = text.find("=", behind)
    if equals < 0 or text[equals + 1 :].lstrip().startswith(("[", "{")):
        return
    yield from keys_in_expression(text, equals + 1)


def keys_in_slots(text: str) -> Iterator[tuple[int, int]]:
    """The places of keys in `Hello {person_name|there}, {items[i].text}!`."""
    at = 0
    while (opening := text.find("{", at)) >= 0:
        if text.startswith("{{", opening):
            at = opening + 2
            continue
        found = _SLOT_KEY.match(text, opening)
        if found is None:
            at = opening + 1
            continue
        yield found.span(1)
        at = found.end()
        bracket = at + len(text[at:]) - len(text[at:].lstrip())
        if text.startswith("[", bracket) and (end := path_end(text, bracket)) >= 0:
            yield from (place for place in keys_in_expression(text, found.start(1), end) if place[0] > found.start(1))
            at = end


def json_keys(text: str) -> Iterator[tuple[int, int]]:
    """The places of the keys of a JSON object, without their quotation marks."""
    try:
        value = read_json(text, lambda key, at, first: None)
    except JsonError:
        return
    if isinstance(value, JsonObject):
        for member in value.members:
            yield member.key_at + 1, json.JSONDecoder().raw_decode(text, member.key_at)[1] - 1


def renamed_key(written: str, old: str, new: str) -> str | None:
    """What a key is called where `old` is called `new`: `person.name` too, if `person` is. None: it is another one."""
    if written == old:
        return new
    return new + written[len(old) :] if written.startswith(f"{old}.") else None


def rename_in(text: str, places: Iterator[tuple[int, int]], old: str, new: str) -> str:
    """A text with a key renamed at these places of keys."""
    for start, end in sorted(places, reverse=True):
        renamed = renamed_key(text[start:end], old, new)
        if renamed is not None:
            text = text[:start] + renamed + text[end:]
    return text
