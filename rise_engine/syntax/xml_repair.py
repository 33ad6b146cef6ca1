"""Finds the most common errors in hand-written XML and repairs them in memory, so that the rest can be checked.

These are a raw `<` or `&` in a condition or a text, and a double quotation mark inside a value in double quotation
marks. Another one is a special blank from a word processor or a web page between parts of a tag. Each gets its own
diagnostic with the corrected text.
"""

from __future__ import annotations

import re
from bisect import bisect_right
from typing import NamedTuple

from rise_engine.base.text import GAP, character_name, find_unseen, match_end
from rise_engine.base.typography import DOUBLE, SINGLE, straight_quote, typography_problem
from rise_engine.syntax.changes import TextEdit

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
_MAX_DISTANCE = 2000
"""Maximum characters in which the end of a value with quotation marks in it is searched."""
_SHOWN = 300
"""Maximum characters of a corrected text in a message."""
_QUOTE_ENTITIES = {'"': "&quot;", "'": "&apos;"}


class Mistake(NamedTuple):
    """An error in a text: the code of a diagnostic, its offset, and a sentence."""

    code: str
    offset: int
    message: str


class RepairedText:
    """A text without the errors that this module repairs, with a map to the offsets of the original."""

    def __init__(self, original: str) -> None:
        repairer = _Repairer(original)
        self._edits = sorted(repairer.find_edits())
        self.mistakes = repairer.mistakes
        """The repaired and the unreadable parts, each with its offset in the original."""
        self._starts: list[int] = []
        """The offset in the repaired text at which each edit begins."""
        pieces: list[str] = []
        position = length = 0
        for start, end, new in self._edits:  # two may meet in one character in a very wrong text
            pieces += (original[position:start], new)
            length += start - position
            self._starts.append(length)
            length += len(new)
            position = end
        self.text = "".join((*pieces, original[position:]))

    def original_offset(self, offset: int) -> int:
        """The offset in the original of an offset in `text`."""
        index = bisect_right(self._starts, offset) - 1
        if index < 0:
            return offset
        start, end, new = self._edits[index]
        into = offset - self._starts[index]
        return start + min(into, end - start) if into < len(new) else end + into - len(new)


class _Repairer:
    """Scans a text that is not well-formed."""

    def __init__(self, text: str) -> None:
        self.text = text
        self.mistakes: list[Mistake] = []
        self.edits: list[TextEdit] = []
        self.searched_until: dict[str, int] = {}
        """The end of the text that was searched in vain for these quotation marks."""

    def report_error(self, code: str, offset: int, message: str) -> None:
        self.mistakes.append(Mistake(code, offset, message))

    def replace(self, start: int, end: int, new: str) -> None:
        self.edits.append(TextEdit(start, end, new))

    def find_edits(self) -> list[TextEdit]:
        """Find all replacements, and note each error."""
        text = self.text
        position = 0
        run_start = 0  # the beginning of the current text between tags
        run_bad: list[tuple[int, str]] = []
        while (mark := _MARK.search(text, position)) is not None:
            start = mark.start()
            if text[start] == "&":
                position = _read_reference(text, start, run_bad)
                continue
            skip = next((closing for opening, closing in _SKIP if text.startswith(opening, start)), None)
            if (left := _LEFT_BY_GIT.match(text, start)) is not None:
                message = "git left this line here when it could not join two versions; delete it, and keep one of them"
                self.report_error("merge-conflict", start, message)
                self.replace(start, left.end(), "")
                position = left.end()
                continue
            if skip is None and not _NAME.match(text, _first_of_name(text, start)):
                run_bad.append((start, "&lt;"))
                position = start + 1
                continue
            self.repair_stretch(run_start, start, run_bad)
            if run_start == 0:
                self.repair_outside_root(0, start)
            if skip is not None:
                end = text.find(skip, start)
                if skip == ">" and end >= 0:
                    self.replace_unusual_spaces(start, end, "")
                position = run_start = end + len(skip) if end >= 0 else len(text)
            else:
                position = run_start = self.repair_start_tag(start)
        self.repair_stretch(run_start, len(text), run_bad)
        self.repair_outside_root(run_start, len(text))
        return self.edits

    def skip_blanks(self, start: int, instead: str) -> int:
        """Skip blanks. Blanks that XML does not know are reported and replaced."""
        end = match_end(_GAP, self.text, start)
        self.replace_unusual_spaces(start, end, instead)
        return end

    def replace_unusual_spaces(self, start: int, end: int, instead: str) -> None:
        """Replace the blanks that XML does not know, with one diagnostic for all of them."""
        first = position = find_unseen(self.text, start, end)
        if first < 0:
            return
        write = "write an ordinary blank" if instead else "delete it"
        message = f"the character {character_name(self.text[first])} is not allowed here; {write}"
        self.report_error("unexpected-text", first, message)
        while position >= 0:
            self.replace(position, position + 1, instead)
            position = find_unseen(self.text, position + 1, end)

    def repair_outside_root(self, start: int, end: int) -> None:
        """Remove unusual spaces before or after the outermost element if nothing else is there."""
        gap = _GAP.match(self.text, start, end)
        if gap is not None and gap.end() == end:
            self.replace_unusual_spaces(start, end, "")

    def repair_start_tag(self, start: int) -> int:
        """Read a start tag tolerantly and repair its attribute values. Returns the offset after it."""
        text = self.text
        position = match_end(_NAME, text, self.skip_blanks(start + 1, ""))
        while True:
            position = self.skip_blanks(position, " ")
            if text.startswith(">", position):
                return position + 1
            attribute = _NAME.match(text, position)
            if attribute is None:
                return position + 1 if text.startswith("/", position) else position
            equals = _EQUALS.match(text, attribute.end())
            if equals is None:
                return attribute.end()
            self.replace_unusual_spaces(equals.start(), equals.end(), " ")
            opening = equals.end()
            end = self.repair_typographic_value(opening)
            if end < 0:
                if text[opening : opening + 1] not in ('"', "'"):
                    return opening
                end = self.find_value_end(opening + 1, text[opening])
                if end < 0:
                    return opening + 1
                self.repair_value(attribute.group(), opening, end)
            position = end + 1

    def repair_typographic_value(self, opening: int) -> int:
        """Repair a value in typographic quotation marks, or one that they close. Returns its end; -1 for others."""
        text = self.text
        curly = bool(straight_quote(text[opening : opening + 1]))
        if not curly and text[opening : opening + 1] not in ('"', "'"):
            return -1
        end = _CURLY_LAST.search(text, opening, opening + _MAX_DISTANCE)
        last = end.start() if end else min(opening + _MAX_DISTANCE, len(text))
        straight = straight_quote(text[opening]) or text[opening]
        for found in _ANY_QUOTE.finditer(text, opening + 1, last):
            if not curly and found.group() == straight:
                return -1  # it is closed correctly
            if not curly and not straight_quote(found.group()):
                continue
            if not _CURLY_ENDS.match(text, found.end()):
                continue
            first = opening if curly else found.start()
            self.report_error("quotes", first, typography_problem(text, first, quote=straight))
            for position in (opening, found.start()):
                self.replace(position, position + 1, straight)
            self.escape_value(opening + 1, found.start(), straight)
            return found.start()
        return -1

    def escape_value(self, start: int, end: int, quote: str) -> None:
        """Replace the characters that are not allowed in a value that has just got its quotation marks."""
        entities = {"<": "&lt;", quote: _QUOTE_ENTITIES[quote]}
        for position in range(start, end):
            character = self.text[position]
            if character in entities:
                self.replace(position, position + 1, entities[character])
            elif character == "&" and _REFERENCE.match(self.text, position) is None:
                self.replace(position, position + 1, "&amp;")

    def find_value_end(self, start: int, quote: str) -> int:
        """The offset of the quotation mark that closes a value; -1: it is never closed.

        A mark that is followed by neither the tag's end nor another attribute is probably part of the value. Then a
        better one is searched in the same line, up to a limit.
        """
        text = self.text
        first = end = text.find(quote, start)
        if end < 0 or _RUNS_ON.search(text, start, end):
            return -1
        line_end = _LINE_END.search(text, end, end + _MAX_DISTANCE)
        last = line_end.start() if line_end else min(end + _MAX_DISTANCE, len(text))
        while not _VALUE_ENDS.match(text, end + 1):
            end = text.find(quote, max(end + 1, self.searched_until.get(quote, 0)), last)
            if end < 0:
                self.searched_until[quote] = last
                return first
        return end

    def repair_value(self, name: str, opening: int, end: int) -> None:
        """Replace characters that are not allowed in a value: a diagnostic for them and one for its quotation marks."""
        text = self.text
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
        if not bad and not quotes:
            return
        corrected = _corrected_excerpt(text, opening + 1, end, bad)
        if quotes:
            corrected = corrected.replace(quote, "'" if quote == '"' else '"')
        written = f"{name}={quote}{corrected}{quote}"
        if bad:
            self.replace_unescaped(bad, written, " in an attribute")
        if quotes:
            message = f"a {quote} inside a value in {quote} marks ends it; write {written}"
            self.report_error("quotes", quotes[0], message)
            for offset in quotes:
                self.replace(offset, offset + 1, _QUOTE_ENTITIES[quote])

    def repair_stretch(self, start: int, end: int, bad: list[tuple[int, str]]) -> None:
        """Replace the wrong characters of one range of text, with one diagnostic for all of them."""
        if bad:
            corrected = _corrected_excerpt(self.text, start, end, bad)
            self.replace_unescaped(bad, " ".join(corrected.split()), "")
            bad.clear()

    def replace_unescaped(self, bad: list[tuple[int, str]], corrected: str, where: str) -> None:
        first = bad[0][0]
        entity = _NAMED.match(self.text, first)
        if entity is not None and entity.group(1) not in ("lt", "gt", "amp", "quot", "apos"):
            message = f"XML does not know `{entity.group()}`; write the character itself"
        else:
            marks = " and ".join(f"`{mark}`" for mark in dict.fromkeys(self.text[offset] for offset, _ in bad))
            they = "they are" if "and" in marks else "it is"
            message = f"{marks} cannot stay as {they}{where}; write {corrected}"
        self.report_error("unescaped", first, message)
        for offset, new in bad:
            self.replace(offset, offset + 1, new)


def _first_of_name(text: str, opening: int) -> int:
    """The expected start of a tag's name: directly after its `<`, or after an invisible character there."""
    end = match_end(_GAP, text, opening + 1)
    return end if find_unseen(text, opening + 1, opening + 2) > 0 else opening + 1


def _read_reference(text: str, start: int, bad: list[tuple[int, str]]) -> int:
    """Skip a `&` reference; a wrong one is added to `bad`."""
    if (reference := _REFERENCE.match(text, start)) is not None:
        return reference.end()
    bad.append((start, "&amp;"))
    return start + 1


def _corrected_excerpt(text: str, start: int, end: int, bad: list[tuple[int, str]]) -> str:
    """A range of text with its wrong characters replaced; for a long one, the surroundings of the first of them."""
    if end - start > _SHOWN:
        first = bad[0][0] if bad else start
        start = max(start, first - _SHOWN // 3)
        end = min(end, start + _SHOWN)
        bad = bad[:_SHOWN]
    escapes = dict(bad)
    return _LINE_ENDS.sub(" ", "".join(escapes.get(index, text[index]) for index in range(start, end)))
