"""TOML files with places: tomllib reads the values, one pass over the text tells where each key and value stands."""

from __future__ import annotations

import re
import tomllib
from typing import Any

from msgspec import Struct

from rise_engine.scenario.findings import Findings
from rise_engine.scenario.model import Place
from rise_engine.scenario.source import Source

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_KEY = re.compile(r"""[A-Za-z0-9_-]+|"((?:[^"\\]|\\.)*)"|'([^']*)'""")
_BARE_VALUE = re.compile(r"[^,\]}\n#]*")
_AT = re.compile(r"\(at (?:line (\d+), column (\d+)|end of document)\)")

KeyPath = tuple[str, ...]


class TomlFile:
    """The values of a TOML file, and where they stand."""

    def __init__(self, source: Source, values: dict[str, Any]) -> None:
        self.source = source
        self.values = values
        self._places: dict[KeyPath, tuple[int, int]] | None = None

    def place(self, *path: str) -> Place:
        """Where a key stands; for a key that is not there, its nearest parent."""
        return self.source.place(self._offsets(path)[0])

    def value_place(self, *path: str) -> Place:
        """Where the value of a key stands."""
        return self.source.place(self._offsets(path)[1])

    def _offsets(self, path: KeyPath) -> tuple[int, int]:
        if self._places is None:
            self._places = _Locator(self.source.text).run()
        while path:
            if path in self._places:
                return self._places[path]
            path = path[:-1]
        return 0, 0


class Table(Struct, frozen=True):
    """A table of a TOML file with its path, for code that checks it key by key."""

    file: TomlFile
    path: KeyPath
    values: dict[str, Any]

    def place(self, *keys: str) -> Place:
        return self.file.place(*self.path, *keys)

    def value_place(self, *keys: str) -> Place:
        return self.file.value_place(*self.path, *keys)


def read_toml(source: Source, findings: Findings) -> TomlFile | None:
    """Read a file; None after a finding when it is not TOML."""
    try:
        return TomlFile(source, tomllib.loads(source.text))
    except (tomllib.TOMLDecodeError, RecursionError, ValueError) as error:
        message = str(error)
        at = _AT.search(message)
        if at is None:
            offset = 0
        elif at.group(1) is None:
            offset = len(source.text.rstrip())
        else:
            offset = source.offset(int(at.group(1)), int(at.group(2)))
        sentence = _AT.sub("", message).strip().rstrip(".")
        if isinstance(error, RecursionError):
            sentence = "values are nested too deeply"
        if "overwrite" in sentence.lower() or "declare" in sentence.lower():
            offset = source.text.rfind("\n", 0, offset) + 1
            findings.error("duplicate-key", source.place(offset), f"this key or table is given twice ({sentence})")
        else:
            findings.error("toml-syntax", source.place(offset), f"this is not TOML: {sentence}")
        return None


class _Locator:
    """Walks over a text that is known to be valid TOML."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.found: dict[KeyPath, tuple[int, int]] = {}

    def run(self) -> dict[KeyPath, tuple[int, int]]:
        table: KeyPath = ()
        at = self.blank(0)
        while at < len(self.text):
            if self.text.startswith("[", at):
                opening = at
                while self.text.startswith("[", at):
                    at += 1
                at, table = self.key(self.space(at), (), opening)
                at = self.space(at)
                while self.text.startswith("]", at):
                    at += 1
            else:
                at = self.pair(at, table)
            following = self.blank(at)
            if following == at and at < len(self.text):  # cannot happen in valid TOML; never loop
                following = at + 1
            at = following
        return self.found

    def blank(self, at: int) -> int:
        found = _BLANK.match(self.text, at)
        return found.end() if found else at

    def space(self, at: int) -> int:
        found = _SPACE.match(self.text, at)
        return found.end() if found else at

    def key(self, at: int, path: KeyPath, value_at: int) -> tuple[int, KeyPath]:
        """A dotted key: each part is noted. Returns the offset behind it and the whole path."""
        while (part := _KEY.match(self.text, at)) is not None:
            path = (*path, _key_text(part))
            self.found.setdefault(path, (at, value_at if value_at >= 0 else at))
            at = self.space(part.end())
            if not self.text.startswith(".", at):
                break
            at = self.space(at + 1)
        return at, path

    def pair(self, at: int, table: KeyPath) -> int:
        behind, path = self.key(at, table, -1)
        if not self.text.startswith("=", behind):
            return behind
        value_at = self.space(behind + 1)
        if path in self.found:
            self.found[path] = (self.found[path][0], value_at)
        return self.value(value_at, path)

    def value(self, at: int, path: KeyPath) -> int:
        text = self.text
        for quote in ('"""', "'''"):
            if text.startswith(quote, at):
                return self.long_string(at, quote)
        character = text[at : at + 1]
        if character in ('"', "'"):
            string = _KEY.match(text, at)
            return string.end() if string else at + 1
        if character == "[":
            at = self.blank(at + 1)
            index = 0
            while at < len(text) and not text.startswith("]", at):
                self.found[(*path, str(index))] = (at, at)
                at = self.blank(self.value(at, (*path, str(index))))
                at = self.blank(at + 1) if text.startswith(",", at) else at
                index += 1
            return at + 1
        if character == "{":
            at = self.blank(at + 1)
            while at < len(text) and not text.startswith("}", at):
                before = at
                at = self.blank(self.pair(at, path))
                at = self.blank(at + 1) if text.startswith(",", at) else at
                at = max(at, before + 1)
            return at + 1
        bare = _BARE_VALUE.match(text, at)
        return max(bare.end() if bare else at, at + 1)

    def long_string(self, at: int, quote: str) -> int:
        end = at + 3
        while end < len(self.text):
            if quote == '"""' and self.text[end] == "\\":
                end += 2
            elif self.text.startswith(quote, end):
                end += 3
                while end < len(self.text) and self.text[end] == quote[0]:  # up to two more belong to the text
                    end += 1
                return end
            else:
                end += 1
        return end


def _key_text(part: re.Match[str]) -> str:
    if part.group(2) is not None:
        return part.group(2)
    if part.group(1) is not None:
        if "\\" not in part.group(1):
            return part.group(1)
        try:
            return next(iter(tomllib.loads(f'"{part.group(1)}" = 0')))
        except tomllib.TOMLDecodeError:
            return part.group(1)
    return part.group()
