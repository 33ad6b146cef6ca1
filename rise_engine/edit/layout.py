"""Where in a file a new element goes and what stands around it, and what goes with an element that goes.

A new element takes the indentation and the line end of its neighbours, and has a line of its own only if they have. A
comment behind an element on its line belongs to that element; so do comments in the lines directly above it.
"""

from __future__ import annotations

import re
from functools import lru_cache

from msgspec import Struct

from rise_engine.edit.documents import Node, XmlDocument
from rise_engine.edit.plan import Splice

_BOM = b"\xef\xbb\xbf"
_LINE_END = re.compile(rb"\r\n?|\n")
_REST_OF_LINE = re.compile(rb"[ \t]*(?:<!--(?:(?!-->)[^\r\n])*-->[ \t]*)*(?=\r|\n|\Z)")
_ONLY_BLANKS = re.compile(rb"[ \t]*(?=\r|\n|\Z)")
_COMMENT_ABOVE = re.compile(rb"-->[ \t]*(?:\r\n?|\n)\Z")
_EMPTY_LINE = re.compile(rb"(?>\r\n?|\n)[ \t]*(?>\r\n?|\n)")
DEFAULT_UNIT = b"  "


class WritingGap(Struct, frozen=True):
    """A place for something new."""

    start: int
    end: int
    """What stands from `start` to `end` goes: of `<empty/>` the end, elsewhere nothing."""
    before: bytes
    """What is written before the new thing, and after it."""
    after: bytes
    indent: bytes
    """Of the line in which it begins."""
    unit: bytes
    line_end: bytes
    own_line: bool
    """Whether it has lines of its own."""

    def splice(self, file: str, written: bytes) -> Splice:
        """The splice that puts something there."""
        return Splice(file, self.start, self.end, self.before + written + self.after)


# --- lines --------------------------------------------------------------------------------------------------------


def line_start(data: bytes, at: int) -> int:
    """Where the line begins in which a byte stands."""
    start = max(data.rfind(b"\n", 0, at), data.rfind(b"\r", 0, at)) + 1
    return len(_BOM) if start == 0 and data.startswith(_BOM) and at >= len(_BOM) else start


def next_line(data: bytes, at: int) -> int:
    """Where the next line begins."""
    found = _LINE_END.search(data, at)
    return found.end() if found else len(data)


def begins_line(node: Node) -> bool:
    """Whether nothing but blanks stands before an element in its line."""
    data = node.document.data
    return not data[line_start(data, node.start) : node.start].strip(b" \t")


def line_rest(node: Node) -> int:
    """Behind the comments that stand behind an element in its line; -1: something else stands there."""
    found = _REST_OF_LINE.match(node.document.data, node.end)
    return len(node.document.data[: found.end()].rstrip(b" \t")) if found else -1


def has_own_lines(node: Node) -> bool:
    """Whether an element shares its lines with nothing but comments behind it."""
    return begins_line(node) and line_rest(node) >= 0


def indent_of(node: Node) -> bytes:
    """The blanks at the beginning of the line in which an element begins."""
    data = node.document.data
    start = line_start(data, node.start)
    line = data[start : node.start]
    return line[: len(line) - len(line.lstrip(b" \t"))]


def line_end_near(node: Node) -> bytes:
    """The line end that stands next to an element: behind its line, or else before it."""
    data = node.document.data
    found = _LINE_END.search(data, node.end)
    if found:
        return found.group()
    start = line_start(data, node.start)
    if data[:start].endswith(b"\r\n"):
        return b"\r\n"
    return data[start - 1 : start] if start and data[start - 1 : start] in (b"\r", b"\n") else b"\n"


def is_one_line(node: Node) -> bool:
    """Whether an element begins and ends in the same line."""
    return _LINE_END.search(node.document.data, node.start, node.end) is None


@lru_cache(maxsize=64)
def indent_unit(document: XmlDocument) -> bytes:
    """By how much what an element holds stands further right: as the file has it first, else two blanks."""
    for node in document.root.walk():
        parent = node.parent
        if parent is not None and begins_line(node) and begins_line(parent):
            inner, outer = indent_of(node), indent_of(parent)
            if inner.startswith(outer) and len(inner) > len(outer):
                return inner[len(outer) :]
    return DEFAULT_UNIT


def lead_start(node: Node) -> int:
    """Where the line begins that an element begins, or the first of the comments directly above it."""
    data = node.document.data
    start = line_start(data, node.start)
    floor = node.parent.inner_start if node.parent is not None else 0
    while _COMMENT_ABOVE.search(data, max(floor, start - 200), start):
        opening = data.rfind(b"<!--", floor, start)
        above = line_start(data, opening)
        if opening < floor or above < floor or data[above:opening].strip(b" \t"):
            break
        start = above
    return start


# --- something new ------------------------------------------------------------------------------------------------


def gap_behind(node: Node, *, blank_line: bool = False, alone_apart: bool = False) -> WritingGap:
    """Behind a sibling.

    :param blank_line: leave a line empty where the siblings stand in lines of their own with empty lines between.
    :param alone_apart: leave it also behind the only one.
    """
    line_end, indent, unit = line_end_near(node), indent_of(node), indent_unit(node.document)
    if has_own_lines(node):
        at = line_rest(node)
        is_alone = node.parent is not None and len(node.parent.children) == 1
        is_apart = blank_line and (alone_apart if is_alone else is_set_apart(node))
        before = line_end * (2 if is_apart else 1) + indent
        return WritingGap(at, at, before, b"", indent, unit, line_end, own_line=True)
    return WritingGap(node.end, node.end, _separator(node), b"", indent, unit, line_end, own_line=False)


def gap_before(node: Node) -> WritingGap:
    """Before a sibling, and before the comments that belong to it."""
    line_end, indent, unit = line_end_near(node), indent_of(node), indent_unit(node.document)
    if has_own_lines(node):
        at = lead_start(node)
        return WritingGap(at, at, indent, line_end, indent, unit, line_end, own_line=True)
    return WritingGap(node.start, node.start, b"", _separator(node), indent, unit, line_end, own_line=False)


def gap_in(parent: Node) -> WritingGap:
    """In an element that holds no other: behind the comments in it, if there are."""
    data, line_end, outer = parent.document.data, line_end_near(parent), indent_of(parent)
    unit = indent_unit(parent.document)
    own_line = has_own_lines(parent)
    before = line_end + outer + unit if own_line else b""
    behind = line_end + outer if own_line else b""
    indent = outer + unit if own_line else outer
    if parent.is_closed:
        start = len(data[: parent.end - 2].rstrip())
        closing = b"</" + parent.tag.encode() + b">"
        return WritingGap(start, parent.end, b">" + before, behind + closing, indent, unit, line_end, own_line)
    inner = data[parent.inner_start : parent.inner_end]
    at = parent.inner_start + len(inner.rstrip())
    rest = data[at : parent.inner_end]
    if b"\n" in rest or b"\r" in rest:  # the end tag has a line of its own
        if inner.strip():  # comments
            indent = _last_line_indent(data, at)
            before = line_end + indent
        return WritingGap(at, at, before or line_end + outer + unit, b"", indent, unit, line_end, own_line=True)
    return WritingGap(at, parent.inner_end, before, behind, indent, unit, line_end, own_line)


def _last_line_indent(data: bytes, at: int) -> bytes:
    """Of a comment that ends there: the blanks before its beginning."""
    opening = data.rfind(b"<!--", 0, at)
    line = data[line_start(data, opening) : opening]
    return line if not line.strip(b" \t") else line[: len(line) - len(line.lstrip(b" \t"))]


def is_set_apart(node: Node) -> bool:
    """Whether an empty line parts an element from the sibling before it, or the first from the one behind it."""
    siblings = node.parent.children if node.parent is not None else [node]
    at = siblings.index(node)
    if len(siblings) < 2:
        return False
    left, right = (siblings[at - 1], node) if at else (node, siblings[1])
    return _EMPTY_LINE.search(node.document.data, left.end, max(left.end, lead_start(right))) is not None


def _separator(node: Node) -> bytes:
    """What stands between siblings that share a line."""
    siblings = node.parent.children if node.parent is not None else [node]
    data, at = node.document.data, siblings.index(node)
    for left, right in zip(siblings[max(at - 1, 0) :], siblings[max(at, 1) :], strict=False):
        between = data[left.end : right.start]
        if not between.strip(b" \t"):
            return between
    return b""


# --- something that goes ------------------------------------------------------------------------------------------


def removal(first: Node, last: Node | None = None) -> tuple[int, int]:
    """From where to where siblings go, with their lines if these hold nothing else. Comments stay."""
    last = last or first
    data, start, end = first.document.data, first.start, last.end
    begins, behind = begins_line(first), _ONLY_BLANKS.match(data, end)
    if begins and behind is not None:
        start, end = line_start(data, start), next_line(data, end)
        if end == len(data) and not data.endswith((b"\n", b"\r")):  # the last line, without a line end
            return len(data[:start].rstrip(b"\r\n")), end
        if _is_empty_line(data, end) or data.startswith(b"</", end + _blanks_at(data, end)):
            while start > 0 and (above := line_start(data, _line_before(data, start))) < start:
                if data[above:start].strip():
                    break
                start = above
        return start, end
    if begins:
        return start, end + _blanks_at(data, end)
    return len(data[:start].rstrip(b" \t")), end


def _line_before(data: bytes, start: int) -> int:
    """The last byte of the line before one, its line end left out."""
    return start - 2 if data[:start].endswith(b"\r\n") else start - 1


def _is_empty_line(data: bytes, at: int) -> bool:
    return at < len(data) and _ONLY_BLANKS.match(data, at) is not None


def _blanks_at(data: bytes, at: int) -> int:
    return len(data[at:]) - len(data[at:].lstrip(b" \t"))


def collapse(parent: Node) -> tuple[int, int, bytes] | None:
    """An element that would hold nothing more, written `<empty/>`; None while a comment or text stands in it."""
    if parent.marks or parent.text.strip() or any(child.tail.strip() for child in parent.children):
        return None
    return parent.inner_start - 1, parent.end, b"/>"


def block_of(first: Node, last: Node) -> tuple[int, int]:
    """The lines of siblings with the comments that belong to them."""
    data = first.document.data
    return lead_start(first), next_line(data, max(line_rest(last), last.end))
