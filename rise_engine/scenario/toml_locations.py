"""TOML files with places: tomllib reads the values, one pass over the text tells where each key and value stands."""

from __future__ import annotations

import re
import tomllib
from datetime import date, time
from functools import partial
from math import isfinite
from typing import Any

from rise_engine.base.json_codec import is_64_bit
from rise_engine.base.text import match_end
from rise_engine.base.typography import find_typographic_closing, typography_problem
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.model import SourceLocation
from rise_engine.scenario.source_files import FileReader, SourceFile

_BLANK = re.compile(r"(?:[ \t\r\n]|#[^\n]*)*")
_SPACE = re.compile(r"[ \t]*")
_KEY = re.compile(r"""[A-Za-z0-9_-]+|"(?:[^"\\]|\\.)*"|'[^']*'""")
_STRING = re.compile(r"""\"{3}(?:\\.|[^\\])*?"{3,5}|'{3}.*?'{3,5}|"(?:[^"\\]|\\.)*"|'[^']*'""", re.DOTALL)
_BARE_VALUE = re.compile(r"[^,\]}\n#]*")
_AT = re.compile(r"\(at (?:line (\d+), column (\d+)|end of document)\)")

_TWICE = re.compile(r"overwrite|declare|redefine|Duplicate|immutable", re.IGNORECASE)
_DOTTED = re.compile(rf"(?:{_KEY.pattern})(?:\s*\.\s*(?:{_KEY.pattern}))*")
_MOST_MISTAKES = 20
"""How many lines of a file are left out before it is given up."""
_MOST_READ = 2_000_000
"""Characters after which a file with mistakes is not read once more."""
_LONG_KEY = re.compile(r"""(?<![\w.-])(?:(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){64}""")
"""A key of more than 64 parts. No author writes one, and the standard library takes quadratic time for it."""

KeyPath = tuple[str, ...]


class TomlFile:
    """The values of a TOML file, and where they stand."""

    def __init__(self, source: SourceFile, values: dict[str, Any]) -> None:
        self.source = source
        self.values = values
        self._offsets_by_path: dict[KeyPath, tuple[int, int]] | None = None

    def key_location(self, *path: str) -> SourceLocation:
        """Where a key stands; for a key that is not there, its nearest parent."""
        return self.source.location(self._offsets(path)[0])

    def value_location(self, *path: str) -> SourceLocation:
        """Where the value of a key stands."""
        return self.source.location(self._offsets(path)[1])

    def find_path(self, dotted: str) -> KeyPath:
        """The path of a key that is written with dots, `actions.Wave.carrier.goal`, as far as it is there. (A part of
        it may have dots itself, in quotation marks.)"""
        path: KeyPath = ()
        inside: Any = self.values
        while dotted and isinstance(inside, dict | list):
            keys = inside if isinstance(inside, dict) else map(str, range(len(inside)))
            part = max((key for key in keys if dotted == key or dotted.startswith(f"{key}.")), key=len, default="")
            if not part:
                break
            inside = inside[part] if isinstance(inside, dict) else inside[int(part)]
            path, dotted = (*path, part), dotted[len(part) + 1 :]
        return path

    def _offsets(self, path: KeyPath) -> tuple[int, int]:
        if self._offsets_by_path is None:
            self._offsets_by_path = _Locator(self.source.text).locate_all()
        while path:
            if path in self._offsets_by_path:
                return self._offsets_by_path[path]
            path = path[:-1]
        return 0, 0


def read_toml(source: SourceFile, diagnostics: Diagnostics) -> TomlFile | None:
    """Read a file. What is not TOML becomes a finding, and the rest is read on without it; None when that fails."""
    text = source.text
    if (long := _LONG_KEY.search(text)) is not None:
        diagnostics.error("toml-syntax", source.location(long.start()), "this key has more than 64 parts")
        return None
    for attempt in range(min(_MOST_MISTAKES, 1 + _MOST_READ // (len(text) + 1))):
        try:
            values = tomllib.loads(text)
        except RecursionError:
            diagnostics.error("toml-syntax", source.location(0), "this is not TOML: values are nested too deeply")
            return None
        except ValueError as error:
            line = _report_syntax_error(str(error), source, text, diagnostics, first=attempt == 0)
            repaired = _blank_out(text, line)
            if repaired == text:
                return None
            text = repaired
        else:
            file = TomlFile(source if text is source.text else SourceFile(source.name, source.data, text), values)
            _check_values(file, diagnostics)
            return file
    return None


def toml_of(source: SourceFile, files: FileReader) -> TomlFile | None:
    """As `read_toml`, unless it was read before; findings go where those of `files` go."""
    return files.memo.read(("toml", source), files.diagnostics, partial(read_toml, source))


def _check_values(file: TomlFile, diagnostics: Diagnostics) -> None:
    """Every value as JSON has it, as the record and the consoles are told it: dates and times become texts.

    A finding for each number that JSON does not have.
    """
    pending: list[tuple[KeyPath, Any]] = [((), file.values)]
    while pending:
        path, holder = pending.pop()
        for key, value in list(holder.items() if isinstance(holder, dict) else enumerate(holder)):
            item = (*path, str(key))
            if isinstance(value, dict | list):
                pending.append((item, value))
            elif isinstance(value, date | time):
                holder[key] = value.isoformat()
            elif isinstance(value, float) and not isfinite(value):
                diagnostics.error("wrong-value", file.value_location(*item), f"`{value}` is no number that can be used")
            elif isinstance(value, int) and not is_64_bit(value):
                sentence = "a whole number of more than 64 bits; write it as a text or as a decimal number (1.5e20)"
                diagnostics.error("wrong-value", file.value_location(*item), sentence)


def _report_syntax_error(message: str, source: SourceFile, text: str, diagnostics: Diagnostics, *, first: bool) -> int:
    """A finding for what tomllib says; gives the number of the line. What follows from the first is left out."""
    position = _AT.search(message)
    end = len(text.rstrip())
    if position is None or position.group(1) is None:
        offset = 0 if position is None else end
    else:
        offset = source.offset(int(position.group(1)), int(position.group(2)))
    sentence = _AT.sub("", message).strip().rstrip(".")
    if _TWICE.search(sentence) is not None:
        line = source.location(offset).line
        at_line = source.line_text(line)
        name, before = _duplicate_key(source, line)
        location = source.location(source.offset(line, len(at_line) - len(at_line.lstrip()) + 1))
        known = f"; it stands in line {before} already" if before else f" ({sentence})"
        diagnostics.error("duplicate-key", location, f"`{name}` is given twice{known}")
        return line
    if first:
        at_end = source.text[offset : offset + 1] in ("", "\r", "\n")  # a text is not closed
        opening = _unclosed_quote(source.text, offset) if at_end else -1
        closing = find_typographic_closing(source.text, opening) if opening >= 0 else -1
        offset = closing if closing >= 0 else offset
        known = typography_problem(source.text, offset)
        diagnostics.error("toml-syntax", source.location(offset), known or f"this is not TOML: {sentence}")
    return source.location(offset).line


def _unclosed_quote(text: str, offset: int) -> int:
    """Where the text begins that is not closed before `offset`, the end of its line; -1 when there is none."""
    line = text.rfind("\n", 0, offset) + 1
    return max(text.rfind('"', line, offset), text.rfind("'", line, offset))


def _duplicate_key(source: SourceFile, line: int) -> tuple[str, int]:
    """What a line gives a second time, as it is written, and the line that gives it first (0: not found)."""
    lines = [each.strip() for each in source.text.split("\n")]
    written = lines[line - 1]
    if written.startswith("["):
        name = written.partition("]")[0].strip("[ \t")
        return name, next((n for n, each in enumerate(lines[: line - 1], 1) if each.startswith(f"[{name}]")), 0)
    found = _DOTTED.match(written)
    name = found.group().strip() if found else written
    for number in range(line - 1, 0, -1):
        each = lines[number - 1]
        if each.startswith("["):
            break
        same = _DOTTED.match(each)
        if same is not None and same.group().strip() == name:
            return name, number
    return name, 0


def _blank_out(text: str, line: int) -> str:
    """The text with a line blanked out; with a table's header, all that belongs to the table."""
    lines = text.split("\n")
    last = line
    if lines[line - 1].lstrip().startswith("["):
        while last < len(lines) and not lines[last].lstrip().startswith("["):
            last += 1
    lines[line - 1 : last] = [" " * len(each) for each in lines[line - 1 : last]]
    return "\n".join(lines)


class _Locator:
    """Walks over a text that is known to be valid TOML."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.found: dict[KeyPath, tuple[int, int]] = {}
        self.lengths: dict[KeyPath, int] = {}
        """How many tables each `[[list]]` has so far."""

    def locate_all(self) -> dict[KeyPath, tuple[int, int]]:
        table: KeyPath = ()
        position = match_end(_BLANK, self.text, 0)
        while position < len(self.text):
            if self.text.startswith("[", position):
                opening = position
                is_list = self.text.startswith("[[", position)
                while self.text.startswith("[", position):
                    position += 1
                position, named = self.read_key(match_end(_SPACE, self.text, position), (), opening)
                position = match_end(_SPACE, self.text, position)
                table = self.enter_table(named, opening, is_list=is_list)
                while self.text.startswith("]", position):
                    position += 1
            else:
                position = self.read_pair(position, table)
            following = match_end(_BLANK, self.text, position)
            if following == position and position < len(self.text):  # cannot happen in valid TOML; never loop
                following = position + 1
            position = following
        return self.found

    def enter_table(self, named: KeyPath, opening: int, *, is_list: bool) -> KeyPath:
        """The path of the table that a header begins: in a `[[list]]`, its number is a part of it."""
        path: KeyPath = ()
        for at, part in enumerate(named, start=1):
            path = (*path, part)
            if is_list and at == len(named):
                self.lengths[path] = self.lengths.get(path, 0) + 1
            if path in self.lengths:
                path = (*path, str(self.lengths[path] - 1))
        self.found.setdefault(path, (opening, opening))
        return path

    def read_key(self, position: int, path: KeyPath, value_at: int) -> tuple[int, KeyPath]:
        """A dotted key: each part is noted. Returns the offset behind it and the whole path."""
        while (part := _KEY.match(self.text, position)) is not None:
            path = (*path, _key_text(part.group()))
            self.found.setdefault(path, (position, value_at if value_at >= 0 else position))
            position = match_end(_SPACE, self.text, part.end())
            if not self.text.startswith(".", position):
                break
            position = match_end(_SPACE, self.text, position + 1)
        return position, path

    def read_pair(self, position: int, table: KeyPath) -> int:
        behind, path = self.read_key(position, table, -1)
        if not self.text.startswith("=", behind):
            return behind
        value_at = match_end(_SPACE, self.text, behind + 1)
        if path in self.found:
            self.found[path] = (self.found[path][0], value_at)
        return self.read_value(value_at, path)

    def read_value(self, position: int, path: KeyPath) -> int:
        text = self.text
        closing = {"[": "]", "{": "}"}.get(text[position : position + 1])
        if closing is None:
            end = match_end(_STRING, text, position)
            return end if end > position else max(match_end(_BARE_VALUE, text, position), position + 1)
        position = match_end(_BLANK, text, position + 1)
        index = 0
        while position < len(text) and not text.startswith(closing, position):
            if closing == "]":
                item = (*path, str(index))
                self.found[item] = (position, position)
                end = self.read_value(position, item)
            else:
                end = self.read_pair(position, path)
            position = match_end(_BLANK, text, max(end, position + 1))
            if text.startswith(",", position):
                position = match_end(_BLANK, text, position + 1)
            index += 1
        return position + 1


def _key_text(written: str) -> str:
    if written[0] not in "\"'":
        return written
    if written[0] == "'" or "\\" not in written:
        return written[1:-1]
    return next(iter(tomllib.loads(f"{written} = 0")))
