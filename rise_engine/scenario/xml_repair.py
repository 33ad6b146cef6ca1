"""The commonest mistakes in hand-written XML, found and mended in memory so that the rest of the file can be checked.

These are a raw `<` or `&` in a condition or a text, a double quotation mark inside a value in double quotation marks,
and a blank that XML does not know (from a word processor or a web page) where only blanks can stand. Each gets a
finding of its own with the corrected text.
"""

from __future__ import annotations

import re
from bisect import bisect_right

from rise_engine.scenario.diagnostics import Diagnostics
from rise_engine.scenario.source_files import SourceFile
from rise_engine.text import GAP, character_name, find_unseen
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

    def apply_edits(self) -> bool:
        """Apply the edits; False when there are none."""
        self._edits.sort()
        pieces: list[str] = []
        at = length = 0
        for start, end, new in self._edits:
            pieces += (self.source.text[at:start], new)
            length += start - at
            self._starts.append(length)
            length += len(new)
            at = end
        pieces.append(self.source.text[at:])
        self.text = "".join(pieces)
        return bool(self._edits)

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
    mended = RepairedText(source)
    text = source.text
    at = 0
    run_start = 0  # where the present stretch of text between tags begins
    run_bad: list[tuple[int, str]] = []
    while (mark := _MARK.search(text, at)) is not None:
        here = mark.start()
        if text[here] == "&":
            at = _read_reference(text, here, run_bad)
            continue
        skip = next((closing for opening, closing in _SKIP if text.startswith(opening, here)), None)
        if (left := _LEFT_BY_GIT.match(text, here)) is not None:
            message = "git left this line here when it could not join two versions; delete it, and keep one of them"
            diagnostics.error("merge-conflict", source.location(here), message)
            mended.replace(here, left.end(), "")
            at = left.end()
            continue
        if skip is None and not _NAME.match(text, _first_of_name(text, here)):
            run_bad.append((here, "&lt;"))
            at = here + 1
            continue
        _report_stretch(mended, diagnostics, run_start, here, run_bad)
        if run_start == 0:
            _repair_outside_root(mended, diagnostics, 0, here)
        if skip is not None:
            end = text.find(skip, here)
            if skip == ">" and end >= 0:
                _replace_odd_blanks(mended, diagnostics, here, end, "")
            at = run_start = end + len(skip) if end >= 0 else len(text)
        else:
            at = run_start = _repair_start_tag(mended, diagnostics, here)
    _report_stretch(mended, diagnostics, run_start, len(text), run_bad)
    _repair_outside_root(mended, diagnostics, run_start, len(text))
    mended.apply_edits()
    return mended


def _first_of_name(text: str, opening: int) -> int:
    """Where the name of a tag should begin: directly behind its `<`, or behind a character that nobody sees there."""
    gap = _GAP.match(text, opening + 1)
    end = gap.end() if gap else opening + 1
    return end if find_unseen(text, opening + 1, opening + 2) > 0 else opening + 1


def _skip_blanks(mended: RepairedText, diagnostics: Diagnostics, start: int, instead: str) -> int:
    """Step over blanks, those that XML does not know too; they are reported and replaced."""
    gap = _GAP.match(mended.source.text, start)
    end = gap.end() if gap else start
    _replace_odd_blanks(mended, diagnostics, start, end, instead)
    return end


def _replace_odd_blanks(mended: RepairedText, diagnostics: Diagnostics, start: int, end: int, instead: str) -> None:
    """Replace the blanks that XML does not know; one finding for them all."""
    text = mended.source.text
    first = at = find_unseen(text, start, end)
    if first < 0:
        return
    write = "write an ordinary blank" if instead else "delete it"
    message = f"the character {character_name(text[first])} cannot stand here; {write}"
    diagnostics.error("unexpected-text", mended.source.location(first), message)
    while at >= 0:
        mended.replace(at, at + 1, instead)
        at = find_unseen(text, at + 1, end)


def _repair_outside_root(mended: RepairedText, diagnostics: Diagnostics, start: int, end: int) -> None:
    """What stands before the outermost element or behind it, when it is nothing but blanks that XML does not know."""
    gap = _GAP.match(mended.source.text, start, end)
    if gap is not None and gap.end() == end:
        _replace_odd_blanks(mended, diagnostics, start, end, "")


def _read_reference(text: str, here: int, bad: list[tuple[int, str]]) -> int:
    """Step over a `&`; a wrong one is added to `bad`."""
    if (reference := _REFERENCE.match(text, here)) is not None:
        return reference.end()
    bad.append((here, "&amp;"))
    return here + 1


def _repair_start_tag(mended: RepairedText, diagnostics: Diagnostics, start: int) -> int:
    """Read a start tag tolerantly, mending its attribute values. Returns the offset behind it."""
    text = mended.source.text
    name = _NAME.match(text, _skip_blanks(mended, diagnostics, start + 1, ""))
    at = name.end() if name else start + 1
    while True:
        at = _skip_blanks(mended, diagnostics, at, " ")
        if text.startswith(">", at):
            return at + 1
        attribute = _NAME.match(text, at)
        if attribute is None:
            return at + 1 if text.startswith("/", at) else at
        at = attribute.end()
        equals = _EQUALS.match(text, at)
        if equals is None:
            return at
        _replace_odd_blanks(mended, diagnostics, equals.start(), equals.end(), " ")
        at = equals.end()
        quote = text[at : at + 1]
        end = _repair_typographic_value(mended, diagnostics, at)
        if end > 0:
            at = end + 1
            continue
        if quote not in ('"', "'") or not quote:
            return at
        end = _find_value_end(mended, at + 1, quote)
        if end < 0:
            return at + 1
        _repair_value(mended, diagnostics, attribute.group(), at, end)
        at = end + 1


def _repair_typographic_value(mended: RepairedText, diagnostics: Diagnostics, opening: int) -> int:
    """Mend a value in typographic quotation marks, or one that they close: the offset of its end; -1 for others."""
    text = mended.source.text
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
        diagnostics.error("quotes", mended.source.location(first), typography_problem(text, first, quote=straight))
        for at in (opening, found.start()):
            mended.replace(at, at + 1, straight)
        _escape_value(mended, text, opening + 1, found.start(), straight)
        return found.start()
    return -1


def _escape_value(mended: RepairedText, text: str, start: int, end: int, quote: str) -> None:
    """Replace what cannot stand in a value that has just got its quotation marks."""
    entities = {"<": "&lt;", quote: "&quot;" if quote == '"' else "&apos;"}
    for at in range(start, end):
        if text[at] in entities:
            mended.replace(at, at + 1, entities[text[at]])
        elif text[at] == "&" and _REFERENCE.match(text, at) is None:
            mended.replace(at, at + 1, "&amp;")


def _find_value_end(mended: RepairedText, start: int, quote: str) -> int:
    """The offset of the quotation mark that closes a value, or -1 when it is never closed.

    A mark that is followed by neither the tag's end nor another attribute was meant as part of the value. That is
    looked for in the same line, and not for ever.
    """
    text = mended.source.text
    first = end = text.find(quote, start)
    if end < 0 or _RUNS_ON.search(text, start, end):
        return -1
    line_end = _LINE_END.search(text, end, end + _FARTHEST)
    last = line_end.start() if line_end else min(end + _FARTHEST, len(text))
    while not _VALUE_ENDS.match(text, end + 1):
        end = text.find(quote, max(end + 1, mended.searched_until.get(quote, 0)), last)
        if end < 0:
            mended.searched_until[quote] = last
            return first
    return end


def _repair_value(mended: RepairedText, diagnostics: Diagnostics, name: str, opening: int, end: int) -> None:
    text = mended.source.text
    quote = text[opening]
    bad: list[tuple[int, str]] = []
    quotes: list[int] = []
    at = opening + 1
    while at < end:
        if text[at] == "&":
            at = _read_reference(text, at, bad)
            continue
        if text[at] == "<":
            bad.append((at, "&lt;"))
        elif text[at] == quote:
            quotes.append(at)
        at += 1
    other = "'" if quote == '"' else '"'
    if bad:
        corrected = _corrected_excerpt(text, opening + 1, end, bad)
        if quotes:
            corrected = corrected.replace(quote, other)
        _report_unescaped(mended, diagnostics, bad, f"{name}={quote}{corrected}{quote}", " in an attribute")
    if quotes:
        inner = _corrected_excerpt(text, opening + 1, end, bad).replace(quote, other)
        diagnostics.error(
            "quotes",
            mended.source.location(quotes[0]),
            f"a {quote} inside a value in {quote} marks ends it; write {name}={quote}{inner}{quote}",
        )
        for offset in quotes:
            mended.replace(offset, offset + 1, "&quot;" if quote == '"' else "&apos;")


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
    mended: RepairedText, diagnostics: Diagnostics, start: int, end: int, bad: list[tuple[int, str]]
) -> None:
    """One finding for the wrong characters of one stretch of text."""
    if bad:
        corrected = _corrected_excerpt(mended.source.text, start, end, bad)
        _report_unescaped(mended, diagnostics, bad, " ".join(corrected.split()), "")
        bad.clear()


def _report_unescaped(
    mended: RepairedText, diagnostics: Diagnostics, bad: list[tuple[int, str]], corrected: str, where: str
) -> None:
    text = mended.source.text
    first = bad[0][0]
    entity = _NAMED.match(text, first)
    if entity is not None and entity.group(1) not in ("lt", "gt", "amp", "quot", "apos"):
        message = f"XML does not know `{entity.group()}`; write the character itself"
    else:
        marks = " and ".join(f"`{mark}`" for mark in dict.fromkeys(text[offset] for offset, _ in bad))
        they = "they are" if "and" in marks else "it is"
        message = f"{marks} cannot stand as {they}{where}; write {corrected}"
    diagnostics.error("unescaped", mended.source.location(first), message)
    for offset, new in bad:
        mended.replace(offset, offset + 1, new)
