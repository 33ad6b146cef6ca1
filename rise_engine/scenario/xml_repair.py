"""The commonest mistakes in hand-written XML, found and repaired in memory so that the rest of the file can be checked.

These are a raw `<` or `&` in a condition or a text, a double quotation mark inside a value in double quotation marks,
and a blank that XML does not know (from a word processor or a web page) where only blanks can stand. Each gets a
finding of its own with the corrected text.
"""

from __future__ import annotations

import re
from bisect import bisect_right

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.source_files import SourceFile
from rise_engine.text import GAP, character_name, find_unseen, match_end
from rise_engine.typography import DOUBLE, SINGLE, straight_quote, typography_problem

_MARK = re.compile(r"[<&]")
_REFERENCE = re.compile(r"&(?:(lt|gt|amp|quot|apos)|#[0-9]+|#x[0-9A-Fa-f]+);")
_NAMED = re.compile(r"&([A-Za-z][A-Za-z0-9]*);")
_NAME = re.compile(r"[^\W\d][\w.:-]*")
_SKIP = (("<!--", "-->"), ("<![CDATA[", "]]>"), ("<?", "?>"), ("<!", ">"), ("</", ">"))
_VALUE_ENDS = re.compile(rf"{GAP}*+(?:/?>|[^\W\d][\w.:-]*\s*=\s*[\"'])")
_RUNS_ON = re.compile(r"[\r\n][^\S\r\n]*+<|<[\w/!?][^<]*>\s*<|<\w[^<]*=\s*\Z")
_ANY_QUOTE = re.compile(f"[\"'{DOUBLE}{SINGLE}]")
_CURLY_LAST = re.compile(r"[\r\n]|<[\w/!?]")
_CURLY_ENDS = re.compile(rf"{GAP}*+(?:/?>|[^\W\d][\w.:-]*\s*=\s*[\"'{DOUBLE}{SINGLE}])")
_LINE_END = re.compile(r"[\r\n]")
_LEFT_BY_GIT = re.compile(r"(?<![^\n])<{7}(?: [^\r\n]*)?(?=\r?\n|\Z)")
_LINE_ENDS = re.compile(r"[ \t]*+[\r\n]\s*+")
_GAP = re.compile(rf"{GAP}*+")
_EQUALS = re.compile(rf"{GAP}*+={GAP}*+")
_FARTHEST = 2000
"""Characters in which the end of a value with quotation marks in it is looked for."""
_SHOWN = 300
"""Characters of a corrected text in a message, so that messages stay readable whatever a file holds."""


class RepairedText:
    """A text after repair, with the way back to the offsets of the original."""

    def __init__(self, source: SourceFile) -> None:
        self.source = source
        self.text = source.text
        self.searched_until: dict[str, int] = {}
        """How far the text has been searched, in vain, for the end of a value in these quotation marks."""
        self._edits: list[tuple[int, int, str]] = []
        self._starts: list[int] = []

    def replace(self, start: int, end: int, new: str) -> None:
        self._edits.append((start, end, new))

    def apply_edits(self) -> None:
        """Make `text` of the source and the edits."""
        self._edits.sort()
        pieces: list[str] = []
        position = length = 0
        for start, end, new in self._edits:
            pieces += (self.source.text[position:start], new)
            length += start - position
            self._starts.append(length)
            length += len(new)
            position = end
        pieces.append(self.source.text[position:])
        self.text = "".join(pieces)

    def original_offset(self, offset: int) -> int:
        """Where an offset of `text` was before the repair."""
        if not self._starts:
            return offset
        index = bisect_right(self._starts, offset) - 1
        if index < 0:
            return offset
        start, end, new = self._edits[index]
        into = offset - self._starts[index]
        return start + min(into, end - start) if into < len(new) else end + into - len(new)


def repair(source: SourceFile, diagnostics: Diagnostics) -> RepairedText:
    """Look for the mistakes that this module knows, report each, and return the text without them."""
    repaired = RepairedText(source)
    text = source.text
    position = 0
    run_start = 0  # where the present stretch of text between tags begins
    run_bad: list[tuple[int, str]] = []
    while (mark := _MARK.search(text, position)) is not None:
        here = mark.start()
        if text[here] == "&":
            position = _read_reference(text, here, run_bad)
            continue
        skip = next((closing for opening, closing in _SKIP if text.startswith(opening, here)), None)
        if (left := _LEFT_BY_GIT.match(text, here)) is not None:
            message = "git left this line here when it could not join two versions; delete it, and keep one of them"
            diagnostics.error("merge-conflict", source.location(here), message)
            repaired.replace(here, left.end(), "")
            position = left.end()
            continue
        if skip is None and not _NAME.match(text, _first_of_name(text, here)):
            run_bad.append((here, "&lt;"))
            position = here + 1
            continue
        _report_stretch(repaired, diagnostics, run_start, here, run_bad)
        if run_start == 0:
            _repair_outside_root(repaired, diagnostics, 0, here)
        if skip is not None:
            end = text.find(skip, here)
            if skip == ">" and end >= 0:
                _replace_odd_blanks(repaired, diagnostics, here, end, "")
            position = run_start = end + len(skip) if end >= 0 else len(text)
        else:
            position = run_start = _repair_start_tag(repaired, diagnostics, here)
    _report_stretch(repaired, diagnostics, run_start, len(text), run_bad)
    _repair_outside_root(repaired, diagnostics, run_start, len(text))
    repaired.apply_edits()
    return repaired


def _first_of_name(text: str, opening: int) -> int:
    """Where the name of a tag should begin: directly behind its `<`, or behind a character that nobody sees there."""
    end = match_end(_GAP, text, opening + 1)
    return end if find_unseen(text, opening + 1, opening + 2) > 0 else opening + 1


def _skip_blanks(repaired: RepairedText, diagnostics: Diagnostics, start: int, instead: str) -> int:
    """Step over blanks, those that XML does not know too; they are reported and replaced."""
    end = match_end(_GAP, repaired.source.text, start)
    _replace_odd_blanks(repaired, diagnostics, start, end, instead)
    return end


def _replace_odd_blanks(repaired: RepairedText, diagnostics: Diagnostics, start: int, end: int, instead: str) -> None:
    """Replace the blanks that XML does not know; one finding for them all."""
    text = repaired.source.text
    first = position = find_unseen(text, start, end)
    if first < 0:
        return
    write = "write an ordinary blank" if instead else "delete it"
    message = f"the character {character_name(text[first])} cannot stand here; {write}"
    diagnostics.error("unexpected-text", repaired.source.location(first), message)
    while position >= 0:
        repaired.replace(position, position + 1, instead)
        position = find_unseen(text, position + 1, end)


def _repair_outside_root(repaired: RepairedText, diagnostics: Diagnostics, start: int, end: int) -> None:
    """What stands before the outermost element or behind it, when it is nothing but blanks that XML does not know."""
    gap = _GAP.match(repaired.source.text, start, end)
    if gap is not None and gap.end() == end:
        _replace_odd_blanks(repaired, diagnostics, start, end, "")


def _read_reference(text: str, here: int, bad: list[tuple[int, str]]) -> int:
    """Step over a `&`; a wrong one is added to `bad`."""
    if (reference := _REFERENCE.match(text, here)) is not None:
        return reference.end()
    bad.append((here, "&amp;"))
    return here + 1


def _repair_start_tag(repaired: RepairedText, diagnostics: Diagnostics, start: int) -> int:
    """Read a start tag tolerantly, repairing its attribute values. Returns the offset behind it."""
    text = repaired.source.text
    name = _NAME.match(text, _skip_blanks(repaired, diagnostics, start + 1, ""))
    position = name.end() if name else start + 1
    while True:
        position = _skip_blanks(repaired, diagnostics, position, " ")
        if text.startswith(">", position):
            return position + 1
        attribute = _NAME.match(text, position)
        if attribute is None:
            return position + 1 if text.startswith("/", position) else position
        position = attribute.end()
        equals = _EQUALS.match(text, position)
        if equals is None:
            return position
        _replace_odd_blanks(repaired, diagnostics, equals.start(), equals.end(), " ")
        position = equals.end()
        quote = text[position : position + 1]
        end = _repair_typographic_value(repaired, diagnostics, position)
        if end > 0:
            position = end + 1
            continue
        if quote not in ('"', "'") or not quote:
            return position
        end = _find_value_end(repaired, position + 1, quote)
        if end < 0:
            return position + 1
        _repair_value(repaired, diagnostics, attribute.group(), position, end)
        position = end + 1


def _repair_typographic_value(repaired: RepairedText, diagnostics: Diagnostics, opening: int) -> int:
    """Mend a value in typographic quotation marks, or one that they close: the offset of its end; -1 for others."""
    text = repaired.source.text
    curly = bool(straight_quote(text[opening : opening + 1]))
    if not curly and text[opening : opening + 1] not in ('"', "'"):
        return -1
    end = _CURLY_LAST.search(text, opening, opening + _FARTHEST)
    last = end.start() if end else min(opening + _FARTHEST, len(text))
    straight = straight_quote(text[opening]) or text[opening]
    for found in _ANY_QUOTE.finditer(text, opening + 1, last):
        if not curly and found.group() == straight:
            return -1  # it is closed as it should be
        if not curly and not straight_quote(found.group()):
            continue
        if not _CURLY_ENDS.match(text, found.end()):
            continue
        first = opening if curly else found.start()
        diagnostics.error("quotes", repaired.source.location(first), typography_problem(text, first, quote=straight))
        for position in (opening, found.start()):
            repaired.replace(position, position + 1, straight)
        _escape_value(repaired, text, opening + 1, found.start(), straight)
        return found.start()
    return -1


def _escape_value(repaired: RepairedText, text: str, start: int, end: int, quote: str) -> None:
    """Replace what cannot stand in a value that has just got its quotation marks."""
    entities = {"<": "&lt;", quote: "&quot;" if quote == '"' else "&apos;"}
    for position in range(start, end):
        if text[position] in entities:
            repaired.replace(position, position + 1, entities[text[position]])
        elif text[position] == "&" and _REFERENCE.match(text, position) is None:
            repaired.replace(position, position + 1, "&amp;")


def _find_value_end(repaired: RepairedText, start: int, quote: str) -> int:
    """The offset of the quotation mark that closes a value, or -1 when it is never closed.

    A mark that is followed by neither the tag's end nor another attribute was meant as part of the value. That is
    looked for in the same line, and not for ever.
    """
    text = repaired.source.text
    first = end = text.find(quote, start)
    if end < 0 or _RUNS_ON.search(text, start, end):
        return -1
    line_end = _LINE_END.search(text, end, end + _FARTHEST)
    last = line_end.start() if line_end else min(end + _FARTHEST, len(text))
    while not _VALUE_ENDS.match(text, end + 1):
        end = text.find(quote, max(end + 1, repaired.searched_until.get(quote, 0)), last)
        if end < 0:
            repaired.searched_until[quote] = last
            return first
    return end


def _repair_value(repaired: RepairedText, diagnostics: Diagnostics, name: str, opening: int, end: int) -> None:
    text = repaired.source.text
    quote = text[opening]
    bad: list[tuple[int, str]] = []
    quotes: list[int] = []
    position = opening + 1
    while position < end:
        if text[position] == "&":
            position = _read_reference(text, position, bad)
            continue
        if text[position] == "<":
            bad.append((position, "&lt;"))
        elif text[position] == quote:
            quotes.append(position)
        position += 1
    other = "'" if quote == '"' else '"'
    if bad:
        corrected = _corrected_excerpt(text, opening + 1, end, bad)
        if quotes:
            corrected = corrected.replace(quote, other)
        _report_unescaped(repaired, diagnostics, bad, f"{name}={quote}{corrected}{quote}", " in an attribute")
    if quotes:
        inner = _corrected_excerpt(text, opening + 1, end, bad).replace(quote, other)
        diagnostics.error(
            "quotes",
            repaired.source.location(quotes[0]),
            f"a {quote} inside a value in {quote} marks ends it; write {name}={quote}{inner}{quote}",
        )
        for offset in quotes:
            repaired.replace(offset, offset + 1, "&quot;" if quote == '"' else "&apos;")


def _corrected_excerpt(text: str, start: int, end: int, bad: list[tuple[int, str]]) -> str:
    """A stretch of text with its wrong characters replaced; of a long one, what stands around the first of them."""
    if end - start > _SHOWN:
        first = bad[0][0] if bad else start
        start = max(start, first - _SHOWN // 3)
        end = min(end, start + _SHOWN)
        bad = bad[:_SHOWN]
    escapes = dict(bad)
    return _LINE_ENDS.sub(" ", "".join(escapes.get(index, text[index]) for index in range(start, end)))


def _report_stretch(
    repaired: RepairedText, diagnostics: Diagnostics, start: int, end: int, bad: list[tuple[int, str]]
) -> None:
    """One finding for the wrong characters of one stretch of text."""
    if bad:
        corrected = _corrected_excerpt(repaired.source.text, start, end, bad)
        _report_unescaped(repaired, diagnostics, bad, " ".join(corrected.split()), "")
        bad.clear()


def _report_unescaped(
    repaired: RepairedText, diagnostics: Diagnostics, bad: list[tuple[int, str]], corrected: str, where: str
) -> None:
    text = repaired.source.text
    first = bad[0][0]
    entity = _NAMED.match(text, first)
    if entity is not None and entity.group(1) not in ("lt", "gt", "amp", "quot", "apos"):
        message = f"XML does not know `{entity.group()}`; write the character itself"
    else:
        marks = " and ".join(f"`{mark}`" for mark in dict.fromkeys(text[offset] for offset, _ in bad))
        they = "they are" if "and" in marks else "it is"
        message = f"{marks} cannot stand as {they}{where}; write {corrected}"
    diagnostics.error("unescaped", repaired.source.location(first), message)
    for offset, new in bad:
        repaired.replace(offset, offset + 1, new)
