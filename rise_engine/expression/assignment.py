"""`assignValue`: `key = expression`, `items[i].done = expression`, a JSON object (semantics.md 7; paper, 4.2.2)."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from math import isfinite

from rise_engine.base.json_codec import MAX_LEVELS, JsonError, decode, encode
from rise_engine.base.nearest_name import Correction
from rise_engine.base.text import match_end
from rise_engine.expression.environment import Environment, Json, describe, list_index, lookup, nesting_levels
from rise_engine.expression.errors import EvaluationError, ExpressionError, shorten
from rise_engine.expression.expression import Expression
from rise_engine.expression.tokens import KEY, MAX_LENGTH, RESERVED, check_key, path_end

_BLANKS = re.compile(r"\s*")
MAX_BYTES = 100_000
"""Maximum JSON size of a list or object that an assignment to a part, or with a part or a list function, makes."""
_COMPOUND = re.compile(r"\s*([+\-*/^])\s*=")


class Assignment:
    """One value for one key, or for a part of its value. Immutable; equal if text and key are equal.

    The right side is an `expression` or, if that is None, the JSON value `literal`.
    """

    __slots__ = ("expression", "key", "literal", "target", "text")

    text: str
    """As written; several assignments can come from one text (`parse_all`)."""
    key: str
    """The key that is set, with its dots; see `assigned_entry`."""
    target: Expression | None
    """The left side if it has an index, such as `items[i].done`: the part of the key's value that is set."""
    expression: Expression | None
    literal: Json

    def __init__(
        self, text: str, key: str, expression: Expression | None, literal: Json, target: Expression | None = None
    ) -> None:
        self.text = text
        self.key = key
        self.target = target
        self.expression = expression
        self.literal = literal

    @classmethod
    def parse(cls, text: str) -> Assignment:
        """Read `key = expression`, `key = JSON` (both also with a part: `key[index].name = ...`), or `{"key": JSON}`.
        Raises ExpressionError.

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
        """Like `parse`, but a JSON object may hold several keys (at least one), which are assigned in its order."""
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
        key, target, at = _read_left_side(text, start)
        expression, literal = _read_right_side(text, at)
        return (cls(text, key, expression, literal, target),)

    @property
    def keys(self) -> frozenset[str]:
        """The memory keys that the right side or an index on the left reads. A bare word on the right counts, because
        it may be a key."""
        keys = self.expression.keys if self.expression is not None else frozenset()
        return keys if self.target is None else keys | (self.target.keys - self.target.keys_of_parts_only)

    @property
    def bare_word(self) -> str | None:
        """The right side if it is a single word: a key, or a text without quotation marks."""
        return self.expression.bare_key if self.expression is not None else None

    def entry(
        self,
        env: Environment,
        known_keys: Collection[str] = frozenset(),
        memory: Mapping[str, Json] | None = None,
        *,
        limited: bool = False,
    ) -> tuple[str, Json]:
        """Return the key of the memory that changes, and its new value.

        Arguments:
            env: the source of the values for the right side, then for the indexes on the left.
            known_keys: as for `evaluate`.
            memory: the memory that gets the value, if it is not that of `env`. It is not changed here.
            limited: always limit the size of the value, not only with an index or a list function.

        Raises EvaluationError, as `evaluate` and `assigned_entry` do; MissingPartError for a missing part on the left.
        """
        value = self.evaluate(env, known_keys)
        memory = env.memory if memory is None else memory
        if self.target is not None:
            part = self.target.compiled_part
            assert part is not None  # _read_left_side accepts nothing else
            key, value = part.assign(memory, value, env)
        else:
            key, value = assigned_entry(memory, self.key, value)
        if limited or self.target is not None or (self.expression is not None and self.expression.gives_parts):
            self._check_size(key, value)
        return key, value

    def _check_size(self, key: str, value: Json) -> None:
        if isinstance(value, (list, dict)) and (size := len(encode(value))) > MAX_BYTES:
            message = f"the value of `{key}` would have {size:,} bytes as JSON; at most {MAX_BYTES:,} are allowed here"
            raise EvaluationError(message, self.text)

    def evaluate(self, env: Environment, known_keys: Collection[str] = frozenset()) -> Json:
        """Return the value to store. Raises EvaluationError, also for NaN and infinity.

        A bare word that is neither in the memory nor in `known_keys` (the keys that the scenario sets) is a text. A
        known key without a value gives null and is reported as missing.
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
    """Return the top-level key that changes if `key` is set, and its new value. The memory itself is not changed.

    A dotted key sets the flat key of that name, unless that does not exist and its first part is an object or a list.
    Then it sets a part, as reading does: the new value of the first part is a copy with `value` inside. Missing objects
    on the path are created. Raises EvaluationError if the path leads through another value or beyond the end of a list,
    or exceeds MAX_LEVELS.
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


def _read_left_side(text: str, start: int) -> tuple[str, Expression | None, int]:
    """Read the left side: the key, the part of its value (with an index), and the offset after the `=`."""
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
    target: Expression | None = None
    written = key
    if text.startswith("[", match_end(_BLANKS, text, end)):
        target, end = _read_target(text, start, end)
        written = target.text
    compound = _COMPOUND.match(text, end)
    if compound:
        hint = f"write `{written} = {written} {compound[1]} ...`"
        raise ExpressionError(f"`{compound[1]}=` is not an operator", text, compound.start(1) + 1, hint)
    at = match_end(_BLANKS, text, end)
    if at == len(text):
        raise ExpressionError("the `=` is missing", text, at + 1, f"write `{written} = value`")
    if text.startswith("==", at):
        raise ExpressionError("`==` compares; it does not assign", text, at + 1, "write a single `=`")
    if text.startswith(":=", at):
        raise ExpressionError("`:=` is not an operator", text, at + 1, "write a single `=`", Correction(":=", "="))
    if text[at] == "=":
        return key, target, at + 1
    if at == end and target is None:
        hint = "a key has only letters, digits, `_` and dots"
        raise ExpressionError(f"`{text[at]}` is not allowed in a key", text, at + 1, hint)
    hint = f"write `{written} = value`" + ("; a key has no blanks" if target is None else "")
    raise ExpressionError(f"after the key `{written}` there must be a `=`", text, at + 1, hint)


def _read_target(text: str, start: int, key_end: int) -> tuple[Expression, int]:
    """Read the part that is set, from its key at `start`. Returns it and the offset of its end."""
    end = path_end(text, match_end(_BLANKS, text, key_end))
    if end < 0:
        at = text.index("[", key_end)
        raise ExpressionError("this bracket is not closed", text, at + 1, "add `]`")
    try:
        target = Expression.parse(text[start:end])
    except ExpressionError as error:
        raise ExpressionError(error.message, text, error.column + start, error.hint, error.suggestion) from None
    assert target.compiled_part is not None  # a key and an index
    return target, end


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
        raise ExpressionError(error.message, text, error.column + at, hint, error.suggestion) from None


def _read_json(text: str, start: int) -> Json:
    """Read the JSON value that begins at `start` and fills the rest of the text."""
    try:
        return decode(text[start:])
    except JsonError as error:
        message, _, hint = str(error).partition("; ")
        raise ExpressionError(f"this is not valid JSON: {message}", text, start + error.offset + 1, hint) from None
