"""TOML files of a scenario: their values, the place of each, and their tables, read key by key.

A wrong value is reported and replaced by its default.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable
from datetime import date, time
from functools import partial
from math import isfinite
from typing import Any

from rise_engine.base.json_codec import is_64_bit
from rise_engine.base.nearest_name import Correction, suggest
from rise_engine.base.text import match_end
from rise_engine.base.typography import find_typographic_closing, typography_problem
from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.files.source_files import FileReader, SourceFile
from rise_engine.scenario.model import SourceLocation
from rise_engine.syntax.toml import KEY_PART, KeyPath, read_places

_AT = re.compile(r"\(at (?:line (\d+), column (\d+)|end of document)\)")

_DUPLICATE_KEY = re.compile(r"overwrite|declare|redefine|Duplicate|immutable", re.IGNORECASE)
_DOTTED = re.compile(rf"(?:{KEY_PART.pattern})(?:\s*\.\s*(?:{KEY_PART.pattern}))*")
_BASIC = re.compile(r"\\(?:u[0-9A-Fa-f]{4}|U[0-9A-Fa-f]{8}|[ \t]*\r?\n\s*|.)|\r\n|.", re.DOTALL)
"""One character of a text in double quotation marks."""
_MAX_MISTAKES = 20
"""Number of wrong lines after which a file is given up."""
_MAX_READ = 2_000_000
"""Maximum characters that are read to skip wrong lines of a file."""
_LONG_KEY = re.compile(r"""(?<![\w.-])(?:(?:[A-Za-z0-9_-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){64}""")
"""A key of more than 64 parts, for which the standard library takes quadratic time."""


class TomlFile:
    """The values of a TOML file, and their places."""

    def __init__(self, source: SourceFile, values: dict[str, Any]) -> None:
        self.source = source
        self.values = values
        self._offsets_by_path: dict[KeyPath, tuple[int, int]] | None = None

    def key_location(self, *path: str) -> SourceLocation:
        """The place of a key; for a missing key, its nearest parent."""
        return self.source.location(self._offsets(path)[0])

    def value_location(self, *path: str) -> SourceLocation:
        """The place of the value of a key."""
        return self.source.location(self._offsets(path)[1])

    def find_path(self, dotted: str) -> KeyPath:
        """The existing part of a path such as `actions.Wave.carrier.goal`. (A quoted part may contain dots.)"""
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
            self._offsets_by_path = read_places(self.source.text)
        while path:
            if path in self._offsets_by_path:
                return self._offsets_by_path[path]
            path = path[:-1]
        return 0, 0


def read_toml(source: SourceFile, diagnostics: Diagnostics) -> TomlFile | None:
    """Read a file. Lines that are not TOML are reported and skipped; None if that fails."""
    text = source.text
    if (long := _LONG_KEY.search(text)) is not None:
        diagnostics.error("toml-syntax", source.location(long.start()), "this key has more than 64 parts")
        return None
    for attempt in range(min(_MAX_MISTAKES, 1 + _MAX_READ // (len(text) + 1))):
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
    """Like `read_toml`, but reads a file only once. Diagnostics go to those of `files`."""
    return files.memo.read(("toml", source), files.diagnostics, partial(read_toml, source))


def _check_values(file: TomlFile, diagnostics: Diagnostics) -> None:
    """Turn dates and times into texts, because records and consoles need JSON values.

    Reports each number that JSON does not have.
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
                diagnostics.error(
                    "wrong-value", file.value_location(*item), f"`{value}` is not a number that can be used"
                )
            elif isinstance(value, int) and not is_64_bit(value):
                sentence = "a whole number of more than 64 bits; write it as a text or as a decimal number (1.5e20)"
                diagnostics.error("wrong-value", file.value_location(*item), sentence)


def _report_syntax_error(message: str, source: SourceFile, text: str, diagnostics: Diagnostics, *, first: bool) -> int:
    """Report tomllib's message, except for consequences of the first error. Returns the number of the line."""
    position = _AT.search(message)
    end = len(text.rstrip())
    if position is None or position.group(1) is None:
        offset = 0 if position is None else end
    else:
        offset = source.offset(int(position.group(1)), int(position.group(2)))
    sentence = _AT.sub("", message).strip().rstrip(".")
    if _DUPLICATE_KEY.search(sentence) is not None:
        line = source.location(offset).line
        at_line = source.line_text(line)
        name, before = _duplicate_key(source, line)
        location = source.location(source.offset(line, len(at_line) - len(at_line.lstrip()) + 1))
        known = f"; it is already in line {before}" if before else f" ({sentence})"
        diagnostics.error("duplicate-key", location, f"`{name}` is given twice{known}")
        return line
    if first:
        at_end = source.text[offset : offset + 1] in ("", "\r", "\n")  # an unclosed text
        opening = _unclosed_quote(source.text, offset) if at_end else -1
        closing = find_typographic_closing(source.text, opening) if opening >= 0 else -1
        offset = closing if closing >= 0 else offset
        known = typography_problem(source.text, offset)
        diagnostics.error("toml-syntax", source.location(offset), known or f"this is not TOML: {sentence}")
    return source.location(offset).line


def _unclosed_quote(text: str, offset: int) -> int:
    """The beginning of the unclosed text before `offset`, the end of its line; -1: there is none."""
    line = text.rfind("\n", 0, offset) + 1
    return max(text.rfind('"', line, offset), text.rfind("'", line, offset))


def _duplicate_key(source: SourceFile, line: int) -> tuple[str, int]:
    """The name that a line defines again, as written, and the line of its first definition (0: not found)."""
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
    """Blank out a line; for a table's header, the whole table."""
    lines = text.split("\n")
    last = line
    if lines[line - 1].lstrip().startswith("["):
        while last < len(lines) and not lines[last].lstrip().startswith("["):
            last += 1
    lines[line - 1 : last] = [" " * len(each) for each in lines[line - 1 : last]]
    return "\n".join(lines)


# --- texts ----------------------------------------------------------------------------------------------------------


class WrittenText:
    """A text as written in a file, with or without quotation marks."""

    def __init__(self, source: SourceFile, offset: int, value: str) -> None:
        """
        :param source: the file.
        :param offset: where the text begins, including its quotation marks.
        :param value: its value.
        """
        text = source.text
        quotes = next((each for each in ('"""', "'''", '"', "'") if text.startswith(each, offset)), "")
        at = offset + len(quotes)
        if len(quotes) == 3:  # a line end directly after them is not part of the text
            at = match_end(re.compile(r"\r?\n"), text, at)
        self.starts: list[int] = []
        for _ in value:
            self.starts.append(at)
            if quotes.startswith('"') and (unit := _BASIC.match(text, at)) is not None:
                while unit is not None and len(unit.group()) > 1 and unit.group()[1:].strip() == "":
                    at = unit.end()  # a backslash at the end of a line joins it to the next
                    unit = _BASIC.match(text, at)
                self.starts[-1] = at
                at = unit.end() if unit is not None else at
            else:
                at += 2 if text.startswith("\r\n", at) else 1
        self.starts.append(at)

    def span(self, start: int, length: int) -> tuple[int, int]:
        """The offset and length in the file of these characters of the value."""
        return self.starts[start], self.starts[start + length] - self.starts[start]


def character_location(file: TomlFile, path: KeyPath, value: str, at: int) -> SourceLocation:
    """The place of a character in the text at a path. `at` counts from 0, and may be the text's end."""
    start = file.value_location(*path)
    written = WrittenText(file.source, file.source.offset(start.line, start.column), value)
    return file.source.location(written.starts[min(at, len(value))])


# --- tables -----------------------------------------------------------------------------------------------------------


_KINDS: dict[type, str] = {str: "a text", bool: "true or false", dict: "a table"}


class TomlTable:
    """A table of a TOML file, or the file itself."""

    def __init__(self, file: TomlFile, path: KeyPath, values: dict[str, Any], diagnostics: Diagnostics) -> None:
        self.file = file
        self.path = path
        self.values = values
        self.diagnostics = diagnostics

    @property
    def name(self) -> str:
        """Its own key."""
        return self.path[-1]

    def key_location(self, *keys: str) -> SourceLocation:
        return self.file.key_location(*self.path, *keys)

    def value_location(self, *keys: str) -> SourceLocation:
        return self.file.value_location(*self.path, *keys)

    def report_key(self, code: str, message: str, *keys: str, suggestion: Correction | None = None) -> None:
        """Report an error at a key; without a key, at the table."""
        self.diagnostics.error(code, self.key_location(*keys), message, suggestion)

    def report_value(self, code: str, key: str, message: str, suggestion: Correction | None = None) -> None:
        """Report an error at the value of a key."""
        self.diagnostics.error(code, self.value_location(key), message, suggestion)

    def report_unknown_keys(self, known: Iterable[str]) -> None:
        """Report an error for each unknown key."""
        names = tuple(known)
        for key in self.values:
            if key not in names:
                self.report_key("unknown-key", f"unknown key `{key}`", key, suggestion=suggest(key, names))

    def subtable(self, key: str, form: str = "") -> TomlTable | None:
        """The table at a key, an empty one if there is none; None, after a diagnostic, for another value."""
        if isinstance(values := self.values.get(key, {}), dict):
            return TomlTable(self.file, (*self.path, key), values, self.diagnostics)
        self.report_key("wrong-type", form or f"`{key}` is a table: [{key}]", key)
        return None

    def section(self, key: str, known: Iterable[str] | None = None) -> TomlTable:
        """The table `[key]`, in which only `known` keys are allowed; an empty one for any other value."""
        table = self.subtable(key) or TomlTable(self.file, (*self.path, key), {}, self.diagnostics)
        if known is not None:
            table.report_unknown_keys(known)
        return table

    def read(self, key: str, type_: type, usual: Any, form: str = "") -> Any:
        """The value of a key: a str, bool or dict. `form` ends the message about another type."""
        if key not in self.values or isinstance(self.values[key], type_):
            return self.values.get(key, usual)
        self.report_value("wrong-type", key, f"`{key}` is {_KINDS[type_]}{form}")
        return usual

    def read_texts(self, key: str, usual: tuple[str, ...]) -> tuple[str, ...]:
        """Read a list of texts that are not empty."""
        value = self.values.get(key, list(usual))
        if isinstance(value, list) and all(isinstance(item, str) and item for item in value):
            return tuple(value)
        self.report_value("wrong-type", key, f'`{key}` is a list of texts: ["...", "..."]')
        return usual

    def read_label(self, example: str, longest: int, if_empty: str) -> str:
        """Read `label`, a name on screens, in one line; empty: there is none. `if_empty` is the remedy."""
        written = self.read("label", str, None, form=f": label = {example}")
        if written is None:
            return ""
        label = " ".join(written.split())
        if not label:
            self.report_value("missing-value", "label", f"`label` is empty; {if_empty}")
        elif len(label) > longest:
            message = f"`label` has {len(label)} characters; there is room for {longest}"
            self.report_value("out-of-range", "label", message)
        elif not label.isprintable():
            self.report_value("wrong-value", "label", "`label` has a character that cannot be shown")
        else:
            return label
        return ""

    def read_number(self, key: str, usual: float | None, of: str = "") -> float | None:
        """Read a number, or None. `of` ends its name in a message: ` of seconds`."""
        value = self.values.get(key, usual)
        if value is None or (isinstance(value, int | float) and not isinstance(value, bool)):
            return value
        self.report_value("wrong-type", key, f"`{key}` is a number{of}")
        return usual


def is_integer(value: Any) -> bool:
    """Whether a TOML value is a whole number. For Python, booleans are integers, too."""
    return isinstance(value, int) and not isinstance(value, bool)


def read_seconds(table: TomlTable, key: str, usual: float | None, least: float, most: float) -> float | None:
    """Read a number of seconds within these limits."""
    value = table.read_number(key, usual, " of seconds")
    if value is None or least <= value <= most:
        return value if value is None else float(value)
    table.report_value("out-of-range", key, f"`{key}` is from {least:g} to {most:g} seconds")
    return usual
