"""The place of a new element in a file, its surroundings, and the removal of elements.

A new element takes the indentation and line end of its neighbours, and has its own line only if they do. Comments on an
element's line and in the lines directly above it belong to the element.
"""

from __future__ import annotations

import re
from functools import lru_cache

from msgspec import Struct

from rise_engine.base.text import BLANKS
from rise_engine.syntax.changes import Splice
from rise_engine.syntax.xml import Element, XmlTree
from rise_engine.syntax.xml_writing import NewElement

_LINE_END = re.compile(r"\r\n?|\n")
_REST_OF_LINE = re.compile(r"[ \t]*(?:<!--(?:(?!-->)[^\r\n])*-->[ \t]*)*(?=\r|\n|\Z)")
_ONLY_BLANKS = re.compile(r"[ \t]*(?=\r|\n|\Z)")
_COMMENT_ABOVE = re.compile(r"-->[ \t]*(?:\r\n?|\n)\Z")
_EMPTY_LINE = re.compile(r"(?>\r\n?|\n)[ \t]*(?>\r\n?|\n)")
DEFAULT_UNIT = "  "


class WritingGap(Struct, frozen=True):
    """A place for a new element in a file."""

    file: str
    start: int
    end: int
    """The range that is replaced: the end of `<empty/>`, otherwise empty."""
    before: str
    """The characters to write before and after the new element."""
    after: str
    indent: str
    """The indentation of the line in which it begins."""
    unit: str
    line_end: str
    own_line: bool
    """Whether the element gets its own lines."""

    def put(self, written: str) -> Splice:
        """Insert a written text."""
        return Splice(self.file, self.start, self.end, self.before + written + self.after)

    def write(self, element: NewElement, *, flat: bool = False) -> str:
        """Write an element for this place. Its content gets its own lines unless it is `flat`."""
        return element.write(self.indent, self.unit, self.line_end, flat=flat or not self.own_line)

    def insert(self, element: NewElement, *, flat: bool = False) -> Splice:
        """Insert a new element."""
        return self.put(self.write(element, flat=flat))


# --- lines --------------------------------------------------------------------------------------------------------


def line_start(text: str, at: int) -> int:
    """The start of the line of an offset."""
    return max(text.rfind("\n", 0, at), text.rfind("\r", 0, at)) + 1


def next_line(text: str, at: int) -> int:
    """The start of the next line."""
    found = _LINE_END.search(text, at)
    return found.end() if found else len(text)


def _line_before(element: Element) -> str:
    """The part of its line before an element."""
    text = element.tree.text
    return text[line_start(text, element.start) : element.start]


def begins_line(element: Element) -> bool:
    """Whether only blanks precede an element in its line."""
    return not _line_before(element).strip(" \t")


def _line_rest(element: Element) -> int:
    """The offset after the comments that follow an element in its line; -1: other text follows."""
    text = element.tree.text
    found = _REST_OF_LINE.match(text, element.end)
    return len(text[: found.end()].rstrip(" \t")) if found else -1


def has_own_lines(element: Element) -> bool:
    """Whether an element shares its lines only with comments after it."""
    return begins_line(element) and _line_rest(element) >= 0


def indent_of(element: Element) -> str:
    """The blanks at the beginning of an element's line."""
    line = _line_before(element)
    return line[: len(line) - len(line.lstrip(" \t"))]


def line_end_near(element: Element) -> str:
    """The line end next to an element: after its line, or else before it."""
    text = element.tree.text
    found = _LINE_END.search(text, element.end)
    if found:
        return found.group()
    before = text[: line_start(text, element.start)]
    return next((each for each in ("\r\n", "\r", "\n") if before.endswith(each)), "\n")


def is_one_line(element: Element) -> bool:
    """Whether an element begins and ends in the same line."""
    return _LINE_END.search(element.tree.text, element.start, element.end) is None


@lru_cache(maxsize=64)
def indent_unit(tree: XmlTree) -> str:
    """The indentation of one level: the file's first one, or else two blanks."""
    for element in tree.root.walk():
        parent = element.parent
        if parent is not None and begins_line(element) and begins_line(parent):
            inner, outer = indent_of(element), indent_of(parent)
            if inner.startswith(outer) and len(inner) > len(outer):
                return inner[len(outer) :]
    return DEFAULT_UNIT


def lead_start(element: Element) -> int:
    """The start of an element's line, or of the first comment directly above it."""
    text = element.tree.text
    start = line_start(text, element.start)
    floor = element.parent.inner_start if element.parent is not None else 0
    while _COMMENT_ABOVE.search(text, max(floor, start - 200), start):
        opening = text.rfind("<!--", floor, start)
        above = line_start(text, opening)
        if opening < floor or above < floor or text[above:opening].strip(" \t"):
            break
        start = above
    return start


# --- inserting ----------------------------------------------------------------------------------------------------


def _gap(near: Element, start: int, end: int, before: str, after: str, indent: str, *, own_line: bool) -> WritingGap:
    tree = near.tree
    return WritingGap(
        tree.name, start, end, before, after, indent, indent_unit(tree), line_end_near(near), own_line=own_line
    )


def gap_behind(element: Element, *, blank_line: bool = False, alone_apart: bool = False) -> WritingGap:
    """The place after a sibling.

    :param blank_line: leave an empty line if the siblings have their own lines with empty lines between them.
    :param alone_apart: leave it also after an only child.
    """
    indent = indent_of(element)
    if has_own_lines(element):
        at = _line_rest(element)
        is_alone = element.parent is not None and len(element.parent) == 1
        is_apart = blank_line and (alone_apart if is_alone else _has_empty_line_before(element))
        before = line_end_near(element) * (2 if is_apart else 1) + indent
        return _gap(element, at, at, before, "", indent, own_line=True)
    return _gap(element, element.end, element.end, _separator(element), "", indent, own_line=False)


def gap_before(element: Element) -> WritingGap:
    """The place before a sibling, and before the comments that belong to it."""
    indent = indent_of(element)
    if has_own_lines(element):
        at = lead_start(element)
        return _gap(element, at, at, indent, line_end_near(element), indent, own_line=True)
    return _gap(element, element.start, element.start, "", _separator(element), indent, own_line=False)


def gap_in(parent: Element) -> WritingGap:
    """The place in an element without children, after any comments in it."""
    text, line_end, outer = parent.tree.text, line_end_near(parent), indent_of(parent)
    own_line, indent = has_own_lines(parent), outer
    before = behind = ""
    if own_line:
        indent = outer + indent_unit(parent.tree)
        before, behind = line_end + indent, line_end + outer
    end = parent.end
    if parent.is_closed:
        start = len(text[: end - 2].rstrip(BLANKS))
        return _gap(parent, start, end, ">" + before, behind + f"</{parent.tag}>", indent, own_line=own_line)
    inner = text[parent.inner_start : parent.close]
    at = parent.inner_start + len(inner.rstrip(BLANKS))
    rest = text[at : parent.close]
    if "\n" in rest or "\r" in rest:  # the end tag has a line of its own
        if inner.strip(BLANKS):  # comments
            indent = _last_line_indent(text, at)
            before = line_end + indent
        return _gap(parent, at, at, before or line_end + outer + indent_unit(parent.tree), "", indent, own_line=True)
    return _gap(parent, at, parent.close, before, behind, indent, own_line=own_line)


def _last_line_indent(text: str, at: int) -> str:
    """The indentation of a comment that ends at an offset."""
    opening = text.rfind("<!--", 0, at)
    line = text[line_start(text, opening) : opening]
    return line if not line.strip(" \t") else line[: len(line) - len(line.lstrip(" \t"))]


def _siblings(element: Element) -> list[Element]:
    return [element] if element.parent is None else element.parent


def _has_empty_line_before(element: Element) -> bool:
    """Whether an empty line separates an element from the sibling before it, or the first from the second."""
    siblings = _siblings(element)
    at = siblings.index(element)
    if len(siblings) < 2:
        return False
    left, right = (siblings[at - 1], element) if at else (element, siblings[1])
    return _EMPTY_LINE.search(element.tree.text, left.end, max(left.end, lead_start(right))) is not None


def _separator(element: Element) -> str:
    """The blanks between siblings that share a line."""
    siblings, text = _siblings(element), element.tree.text
    at = siblings.index(element)
    for left, right in zip(siblings[max(at - 1, 0) :], siblings[max(at, 1) :], strict=False):
        between = text[left.end : right.start]
        if not between.strip(" \t"):
            return between
    return ""


def wrap(root: Element, wrapper: str, written: str | NewElement) -> list[Splice]:
    """Put a wrapper around the only element of a file, and a text after that element."""
    line_end = line_end_near(root) if begins_line(root) else ""
    if isinstance(written, NewElement):
        written = written.write("", indent_unit(root.tree), line_end, flat=not line_end)
    at = lead_start(root) if line_end else root.start
    return [
        Splice(root.tree.name, at, at, f"<{wrapper}>{line_end}"),
        Splice(root.tree.name, root.end, root.end, f"{line_end * 2}{written}{line_end}</{wrapper}>"),
    ]


# --- removing -----------------------------------------------------------------------------------------------------


def removal(first: Element, last: Element | None = None) -> Splice:
    """Remove siblings, and their lines if these contain nothing else. Comments stay."""
    text, start, end = first.tree.text, first.start, (last or first).end
    begins, behind = begins_line(first), _ONLY_BLANKS.match(text, end)
    if begins and behind is not None:
        start, end = line_start(text, start), next_line(text, end)
        if end == len(text) and not text.endswith(("\n", "\r")):  # the last line, without a line end
            start = len(text[:start].rstrip("\r\n"))
        elif _is_empty_line(text, end) or text.startswith("</", end + _blanks_at(text, end)):
            while start > 0 and (above := line_start(text, _end_of_line_before(text, start))) < start:
                if text[above:start].strip(BLANKS):
                    break
                start = above
    elif begins:
        end += _blanks_at(text, end)
    else:
        start = len(text[:start].rstrip(" \t"))
    return Splice(first.tree.name, start, end, "")


def removals(elements: list[Element]) -> list[Splice]:
    """Remove elements, which may be neighbours: adjacent ranges are joined."""
    splices: list[Splice] = []
    for element in elements:
        gone = removal(element)
        start = max(gone.start, splices[-1].end) if splices else gone.start
        splices.append(gone._replace(start=start, end=max(start, gone.end)))
    return splices


def _end_of_line_before(text: str, start: int) -> int:
    """The last character of the line before `start`, without its line end."""
    return start - 2 if text[:start].endswith("\r\n") else start - 1


def _is_empty_line(text: str, at: int) -> bool:
    return at < len(text) and _ONLY_BLANKS.match(text, at) is not None


def _blanks_at(text: str, at: int) -> int:
    return len(text[at:]) - len(text[at:].lstrip(" \t"))


def collapse(parent: Element) -> Splice | None:
    """Write an element that would become empty as `<empty/>`; None: it contains a comment or text."""
    if parent.marks() or parent.text.strip() or any(child.tail.strip() for child in parent):
        return None
    return Splice(parent.tree.name, parent.inner_start - 1, parent.end, "/>")


def removal_or_collapse(element: Element, last: Element | None = None) -> Splice:
    """Remove siblings. If their parent would become empty, write it as `<empty/>`."""
    parent = element.parent
    is_all = parent is not None and parent[0] is element and parent[-1] is (last or element)
    emptied = collapse(parent) if is_all and parent is not None else None
    return emptied or removal(element, last)


# --- moving -------------------------------------------------------------------------------------------------------


def _block(first: Element, last: Element) -> tuple[int, int]:
    """The lines of siblings and of the comments that belong to them."""
    return lead_start(first), next_line(first.tree.text, max(_line_rest(last), last.end))


def move_siblings(
    first: Element, last: Element, to_first: Element, to_last: Element, *, behind: bool
) -> tuple[Splice, Splice]:
    """Move the siblings `first` to `last` before or behind the siblings `to_first` to `to_last`, with their
    comments."""
    text, file = first.tree.text, first.tree.name
    if all(has_own_lines(each) for each in (first, last, to_first, to_last)):
        start, end = _block(first, last)
        target = _block(to_first, to_last)
        at = target[1] if behind else target[0]
        return Splice(file, start, end, ""), Splice(file, at, at, text[start:end])
    gap = gap_behind(to_last) if behind else gap_before(to_first)
    gone, moved = removal(first, last), text[first.start : last.end]
    if gone.start < gap.start < gone.end:
        at = gone.start if gap.start - gone.start < gone.end - gap.start else gone.end
        return gone, Splice(file, at, at, gap.before + moved)
    return gone, gap.put(moved)
