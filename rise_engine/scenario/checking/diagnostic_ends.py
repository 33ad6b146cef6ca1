"""Where a diagnostic ends, so that editors can underline it.

Readers only record where it begins. The end follows from the text there: a name that the sentence quotes, a tag, a
value in quotation marks, or a word. It is never after the end of the line.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from msgspec import UNSET
from msgspec.structs import replace

from rise_engine.base.text import match_end
from rise_engine.scenario.checking.uses import written_length
from rise_engine.scenario.diagnostics import Diagnostic
from rise_engine.scenario.files.source_files import SourceFile

_QUOTED = re.compile(r"`([^`\r\n]+)`")
_MOST_QUOTED = 4
"""How many quoted names of a sentence are searched for. The first ones say what is wrong."""
_GOES_ON = re.compile(r"(?<=\w)[\w.]*\w")
"""The rest of a longer name that only begins with the quoted name."""
_MOST = 400
"""The most characters that are underlined, and that are searched in a sentence."""
_LINE = re.compile(r"[^\r\n]*")
_TAG = re.compile(r"<[!?/]?[^\s<>/]*>?")
_WORD = re.compile(r"[^\s<>\"'=,;\[\]{}()]+")
_STRING = re.compile(r"\"{3}[^\r\n]*|'{3}[^\r\n]*|\"(?:[^\"\\\r\n]|\\.)*\"?|'[^'\r\n]*'?")
_HEADER = re.compile(r"\[\[?[^\]\r\n]*\]?\]?")
_VALUE = re.compile(r"[^\s,\]}#=:]+")
_CELL = re.compile(r"\"(?:[^\"]|\"\")*\"?|[^,;\t\r\n]+")


def with_ends(found: Iterable[Diagnostic], sources: Mapping[str, SourceFile]) -> list[Diagnostic]:
    """Add ends to these diagnostics, as far as their files could be read."""
    return [_with_end(each, sources.get(each.location.file)) for each in found]


def _with_end(found: Diagnostic, source: SourceFile | None) -> Diagnostic:
    if source is None or found.end is not UNSET:
        return found
    start = source.offset(found.location.line, found.location.column)
    return replace(found, end=source.location(end_offset(source, start, found.message)))


def end_offset(source: SourceFile, start: int, message: str) -> int:
    """The offset after the last character of the thing at `start` that the sentence is about."""
    line = _LINE.match(source.text[start : start + _MOST])
    text = line.group() if line is not None else ""
    lengths = (written_length(text, 0, name) for name in _QUOTED.findall(message[:_MOST])[:_MOST_QUOTED])
    length = max((each for each in lengths if not _GOES_ON.match(text, each)), default=0)
    return start + max(length or match_end(_pattern(source, start), text, 0), min(1, len(text)))


def _pattern(source: SourceFile, start: int) -> re.Pattern[str]:
    """The pattern of the thing at an offset in a file of this kind."""
    text, name = source.text, source.name.lower()
    character = text[start : start + 1]
    if name.endswith((".toml", ".json")):
        return {'"': _STRING, "'": _STRING, "[": _HEADER}.get(character, _VALUE)
    if name.endswith(".csv"):
        return _CELL
    if character == "<":
        return _TAG
    quote = text[start - 1 : start]
    if quote and quote in "\"'" and text[max(start - 9, 0) : start - 1].rstrip().endswith("="):
        return _ATTRIBUTE_VALUES[quote]
    return _WORD


_ATTRIBUTE_VALUES = {'"': re.compile(r'[^"\r\n]+'), "'": re.compile(r"[^'\r\n]+")}
