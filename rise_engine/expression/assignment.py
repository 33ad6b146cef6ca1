"""`assignValue`: `key = expression`, or a JSON object with one key (semantics.md 7; paper, section 4.2.2)."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from math import isfinite

from rise_engine.expression.environment import Environment, Json, list_index, lookup
from rise_engine.expression.errors import EvaluationError, ExpressionError, shorten
from rise_engine.expression.expression import Expression
from rise_engine.expression.tokens import KEY, MAX_LENGTH, RESERVED, check_key
from rise_engine.expression.values import describe, nesting_levels
from rise_engine.json_codec import MAX_LEVELS, JsonError, decode
from rise_engine.text import match_end

_BLANKS = re.compile(r"\s*")
_COMPOUND = re.compile(r"\s*([+\-*/^])\s*=")


class Assignment:
    """One value for one key. Immutable; equal when text and key are.

    The right side is an `expression`, or, when that is null, the JSON value `literal`.
    """

    __slots__ = ("expression", "key", "literal", "text")

    text: str
    """As written; several assignments can come from one text (`parse_all`)."""
    key: str
    """The key that is set, dots included; see `store` for what a dotted key means."""
    expression: Expression | None
    literal: Json

    def __init__(self, text: str, key: str, expression: Expression | None, literal: Json) -> None:
        self.text = text
        self.key = key
        self.expression = expression
        self.literal = literal

    @classmethod
    def parse(cls, text: str) -> Assignment:
        """Read `key = expression`, `key = JSON` or `{"key": JSON}`. Raises ExpressionError.

        >>> assignment = Assignment.parse("task = task + 1")
        >>> assignment.key, assignment.evaluate(Environment({"task": 2}))
        ('task', 3)
        """
        found = cls.parse_all(text)
        if len(found) > 1:
            raise ExpressionError(
                "this object has more than one key", text, text.index("{") + 1, "write one assignment per key"
            )
        return found[0]

    @classmethod
    def parse_all(cls, text: str) -> tuple[Assignment, ...]:
        """As `parse`, but a JSON object may hold several keys (at least one), assigned in its order."""
        if len(text) > MAX_LENGTH:
            raise ExpressionError(f"the assignment is longer than {MAX_LENGTH:,} characters", text[:200], 1)
        start = match_end(_BLANKS, text, 0)
        if text.startswith("{", start):
            pairs = _read_json(text, start)
            if not pairs:
                raise ExpressionError("this object has no key", text, start + 1, 'write {"key": value}')
            if "" in pairs:
                raise ExpressionError("a memory key cannot be empty", text, start + 1)
            if any(key.count(".") >= MAX_LEVELS for key in pairs):
                raise ExpressionError(f"a key here has more than {MAX_LEVELS} parts", text, start + 1)
            return tuple(cls(text, key, None, value) for key, value in pairs.items())
        key, at = _read_key(text, start)
        expression, literal = _read_right_side(text, at)
        return (cls(text, key, expression, literal),)

    @property
    def keys(self) -> frozenset[str]:
        """The memory keys that the right side reads (a bare word among them: it may be a key)."""
        return self.expression.keys if self.expression is not None else frozenset()

    @property
    def bare_word(self) -> str | None:
        """The right side when it is one single word: a key, or else a text that its author did not quote."""
        return self.expression.bare_key if self.expression is not None else None

    def evaluate(self, env: Environment, known_keys: Collection[str] = frozenset()) -> Json:
        """The value to store. Raises EvaluationError, also for NaN and infinity, which a memory cannot hold.

        A bare word that is neither in the memory nor among `known_keys` (the keys that anything in the scenario sets)
        is a text. A known key without a value gives null and is reported as missing.
        """
        if self.expression is None:
            return self.literal
        word = self.bare_word
        if (
            word is not None
            and word not in known_keys
            and word.partition(".")[0] not in known_keys
            and not lookup(env.memory, word)[0]
        ):
            return word
        value = self.expression.compiled_value(env)
        if isinstance(value, float) and not isfinite(value):
            shown = "no number (NaN)" if value != value else "infinite"
            raise EvaluationError(f"the result for `{self.key}` is {shown}, which the memory cannot hold", self.text)
        return value

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Assignment) and (self.text, self.key) == (other.text, other.key)

    def __hash__(self) -> int:
        return hash((self.text, self.key))

    def __repr__(self) -> str:
        return f"Assignment.parse({self.text!r})"


def assigned_entry(memory: Mapping[str, Json], key: str, value: Json) -> tuple[str, Json]:
    """Which top-level key gets which new value when `key` is set. The memory itself is not changed.

    A dotted key sets the flat key of that name, unless there is none and its first part is an object (or a list): then
    it reaches in, as reading does, and gives a copy with the new value inside; objects on the way are made when they do
    not exist. Raises EvaluationError when the way leads through another value, or beyond the end of a list, or when
    lists and objects would be more than MAX_LEVELS within each other.
    """
    head, *rest = key.split(".")
    if key in memory or not rest or not isinstance(memory.get(head), (dict, list)):
        return key, value
    if len(rest) + nesting_levels(value) > MAX_LEVELS:
        raise EvaluationError(
            f"`{head}` would be nested too deeply: more than {MAX_LEVELS} lists and objects within each other",
            shorten(key),
        )
    top = container = memory[head].copy()
    path = head
    for part in rest[:-1]:
        index = _index_or_name(container, part, path, key)
        if isinstance(container, dict) and part not in container:
            inner: Json = {}
        else:
            inner = container[index]
            if not isinstance(inner, (dict, list)):
                raise EvaluationError(f"`{path}.{part}` is {describe(inner)}; nothing can be set inside it", key)
            inner = inner.copy()
        container[index] = inner
        container = inner
        path += f".{part}"
    container[_index_or_name(container, rest[-1], path, key)] = value
    return head, top


def _index_or_name(container: Json, part: str, path: str, key: str) -> str | int:
    if isinstance(container, dict):
        return part
    index = list_index(container, part)
    if index is None:
        raise EvaluationError(f"`{path}` is a list of {len(container)} and has no entry `{part}`", key)
    return index


def _read_key(text: str, start: int) -> tuple[str, int]:
    """The key on the left and the place behind the `=`."""
    match = KEY.match(text, start)
    if match is None:
        if start == len(text):
            raise ExpressionError("the assignment is empty", text, 1, "write `key = value`")
        if text[start] == "=":
            raise ExpressionError("there is no key before the `=`", text, start + 1, "write `key = value`")
        raise ExpressionError(
            f"a key cannot begin with `{text[start]}`", text, start + 1, "begin it with a letter or `_`"
        )
    key, end = match[0], match.end()
    check_key(text, key, start)
    if key in RESERVED:
        raise ExpressionError(f"`{key}` is a word of the language and cannot be a key", text, start + 1)
    compound = _COMPOUND.match(text, end)
    if compound:
        hint = f"write `{key} = {key} {compound[1]} ...`"
        raise ExpressionError(f"`{compound[1]}=` is no operator", text, compound.start(1) + 1, hint)
    at = match_end(_BLANKS, text, end)
    if at == len(text):
        raise ExpressionError("the `=` is missing", text, at + 1, f"write `{key} = value`")
    if text.startswith("==", at):
        raise ExpressionError("`==` compares; it does not assign", text, at + 1, "write a single `=`")
    if text.startswith(":=", at):
        raise ExpressionError("`:=` is no operator", text, at + 1, "write a single `=`")
    if text[at] == "=":
        return key, at + 1
    if at == end:
        hint = "a key has only letters, digits, `_` and dots"
        raise ExpressionError(f"`{text[at]}` cannot stand in a key", text, at + 1, hint)
    hint = f"write `{key} = value`; a key has no blanks"
    raise ExpressionError(f"after the key `{key}` there must be a `=`", text, at + 1, hint)


def _read_right_side(text: str, start: int) -> tuple[Expression | None, Json]:
    at = match_end(_BLANKS, text, start)
    if at == len(text):
        raise ExpressionError("there is no value after the `=`", text, at + 1, 'write `""` for an empty text')
    if text[at] in "[{":
        return None, _read_json(text, at)
    try:
        return Expression.parse(text[at:].rstrip()), None
    except ExpressionError as error:
        hint = error.hint
        if re.fullmatch(r"[^\W\d]+([ '’\-]+\w+)+[.!?]?", text[at:].strip()):
            hint = f'put a text in quotes: `"{text[at:].strip()}"`'
        raise ExpressionError(error.message, text, error.column + at, hint) from None


def _read_json(text: str, start: int) -> Json:
    """The JSON value that begins at `start` and fills the rest of the text."""
    try:
        return decode(text[start:])
    except JsonError as error:
        message, _, hint = str(error).partition("; ")
        raise ExpressionError(f"this is no valid JSON: {message}", text, start + error.offset + 1, hint) from None
