"""Processes all diagnostics: silences warnings, and adds the ends of their ranges.

Authors silence warnings at their places, with a reason (docs/reference/scenario.md).

    <!-- check: allow ambiguous-else: the outer one is meant -->      directly before the element
    # check: allow unheard-event: the camera node listens             directly before the line, in TOML
    [check] allow = [{ code = "unwritable-key", key = "Prénom", reason = "..." }]      for memory.json

Errors cannot be silenced. A comment that is unreadable, or silences nothing, is reported itself.

Readers only record the start of a diagnostic. Its end, for editors that underline it, follows from the text: a name
that the sentence quotes, a tag, a value in quotation marks, or a word. It is never after the end of the line.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from operator import attrgetter

from msgspec import UNSET, Struct
from msgspec.structs import replace

from rise_engine.base.nearest_name import suggest
from rise_engine.base.text import match_end
from rise_engine.scenario.checking.uses import written_length
from rise_engine.scenario.diagnostics import WARNING_CODES, Diagnostic, Diagnostics, join_uses
from rise_engine.scenario.files.source_files import SourceFile
from rise_engine.scenario.model import SourceLocation, TemplateLocation

_MARK = "check:"
_ALLOW = re.compile(r"\s*check:\s*allow\b(.*)", re.DOTALL)
_PARTS = re.compile(r"\s+([\w-]+)\s*(?::(.*))?\Z", re.DOTALL)
_BLANK = re.compile(r"\s*+")
_START_TAG = re.compile(r"<[^!?/>\"'\s](?:[^>\"']++|\"[^\"]*+\"|'[^']*+')*+>")
_TOML_LINE = re.compile(r"[ \t]*#(.*)")
EXAMPLE = "check: allow ambiguous-else: the outer one is meant"


class Suppression(Struct, frozen=True):
    """A silencing of the warnings with a code, in a range of a file."""

    location: SourceLocation
    """The place of the comment or entry."""
    code: str
    reason: str
    file: str
    start: tuple[int, int]
    """Line and column."""
    end: tuple[int, int]
    """After the last location."""

    def covers(self, diagnostic: Diagnostic, location: SourceLocation | TemplateLocation) -> bool:
        """Whether it silences a diagnostic at this location."""
        return (
            diagnostic.severity == "warning"
            and (diagnostic.code, location.file) == (self.code, self.file)
            and self.start <= (location.line, location.column) < self.end
        )


_start = attrgetter("start")


class SuppressedWarning(Struct, frozen=True):
    """A silenced warning, and the reason."""

    diagnostic: Diagnostic
    reason: str


def apply_suppressions(
    suppressions: Sequence[Suppression], diagnostics: Diagnostics
) -> tuple[list[Diagnostic], list[SuppressedWarning]]:
    """Return the remaining diagnostics, and the silenced warnings.

    A silencing without effect is also reported, unless errors left parts unchecked.
    """
    complete = not diagnostics.errors
    silenced: list[SuppressedWarning] = []
    used: set[Suppression] = set()
    groups: dict[tuple[str, str], list[Suppression]] = {}
    for suppression in sorted(suppressions, key=_start):
        group = groups.setdefault((suppression.file, suppression.code), [])
        if not group or group[-1].start < suppression.start:
            group.append(suppression)
    for diagnostic in diagnostics.sorted():
        for location in (diagnostic.location, diagnostic.location.template):  # the `<use>`, and its template
            if location is UNSET:
                continue
            group = groups.get((location.file, diagnostic.code), [])
            before = bisect_right(group, (location.line, location.column), key=_start)
            if before and group[before - 1].covers(diagnostic, location):
                used.add(group[before - 1])
                silenced.append(SuppressedWarning(diagnostic, group[before - 1].reason))
                break
    for suppression in suppressions if complete else ():
        if suppression not in used:
            message = f"this silences nothing: what follows has no warning `{suppression.code}`; delete it"
            diagnostics.warning("unused-allow", suppression.location, message)
    covered = {warning.diagnostic for warning in silenced}
    return join_uses(each for each in diagnostics.sorted() if each not in covered), silenced


def read_suppressions(sources: Sequence[SourceFile], diagnostics: Diagnostics) -> list[Suppression]:
    """Read the silencing comments of XML and TOML files."""
    found: list[Suppression] = []
    for source in sources:
        if _MARK not in source.text:
            continue
        if source.name.lower().endswith(".toml"):
            found += _read_toml_comments(source, diagnostics)
        elif source.text.lstrip().startswith("<"):
            found += _read_xml_comments(source, diagnostics)
    return found


def check_warning_code(code: str, location: SourceLocation, diagnostics: Diagnostics) -> bool:
    """Whether a code is a warning's; reports it if not."""
    if code in WARNING_CODES:
        return True
    near = suggest(code, WARNING_CODES, limit=0)
    diagnostics.warning("bad-allow", location, f"there is no warning `{code}` to silence", near)
    return False


def _parse_comment(comment: str, location: SourceLocation, diagnostics: Diagnostics) -> tuple[str, str] | None:
    """Return the code and reason of a silencing comment; None: another comment, or a wrong one with a diagnostic."""
    suppression = _ALLOW.match(comment)
    if suppression is None:
        return None
    parts = _PARTS.match(suppression.group(1))
    if parts is None:
        diagnostics.warning(
            "bad-allow", location, f"this silences nothing; write a code and a reason, as in: {EXAMPLE}"
        )
        return None
    code, reason = parts.group(1), (parts.group(2) or "").strip()
    if not check_warning_code(code, location, diagnostics):
        return None
    if not reason:
        diagnostics.warning("bad-allow", location, f"say why: check: allow {code}: REASON")
        return None
    return code, " ".join(reason.split())


def _read_xml_comments(source: SourceFile, diagnostics: Diagnostics) -> Iterator[Suppression]:
    text = source.text
    pending: list[tuple[SourceLocation, str, str]] = []
    """Comments whose element is still to come; other comments may follow them."""
    position = 0
    while (opened := text.find("<!", position)) >= 0:
        if not text.startswith("<!--", opened):
            position = text.find("]]>", opened) if text.startswith("<![CDATA[", opened) else opened + 2
            if position < 0:
                return
            continue
        position = text.find("-->", opened)
        if position < 0:
            return
        parsed = _parse_comment(text[opened + 4 : position], source.location(opened), diagnostics)
        if parsed is not None:
            pending.append((source.location(opened), *parsed))
        position = match_end(_BLANK, text, position + 3)
        if pending and not text.startswith("<!--", position):
            element = _element_at(text, position)
            start, end = (source.location(offset) for offset in element or (position, position))
            for location, code, reason in pending:
                if element is None:
                    message = "no element follows here; put this directly before the element that is meant"
                    diagnostics.warning("bad-allow", location, message)
                else:
                    yield Suppression(
                        location, code, reason, source.name, (start.line, start.column), (end.line, end.column)
                    )
            pending.clear()


def _element_at(text: str, start: int) -> tuple[int, int] | None:
    """The range of the start tag and the text of an element; None: there is no element."""
    tag = _START_TAG.match(text, start)
    if tag is None:
        return None
    end = tag.end()
    while not tag.group().endswith("/>"):
        end = text.find("<", end)
        closing = "-->" if text.startswith("<!--", end) else "]]>" if text.startswith("<![CDATA[", end) else ""
        if not closing:
            break
        end = text.find(closing, end)
        if end < 0:
            break
    return start, end if end >= 0 else len(text)


def _read_toml_comments(source: SourceFile, diagnostics: Diagnostics) -> Iterator[Suppression]:
    pending: list[tuple[SourceLocation, str, str]] = []
    for number, line in enumerate(source.text.split("\n"), 1):
        comment = _TOML_LINE.match(line)
        if comment is not None:
            location = SourceLocation(source.name, number, line.find("#") + 1)
            parsed = _parse_comment(comment.group(1), location, diagnostics)
            if parsed is not None:
                pending.append((location, *parsed))
        elif line.strip():
            for location, code, reason in pending:
                yield Suppression(location, code, reason, source.name, (number, 1), (number + 1, 1))
            pending.clear()
    for location, _, _ in pending:
        message = "no line follows here; put this directly before the line that is meant"
        diagnostics.warning("bad-allow", location, message)


def memory_suppressions(
    suppressions: Sequence[tuple[SourceLocation, str, str, str]], keys: Mapping[str, SourceLocation]
) -> Iterator[Suppression]:
    """The silencings in scenario.toml for the memory file: location, code, key and reason of each."""
    for location, code, key, reason in suppressions:
        where = keys.get(key, SourceLocation(""))  # an unknown key has no place, so nothing is silenced
        yield Suppression(
            location, code, reason, where.file, (where.line, where.column), (where.line, where.column + 1)
        )


# --- ends -------------------------------------------------------------------------------------------------------------


_QUOTED = re.compile(r"`([^`\r\n]+)`")
_MAX_QUOTED = 4
"""Maximum number of quoted names of a sentence that are searched for. The first ones are the subject."""
_NAME_CONTINUES = re.compile(r"(?<=\w)[\w.]*\w")
"""The rest of a longer name that only begins with the quoted name."""
_MAX_CHARACTERS = 400
"""Maximum number of characters that are underlined, and that are searched in a sentence."""
_LINE = re.compile(r"[^\r\n]*")
_TAG = re.compile(r"<[!?/]?[^\s<>/]*>?")
_WORD = re.compile(r"[^\s<>\"'=,;\[\]{}()]+")
_STRING = re.compile(r"\"{3}[^\r\n]*|'{3}[^\r\n]*|\"(?:[^\"\\\r\n]|\\.)*\"?|'[^'\r\n]*'?")
_HEADER = re.compile(r"\[\[?[^\]\r\n]*\]?\]?")
_VALUE = re.compile(r"[^\s,\]}#=:]+")
_CELL = re.compile(r"\"(?:[^\"]|\"\")*\"?|[^,;\t\r\n]+")


def with_ends(found: Iterable[Diagnostic], sources: Mapping[str, SourceFile]) -> list[Diagnostic]:
    """Add ends to these diagnostics, if their files could be read."""
    return [_with_end(each, sources.get(each.location.file)) for each in found]


def _with_end(found: Diagnostic, source: SourceFile | None) -> Diagnostic:
    if source is None or found.end is not UNSET:
        return found
    start = source.offset(found.location.line, found.location.column)
    return replace(found, end=source.location(end_offset(source, start, found.message)))


def end_offset(source: SourceFile, start: int, message: str) -> int:
    """The offset after the last character of the text at `start` that the sentence is about."""
    line = _LINE.match(source.text[start : start + _MAX_CHARACTERS])
    text = line.group() if line is not None else ""
    lengths = (written_length(text, 0, name) for name in _QUOTED.findall(message[:_MAX_CHARACTERS])[:_MAX_QUOTED])
    length = max((each for each in lengths if not _NAME_CONTINUES.match(text, each)), default=0)
    return start + max(length or match_end(_pattern(source, start), text, 0), min(1, len(text)))


def _pattern(source: SourceFile, start: int) -> re.Pattern[str]:
    """The pattern of the text at an offset in a file of this kind."""
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
