"""The written form of TOML: the ranges of tables, keys and values, and the form of new keys and values.

The texts read here are valid (tomllib has read them), so this code only finds places, in linear time.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from math import isfinite
from typing import Any

from msgspec import Struct

from rise_engine.base.text import match_end
from rise_engine.syntax.changes import EditRefused

_SPACE = re.compile(r"[ \t]*")
_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
KEY_PART = re.compile(r"""[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*'""")
"""One part of a dotted key."""
_STRING = re.compile(r"""\"{3}(?:\\.|[^\\])*?"{3,5}|'{3}.*?'{3,5}|"(?:[^"\\]|\\.)*"|'[^']*'""", re.DOTALL)
_BARE_VALUE = re.compile(r"[^,\]}\n#]*")
_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")
_CONTROL = re.compile(r"[\x00-\x1f\x7f]")

KeyPath = tuple[str, ...]


def entries_in(value: Any) -> Mapping[str, Any]:
    """The entries of a table, or of a list by their numbers; none in any other value."""
    if isinstance(value, list):
        return {str(number): each for number, each in enumerate(value)}
    return value if isinstance(value, dict) else {}


def value_at(values: Any, path: Iterable[str]) -> Any:
    """The value at a path of keys and of numbers in lists; None: there is none, because TOML has no null."""
    for part in path:
        values = entries_in(values).get(part)
    return values


class TomlKeyPart(Struct, frozen=True):
    """One part of a dotted key."""

    name: str
    start: int
    """The start of the written form, with quotation marks."""
    end: int


class TomlValue(Struct, frozen=True):
    """A value. An inline table has `pairs`, an array has `items`, a scalar has neither."""

    start: int
    end: int
    kind: str
    """"scalar", "array" or "table"."""
    items: tuple[TomlValue, ...] = ()
    pairs: tuple[TomlPair, ...] = ()


class TomlPair(Struct, frozen=True):
    """`key = value`."""

    parts: tuple[TomlKeyPart, ...]
    value: TomlValue

    @property
    def names(self) -> KeyPath:
        return tuple(part.name for part in self.parts)

    @property
    def start(self) -> int:
        return self.parts[0].start


class TomlSection(Struct):
    """A `[table]` or an element of a `[[list]]`, and the pairs below its header. The first section has no header."""

    path: KeyPath
    """It includes the indexes of list elements."""
    parts: tuple[TomlKeyPart, ...]
    """The parts of its header as written."""
    places: tuple[int, ...]
    """For each of these parts, its index in `path`."""
    start: int
    """The start of its header."""
    header_end: int
    """After the brackets."""
    is_list: bool
    pairs: list[TomlPair]

    @property
    def end(self) -> int:
        """After its last pair, or its header."""
        return self.pairs[-1].value.end if self.pairs else self.header_end


def read_sections(text: str) -> list[TomlSection]:
    """The sections of a valid TOML text in order, beginning with the part before any header."""
    return list(_SyntaxReader(text).read())


def toml_path_at(text: str, at: int) -> KeyPath | None:
    """The path of the entry or table whose name or value contains the character `at` of a valid TOML text.

    >>> toml_path_at('[keys]\\nb = { act = "R_Yes" }', 14)
    ('keys', 'b', 'act')
    """
    for section in read_sections(text):
        for part, place in zip(section.parts, section.places, strict=True):
            if part.start <= at < part.end:
                return section.path[: place + 1]
        if section.start <= at < section.end:
            return _path_in_pairs(section.pairs, section.path, at)
    return None


def _path_in_pairs(pairs: Iterable[TomlPair], path: KeyPath, at: int) -> KeyPath | None:
    for pair in pairs:
        for number, part in enumerate(pair.parts, 1):
            if part.start <= at < part.end:
                return (*path, *pair.names[:number])
        if pair.value.start <= at < pair.value.end:
            return _path_in_value(pair.value, (*path, *pair.names), at)
    return None


def _path_in_value(value: TomlValue, path: KeyPath, at: int) -> KeyPath:
    for number, item in enumerate(value.items):
        if item.start <= at < item.end:
            return _path_in_value(item, (*path, str(number)), at)
    return _path_in_pairs(value.pairs, path, at) or path


def read_places(text: str) -> dict[KeyPath, tuple[int, int]]:
    """The offsets of the key and the value of each entry of a valid TOML text, by its path.

    >>> read_places("[a]\\nb = [1, 2]")
    {(): (0, 0), ('a',): (1, 0), ('a', 'b'): (4, 8), ('a', 'b', '0'): (9, 9), ('a', 'b', '1'): (12, 12)}
    """
    found: dict[KeyPath, tuple[int, int]] = {}
    for section in read_sections(text):
        for number, part in enumerate(section.parts, 1):
            names = tuple(each.name for each in section.parts[:number])
            found.setdefault(names, (part.start, section.start))
        found.setdefault(section.path, (section.start, section.start))
        _note_pairs(section.pairs, section.path, found)
    return found


def _note_pairs(pairs: Iterable[TomlPair], path: KeyPath, found: dict[KeyPath, tuple[int, int]]) -> None:
    for pair in pairs:
        inside = path
        for part in pair.parts:
            inside = (*inside, part.name)
            found.setdefault(inside, (part.start, part.start))
        found[inside] = (found[inside][0], pair.value.start)
        _note_value(pair.value, inside, found)


def _note_value(value: TomlValue, path: KeyPath, found: dict[KeyPath, tuple[int, int]]) -> None:
    for number, item in enumerate(value.items):
        found[(*path, str(number))] = (item.start, item.start)
        _note_value(item, (*path, str(number)), found)
    _note_pairs(value.pairs, path, found)


class _SyntaxReader:
    def __init__(self, text: str) -> None:
        self.text = text
        self.lengths: dict[KeyPath, int] = {}
        """The number of elements of each `[[list]]` so far."""

    def read(self) -> Iterator[TomlSection]:
        section = TomlSection((), (), (), 0, 0, False, [])
        at = match_end(_BLANK, self.text, 0)
        while at < len(self.text):
            if self.text.startswith("[", at):
                yield section
                section = self.read_header(at)
                at = section.header_end
            else:
                pair = self.read_pair(at)
                section.pairs.append(pair)
                at = pair.value.end
            following = match_end(_BLANK, self.text, at)
            at = max(following, at + 1) if following == at else following
        yield section

    def read_header(self, start: int) -> TomlSection:
        is_list = self.text.startswith("[[", start)
        parts, at = self.read_key(match_end(_SPACE, self.text, start + 1 + is_list))
        path: KeyPath = ()
        places: list[int] = []
        for number, part in enumerate(parts, start=1):
            places.append(len(path))
            path = (*path, part.name)
            if is_list and number == len(parts):
                self.lengths[path] = self.lengths.get(path, 0) + 1
            if path in self.lengths:
                path = (*path, str(self.lengths[path] - 1))
        end = match_end(_SPACE, self.text, at) + 1 + is_list
        return TomlSection(path, parts, tuple(places), start, end, is_list, [])

    def read_key(self, at: int) -> tuple[tuple[TomlKeyPart, ...], int]:
        parts: list[TomlKeyPart] = []
        while (found := KEY_PART.match(self.text, at)) is not None:
            parts.append(TomlKeyPart(_key_text(found.group()), at, found.end()))
            at = match_end(_SPACE, self.text, found.end())
            if not self.text.startswith(".", at):
                return tuple(parts), found.end()
            at = match_end(_SPACE, self.text, at + 1)
        return tuple(parts), at

    def read_pair(self, at: int) -> TomlPair:
        parts, at = self.read_key(at)
        at = match_end(_SPACE, self.text, at)
        return TomlPair(parts, self.read_value(match_end(_SPACE, self.text, at + 1)))

    def read_value(self, start: int) -> TomlValue:
        text = self.text
        closing = {"[": "]", "{": "}"}.get(text[start : start + 1])
        if closing is None:
            end = match_end(_STRING, text, start)
            if end == start:
                end = match_end(_BARE_VALUE, text, start)
                end = start + len(text[start:end].rstrip())
            return TomlValue(start, end, "scalar")
        items: list[TomlValue] = []
        pairs: list[TomlPair] = []
        at = match_end(_BLANK, text, start + 1)
        while at < len(text) and not text.startswith(closing, at):
            if closing == "]":
                items.append(self.read_value(at))
                at = items[-1].end
            else:
                pairs.append(self.read_pair(at))
                at = pairs[-1].value.end
            at = match_end(_BLANK, text, at)
            if text.startswith(",", at):
                at = match_end(_BLANK, text, at + 1)
        return TomlValue(start, at + 1, "array" if closing == "]" else "table", tuple(items), tuple(pairs))


def _key_text(written: str) -> str:
    if written[0] not in "\"'":
        return written
    if written[0] == "'" or "\\" not in written:
        return written[1:-1]
    return next(iter(tomllib.loads(f"{written} = 0")))


# --- writing ---------------------------------------------------------------------------------------------------------


def toml_key(name: str) -> str:
    """A key in TOML, in quotation marks if necessary."""
    return name if _BARE_KEY.fullmatch(name) else _basic(name)


def toml_value(value: Any, like: str = "") -> str:
    """A value in one line of TOML.

    :param value: a JSON value.
    :param like: the old value as written; its quotation marks are kept if possible.
    :raises EditRefused: TOML has no such value: null, NaN, a whole number of more than 64 bits.
    """
    match value:
        case bool():
            return "true" if value else "false"
        case str():
            return _written_text(value, like)
        case int() if -(2**63) <= value < 2**63:
            return str(value)
        case float() if isfinite(value):
            return repr(value)
        case list() | tuple():
            return f"[{', '.join(map(toml_value, value))}]"
        case dict():
            pairs = ", ".join(f"{toml_key(key)} = {toml_value(each)}" for key, each in value.items())
            return f"{{ {pairs} }}" if pairs else "{}"
        case None:
            raise EditRefused("a TOML file has no null; leave the entry out instead")
    raise EditRefused(f"a TOML file cannot hold {value}")


def _written_text(value: str, like: str) -> str:
    if like.startswith('"""') and "\n" in value:
        newline = "\r\n" if "\r\n" in like else "\n"
        opening = newline if like.startswith(("\n", "\r\n"), 3) else ""
        return f'"""{opening}{newline.join(_basic(line)[1:-1] for line in value.split(chr(10)))}"""'
    if like.startswith("'") and "'" not in value and _CONTROL.search(value) is None:
        return f"'{value}'"
    return _basic(value)


def _basic(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
