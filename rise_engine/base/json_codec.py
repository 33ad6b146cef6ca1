"""Strict JSON: exactly RFC 8259, and only values that the memory can contain.

The standard library silently keeps the last of two equal keys, accepts NaN and Infinity, and gives no locations.
`decode` returns the value of a text, `read_json` also the places in it. `encode` writes JSON for all outputs.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any, TypeAlias

import msgspec
from msgspec import Struct

from rise_engine.base.errors import RiseError
from rise_engine.base.text import escape_all_surrogates, match_end
from rise_engine.base.typography import find_typographic_closing, typography_problem

MAX_LEVELS = 64
"""Maximum nesting of lists and objects in any memory value (docs/reference/scenario.md)."""

_SPACE = re.compile(r"[ \t\n\r]*")
_STRING = re.compile(r'"([^"\\\x00-\x1f]*)"')
_CHUNK = re.compile(r'[^"\\\x00-\x1f]*')
_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(\.[0-9]+)?([eE][-+]?[0-9]+)?(?![\w.])")
_WORD = re.compile(r"[-+]?\w+|.", re.DOTALL)
_ESCAPES = {'"': '"', "\\": "\\", "/": "/", "b": "\b", "f": "\f", "n": "\n", "r": "\r", "t": "\t"}
_UNCLOSED = "this text has no closing quotation mark"
_WORDS = {"true": True, "false": False, "null": None}
_HALF = re.compile("[\ud800-\udfff]")


def is_64_bit(value: int) -> bool:
    """Whether a whole number fits into a signed integer of 64 bits. The memory contains no others."""
    return -(2**63) <= value < 2**63


class JsonError(RiseError, ValueError):
    """A text is not JSON, or not a memory value; the message is a sentence without a location.

    `offset` counts characters from 0 in the text.
    """

    def __init__(self, message: str, offset: int) -> None:
        super().__init__(message)
        self.offset = offset


Duplicate: TypeAlias = Callable[[str, int, int], None]
"""Is called with a duplicate key of an object, its offset, and the offset of the first one."""
NoNumber: TypeAlias = Callable[[str, int], None]
"""Is called with a sentence and an offset for NaN, an infinity or a number that is too large."""


class JsonMember(Struct, frozen=True):
    """One `"key": value` of an object, with the offset of the key and of the value."""

    key: str
    value: Any
    key_at: int
    value_at: int


class JsonObject(dict[str, Any]):
    """An object with the offsets of its members."""

    members: tuple[JsonMember, ...] = ()
    at: int = 0


class JsonArray(list[Any]):
    """An array with the offsets of its items."""

    items_at: tuple[int, ...] = ()
    at: int = 0


def decode(text: str) -> Any:
    """Read a JSON text into ordinary dicts and lists.

    Raises JsonError for invalid JSON, duplicate keys, NaN, infinities, whole numbers of more than 64 bits, and lists
    and objects that are nested more than MAX_LEVELS deep.

    >>> decode('{"task": 2, "names": ["Ada"]}')
    {'task': 2, 'names': ['Ada']}
    """

    def refuse_duplicate(key: str, offset: int, first: int) -> None:
        raise JsonError(f"the key `{key}` is there twice", offset)

    return to_plain(read_json(text, refuse_duplicate))


def encode(value: Any) -> bytes:
    """Write a JSON-like value or a Struct as JSON in UTF-8.

    UTF-8 has no half characters (undecodable bytes of file names). They become the text `\\udcff`.

    >>> encode({"task": 2})
    b'{"task":2}'
    """
    try:
        return msgspec.json.encode(value)
    except UnicodeEncodeError:
        return msgspec.json.encode(escape_all_surrogates(msgspec.to_builtins(value)))


def read_json(text: str, duplicate: Duplicate, no_number: NoNumber | None = None) -> Any:
    """Read a JSON text into objects and arrays with the offsets of their items; `to_plain` makes ordinary ones.

    Reports duplicate keys to `duplicate` and keeps the first value. Raises JsonError for invalid JSON. With
    `no_number`, NaN, infinities and numbers that are too large are only reported, and read as null.
    """
    half = _HALF.search(text)
    if half is not None:
        raise JsonError("here is one half of a character", half.start())
    try:
        return _read_document(_JsonReader(text, duplicate, no_number))
    except JsonError as error:
        at = find_typographic_closing(text, error.offset) if str(error) == _UNCLOSED else error.offset
        known = typography_problem(text, at, quote='"') if at >= 0 else ""
        if known:
            raise JsonError(known, at) from None
        raise


def _read_document(reader: _JsonReader) -> Any:
    value, at = reader.read_value(reader.skip_blanks(0), 0)
    at = reader.skip_blanks(at)
    if at < len(reader.text):
        raise JsonError("something follows after the end of the JSON value", at)
    return value


def to_plain(value: Any) -> Any:
    """The same value in ordinary dicts and lists."""
    if isinstance(value, dict):
        return {key: to_plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [to_plain(item) for item in value]
    return value


def json_equal(one: Any, other: Any, *, in_order: bool = False) -> bool:
    """Whether two values are equal in JSON: 2 and 2.0 differ, and so do 1 and true. `in_order`: also key order."""
    return json.dumps(one, sort_keys=not in_order) == json.dumps(other, sort_keys=not in_order)


class _JsonReader:
    def __init__(self, text: str, duplicate: Duplicate, no_number: NoNumber | None) -> None:
        self.text = text
        self.duplicate = duplicate
        self.no_number = no_number

    def report_unfit(self, message: str, offset: int) -> None:
        if self.no_number is None:
            raise JsonError(message, offset)
        self.no_number(message, offset)

    def skip_blanks(self, at: int) -> int:
        return match_end(_SPACE, self.text, at)

    def read_value(self, at: int, depth: int) -> tuple[Any, int]:
        character = self.text[at : at + 1]
        if character == '"':
            return self.read_string(at)
        if character in ("{", "["):
            if depth >= MAX_LEVELS:
                raise JsonError(f"arrays and objects are nested more than {MAX_LEVELS} deep", at)
            return self.read_object(at, depth) if character == "{" else self.read_array(at, depth)
        number = _NUMBER.match(self.text, at)
        if number is not None:
            return self.read_number(number), number.end()
        return self.read_word(at)

    def read_number(self, found: re.Match[str]) -> int | float | None:
        if found.lastindex is None:
            whole = int(found.group()) if found.end() - found.start() <= 20 else 2**64
            if is_64_bit(whole):
                return whole
            self.report_unfit(
                "a whole number of more than 64 bits; write it as a text or as a decimal number (1.5e20)", found.start()
            )
            return None
        value = float(found.group())
        if value in (float("inf"), float("-inf")):
            self.report_unfit(f"the number {found.group()} is too large", found.start())
            return None
        return value

    def read_word(self, at: int) -> tuple[Any, int]:
        found = _WORD.match(self.text, at)
        if found is None:
            raise JsonError("the file ends before a value", at)
        word = found.group()
        if word in _WORDS:
            return _WORDS[word], found.end()
        if word.lstrip("+-") in ("NaN", "Infinity"):
            self.report_unfit(f"{word} is not a JSON value; write null, or a number", at)
            return None, found.end()
        if word.lower() in _WORDS:
            raise JsonError(f"write {word.lower()} in lower case", at)
        if word == "'":
            raise JsonError('write texts in double quotation marks: "..."', at)
        if word in (",", "]", "}"):
            raise JsonError(f"a value is missing before `{word}`", at)
        if word[0].isdigit() or word[0] in "+-.":
            raise JsonError("this is not a JSON number; write it as 12, -0.5 or 1e3", at)
        raise JsonError(f"`{word}` is not a JSON value; write texts in double quotation marks", at)

    def read_string(self, at: int) -> tuple[str, int]:
        simple = _STRING.match(self.text, at)
        if simple is not None:
            return simple.group(1), simple.end()
        pieces: list[str] = []
        position = at + 1
        while True:
            chunk = _CHUNK.match(self.text, position)
            assert chunk is not None
            pieces.append(chunk.group())
            position = chunk.end()
            character = self.text[position : position + 1]
            if character == '"':
                return "".join(pieces), position + 1
            if character == "\\":
                piece, position = self.read_escape(position)
                pieces.append(piece)
            elif character in ("\n", "\r", ""):
                raise JsonError(_UNCLOSED, at)
            else:
                raise JsonError(f"a control character (U+{ord(character):04X}) must be written as an escape", position)

    def read_escape(self, at: int) -> tuple[str, int]:
        letter = self.text[at + 1 : at + 2]
        if letter in _ESCAPES:
            return _ESCAPES[letter], at + 2
        if letter == "u":
            code = self.read_code_unit(at)
            if 0xD800 <= code < 0xDC00 and self.text.startswith("\\u", at + 6):
                low = self.read_code_unit(at + 6)
                if 0xDC00 <= low < 0xE000:
                    return chr(0x10000 + ((code - 0xD800) << 10) + low - 0xDC00), at + 12
            if 0xD800 <= code < 0xE000:
                raise JsonError("this escape is one half of a character; write the character itself", at)
            return chr(code), at + 6
        raise JsonError('a backslash comes before one of " \\ / b f n r t u; write \\\\ for itself', at)

    def read_code_unit(self, at: int) -> int:
        digits = self.text[at + 2 : at + 6]
        if re.fullmatch(r"[0-9A-Fa-f]{4}", digits) is None:
            raise JsonError("\\u needs four hexadecimal digits", at)
        return int(digits, 16)

    def read_object(self, start: int, depth: int) -> tuple[JsonObject, int]:
        result = JsonObject()
        result.at = start
        members: list[JsonMember] = []
        first: dict[str, int] = {}
        at = self.skip_blanks(start + 1)
        if self.text.startswith("}", at):
            return result, at + 1
        while True:
            if not self.text.startswith('"', at):
                if self.text.startswith("}", at):
                    raise JsonError("no comma before the closing `}`", self.text.rfind(",", 0, at))
                raise JsonError('a key in double quotation marks is missing here: "key": value', at)
            key_at = at
            key, at = self.read_string(at)
            at = self.skip_blanks(at)
            if not self.text.startswith(":", at):
                raise JsonError(f'a colon is missing after the key "{key}"', at)
            value_at = self.skip_blanks(at + 1)
            value, at = self.read_value(value_at, depth + 1)
            if key in first:
                self.duplicate(key, key_at, first[key])
            else:
                first[key] = key_at
                result[key] = value
                members.append(JsonMember(key, value, key_at, value_at))
            at, ended = self.read_separator(at, "}", "object", start)
            if ended:
                result.members = tuple(members)
                return result, at

    def read_array(self, start: int, depth: int) -> tuple[JsonArray, int]:
        result = JsonArray()
        result.at = start
        offsets: list[int] = []
        at = self.skip_blanks(start + 1)
        if self.text.startswith("]", at):
            return result, at + 1
        while True:
            if self.text.startswith("]", at):
                raise JsonError("no comma before the closing `]`", self.text.rfind(",", 0, at))
            offsets.append(at)
            value, at = self.read_value(at, depth + 1)
            result.append(value)
            at, ended = self.read_separator(at, "]", "array", start)
            if ended:
                result.items_at = tuple(offsets)
                return result, at

    def read_separator(self, at: int, closing: str, kind: str, start: int) -> tuple[int, bool]:
        """Read the separator after a value. Returns the offset after the comma, or after the bracket with True."""
        behind = at
        at = self.skip_blanks(at)
        if self.text.startswith(closing, at):
            return at + 1, True
        if self.text.startswith(",", at):
            return self.skip_blanks(at + 1), False
        if at >= len(self.text):
            raise JsonError(f"this {kind} is never closed; `{closing}` is missing", start)
        raise JsonError(f"a comma or `{closing}` is missing here", behind)
