"""New XML: elements, values and texts, the smallest change that turns one text into another, and the usual layout.

The layout of files of acts and rules is indentation, one blank between attributes, and a line for each element. It
keeps all values and comments. Elements with text keep their content as written. Elements that an author has put in one
line stay there if they fit.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence, Set

from msgspec import Struct

from rise_engine.base.text import BLANKS, character_name
from rise_engine.syntax.changes import EditRefused, Splice
from rise_engine.syntax.xml import CDATA, ENTITY, Element, WrittenAttribute, XmlTree, pieces, read_entity

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_TEXT_UNIT = re.compile(rf"{ENTITY.pattern}|\s+|.", re.DOTALL)
_VALUE_UNIT = re.compile(rf"{ENTITY.pattern}|\r\n|.", re.DOTALL)


class NewElement(Struct, frozen=True):
    """A new element, to be written."""

    tag: str
    attributes: Mapping[str, str] = {}
    text: str | None = None
    children: tuple[NewElement, ...] = ()

    def write(self, indent: str, unit: str, line_end: str, *, flat: bool) -> str:
        """Write it. Its children get their own lines, indented by `unit`, unless it is `flat`."""
        opening = f"<{self.tag}" + "".join(f" {name}={quoted(value)}" for name, value in self.attributes.items())
        if self.children:
            inside, outside = ("", "") if flat else (line_end + indent + unit, line_end + indent)
            inner = "".join(inside + each.write(indent + unit, unit, line_end, flat=flat) for each in self.children)
            return f"{opening}>{inner}{outside}</{self.tag}>"
        return f"{opening}/>" if self.text is None else f"{opening}>{escape_text(self.text)}</{self.tag}>"


def check_characters(text: str) -> None:
    """:raises EditRefused: XML does not allow a character."""
    if (found := _NO_XML.search(text)) is not None:
        raise EditRefused(f"the character {character_name(found.group())} is not allowed in a file; leave it out")


def escape_text(text: str) -> str:
    """Escape a text between tags."""
    check_characters(text)
    return text.replace("&", "&amp;").replace("<", "&lt;").replace("]]>", "]]&gt;").replace("\r", "&#13;")


def escape_value(text: str, quote: str) -> str:
    """Escape a value between quotation marks of this kind."""
    check_characters(text)
    text = text.replace("&", "&amp;").replace("<", "&lt;")
    text = text.replace("\n", "&#10;").replace("\r", "&#13;").replace("\t", "&#9;")
    return text.replace(quote, "&quot;" if quote == '"' else "&apos;")


def quoted(value: str) -> str:
    """A value with quotation marks: double ones, unless the value contains only double ones."""
    quote = "'" if '"' in value and "'" not in value else '"'
    return f"{quote}{escape_value(value, quote)}{quote}"


def one_line(text: str) -> str:
    """A text without surrounding blanks, and with line breaks as blanks."""
    text = text.strip()
    return " ".join(text.split()) if "\n" in text or "\r" in text else text


# --- texts and values ---------------------------------------------------------------------------------------------


def set_text(element: Element, text: str) -> Splice:
    """Set the text of an element without other content (`Element.text_obstacle`)."""
    text = one_line(text)
    check_characters(text)
    file, written = element.tree.name, element.tree.text
    if element.is_closed:
        start = len(written[: element.end - 2].rstrip())
        return Splice(file, start, element.end, f">{escape_text(text)}</{element.tag}>")
    start, end = element.text_span()
    if element.is_cdata:
        opening = written.rfind(CDATA, 0, start + 1)
        if not text or "]]>" in text:
            return Splice(file, opening, written.index("]]>", end) + 3, escape_text(text))
        return _smallest(file, start, written[start:end], text, _CDATA)
    return _smallest(file, start, written[start:end], text, _TEXT)


def set_value(element: Element, name: str, value: str) -> Splice:
    """Set an existing attribute. Its quotation marks stay if possible."""
    check_characters(value)
    written, file = element.written_attributes()[name], element.tree.name
    quote, other = written.quote, "'" if written.quote == '"' else '"'
    if quote in value and other not in value:
        new = f"{other}{escape_value(value, other)}{other}"
        return Splice(file, written.value_start - 1, written.value_end + 1, new)
    raw = element.tree.text[written.value_start : written.value_end]
    notation = _Notation(_VALUE_UNIT, lambda piece: escape_value(piece, quote), _read_value)
    return _smallest(file, written.value_start, raw, value, notation)


class _Notation(Struct, frozen=True):
    """The written form of one kind of text."""

    unit: re.Pattern[str]
    """Matches the written form of one unit of the text."""
    escape: Callable[[str], str]
    read: Callable[[str, bool], str]
    """Returns the value of a unit. The second argument: whether the text has several lines."""


def _read_text(unit: str, broken: bool) -> str:
    return " " if broken and unit.isspace() else read_entity(unit)


def _read_cdata(unit: str, broken: bool) -> str:
    return " " if broken and unit.isspace() else unit


def _read_value(unit: str, _broken: bool) -> str:
    return " " if unit in ("\t", "\n", "\r", "\r\n") else read_entity(unit)


_TEXT = _Notation(_TEXT_UNIT, escape_text, _read_text)
_CDATA = _Notation(_TEXT_UNIT, lambda piece: piece, _read_cdata)


def _smallest(file: str, start: int, raw: str, new: str, notation: _Notation) -> Splice:
    """Replace only the part of a written text that differs from the new one."""
    units = [found.group() for found in notation.unit.finditer(raw)]
    broken = "\n" in raw or "\r" in raw
    read = [notation.read(unit, broken) for unit in units]
    head = at = 0
    while head < len(read) and new.startswith(read[head], at):
        at += len(read[head])
        head += 1
    tail, end = len(read), len(new)
    while tail > head and end - len(read[tail - 1]) >= at and new.endswith(read[tail - 1], at, end):
        tail -= 1
        end -= len(read[tail])
    before, changed, after = ("".join(part) for part in (units[:head], units[head:tail], units[tail:]))
    piece = notation.escape(new[at:end])
    whole = before + piece + after
    broken = "\n" in whole or "\r" in whole
    if "".join(notation.read(found.group(), broken) for found in notation.unit.finditer(whole)) != new or "]]>" in new:
        return Splice(file, start, start + len(raw), notation.escape(new))
    return Splice(file, start + len(before), start + len(before) + len(changed), piece)


# --- attributes ---------------------------------------------------------------------------------------------------


def set_attributes(element: Element, values: Mapping[str, str | None], order: Sequence[str]) -> list[Splice]:
    """Set attributes of an element; others stay unchanged.

    :param values: None removes the attribute. An attribute that already has the value is not changed.
    :param order: all possible attributes: a new one goes after the last one that precedes it here.
    """
    written, file = element.written_attributes(), element.tree.name
    gone = {name for name, value in values.items() if value is None and name in written}
    new = {name: str(values[name]) for name in order if values.get(name) is not None and name not in written}
    splices = [
        set_value(element, name, value)
        for name, value in values.items()
        if value is not None and name in written and element.attributes[name] != value
    ]
    replaced: dict[str, str] = {}
    kept = [order.index(each) for each in written if each in order and each not in gone]
    for name in list(new):  # an attribute that replaces another takes its place
        if (old := _place_of_gone(name, gone - replaced.keys(), kept, order)) is not None:
            replaced[old] = f"{name}={quoted(new.pop(name))}"
    for name in sorted(gone, key=list(written).index):
        place, instead = written[name], replaced.get(name)
        start = place.start if instead is None else place.name_start
        splices.append(Splice(file, start, place.end, instead or ""))
    at_places: dict[int, str] = {}
    for name, value in new.items():
        before = [each for each in written if each in order and order.index(each) < order.index(name)]
        at = max((written[each].end for each in before), default=element.start + 1 + len(element.tag))
        blanks = _blanks(element, written[before[-1]]) if before else " "
        at_places[at] = f"{at_places.get(at, '')}{blanks}{name}={quoted(value)}"
    return splices + [Splice(file, at, at, piece) for at, piece in at_places.items()]


def _place_of_gone(name: str, gone: Set[str], kept: list[int], order: Sequence[str]) -> str | None:
    """The removed attribute whose place a new one takes: the first, if no remaining one belongs between them."""
    rank = order.index(name)
    for each in sorted(gone, key=order.index):
        between = range(*sorted((rank, order.index(each))))
        if not any(other in between for other in kept):
            return each
    return None


def _blanks(element: Element, attribute: WrittenAttribute) -> str:
    """The blanks before an attribute: one blank, or a line end with indentation."""
    return element.tree.text[attribute.start : attribute.name_start]


# --- layout -----------------------------------------------------------------------------------------------------------


WIDTH = 120
"""Maximum columns of a line, where possible."""
_INDENT = "  "
ACT_WRAPPERS = ("Dialogs", "AgentDialogs", "CommunicationRobotActs")
"""The wrapper elements of a file's acts."""
RULE_WRAPPERS = ("InteractionRules",)
WRAPPERS = (*ACT_WRAPPERS, *RULE_WRAPPERS)
"""Their children are not indented, with an empty line between those of several lines."""


class _Node:
    """An element, or a piece between elements: a comment, an instruction, a text, a CDATA section."""

    def __init__(self, gap: str, written: str, element: Element | None = None) -> None:
        self.gap = gap
        """The blanks before it."""
        self.written = written
        """For an element, its start tag."""
        self.element = element
        self.children: list[_Node] = []
        self.end_gap = ""
        """Before the end tag."""
        self.end = ""
        self.inner = ""
        """All text between the tags, as written."""
        self.is_verbatim = True
        """Whether its content stays as written: it contains text, or no element."""
        self.height = 0
        if element is not None:
            self._read(element)

    def _read(self, element: Element) -> None:
        text = element.tree.text
        self.written = text[element.start : element.inner_start]
        if not element.is_closed:
            self.end, self.inner = text[element.close : element.end], text[element.inner_start : element.close]
        holds_text = False
        gap = ""
        for at, stretch in enumerate(element.gaps()):
            found, is_text, gap = _beside(text, *stretch)
            self.children += found
            holds_text |= is_text
            if at < len(element):
                self.children.append(_Node(gap, "", element[at]))
        self.end_gap = gap
        self.is_verbatim = holds_text or not element
        if not self.is_verbatim:
            self.height = 1 + max(child.height for child in self.children if child.element is not None)


def _beside(text: str, start: int, end: int) -> tuple[list[_Node], bool, str]:
    """The pieces of a range without tags, whether it has text, and the blanks at its end."""
    found: list[_Node] = []
    gap, is_text = "", False
    for piece in pieces(text, start, end):
        written = text[piece.start : piece.end]
        if piece.kind == "text" and not written.strip(BLANKS):
            gap = written
        else:
            found.append(_Node(gap, written))
            is_text |= piece.kind in ("text", "CDATA")
            gap = ""
    return found, is_text, gap


def format_xml(text: str) -> str:
    """A file in the usual layout. Formatting it again changes nothing.

    :param text: without byte order mark, with line ends of any kind. The most frequent line end is used throughout.
    :raises XmlSyntaxError: it is not well-formed.
    """
    newline = max(
        ("\n", "\r\n", "\r"), key=lambda each: len(re.findall(f"(?<!\r){each}(?!\n)" if each != "\r\n" else each, text))
    )
    root = XmlTree(text.replace("\r\n", "\n").replace("\r", "\n")).root
    before, _, gap = _beside(root.tree.text, 0, root.start)
    behind, _, _ = _beside(root.tree.text, root.end, len(root.tree.text))
    lines: list[str] = []
    for at, node in enumerate((*before, _Node(gap, "", root), *behind)):
        _write(node, "", lines, first=at == 0)
    return "\n".join(line.rstrip() if not line.strip() else line for line in lines).replace("\n", newline) + newline


def _write(node: _Node, indent: str, lines: list[str], *, first: bool, tall_before: bool = False) -> None:
    """Add a node to the lines of a file."""
    empty = node.gap.count("\n") > 1
    same = not first and "\n" not in node.gap
    if node.element is None:
        fits = bool(lines) and len(lines[-1]) + len(node.written) <= WIDTH
        if same and lines and (node.gap or fits):
            lines[-1] += node.gap + node.written
        else:
            lines += [""] * (empty and not first)
            lines.append(indent + _moved(node.written, node.gap, indent))
        return
    written = _one_line(node, indent)
    if same and written is not None and lines and node.height == 0 and _can_follow(lines[-1], written, node):
        lines[-1] += node.gap + written
        return
    lines += [""] * ((empty or tall_before) and not first)
    if written is not None:
        lines.append(indent + written)
        return
    lines.append(indent + _tag(node, indent))
    is_wrapper = node.element.tag in WRAPPERS
    inside = indent if is_wrapper else indent + _INDENT
    tall = False
    for at, child in enumerate(node.children):
        before = len(lines)
        if at == 0 and child.gap.count("\n") > 1:
            lines.append("")
        _write(child, inside, lines, first=at == 0, tall_before=is_wrapper and tall and child.element is not None)
        tall = child.element is not None and len(lines) - before > 2
    lines += [""] * (node.end_gap.count("\n") > 1)
    lines.append(indent + node.end.replace(" ", ""))


def _can_follow(line: str, written: str, node: _Node) -> bool:
    """Whether a leaf stays on the line of the previous leaf: there is room, and both are leaves."""
    last = line.rstrip()
    behind_leaf = bool(re.search(r"(</[^>]*>|/>|-->)$", last)) and "\n" not in last
    return behind_leaf and not node.written.endswith("/>") and len(line) + len(node.gap) + len(written) <= WIDTH


def _one_line(node: _Node, indent: str) -> str | None:
    """An element in one line, if it has no elements, or if the author has put them in one line and they fit."""
    tag = _tag(node, indent)
    if not node.end:
        return tag
    end = node.end.replace(" ", "")
    if node.is_verbatim:
        return f"{tag}{node.inner}{end}"
    inner = _inner(node)
    if node.height > 1 or "\n" in node.inner or "\n" in tag or len(indent) + len(tag) + len(inner) + len(end) > WIDTH:
        return None
    return f"{tag}{inner}{end}"


def _inner(node: _Node) -> str:
    written = []
    for child in node.children:
        whole = f"{child.written}{child.inner}{child.end}"
        written += [child.gap, whole if child.element is None else _one_line(child, "") or whole]
    return "".join([*written, node.end_gap])


def _tag(node: _Node, indent: str) -> str:
    """A start tag with one blank between attributes. It takes several lines only if it is too long."""
    element = node.element
    assert element is not None, "only elements have tags"
    text, closing = element.tree.text, "/>" if element.is_closed else ">"
    attributes = element.written_attributes().values()
    written = [f"{each.name}={text[each.value_start - 1 : each.end]}" for each in attributes]
    gaps = [text[each.start : each.name_start] for each in attributes]
    tag = " ".join([f"<{element.tag}", *written]) + closing
    if len(indent) + len(tag) <= WIDTH or not any("\n" in gap for gap in gaps):
        return tag
    beside = "\n" + indent + " " * (len(element.tag) + 2)
    parts = [f"<{element.tag} {written[0]}"]
    for gap, piece in zip(gaps[1:], written[1:], strict=True):
        parts.append(f"{beside if chr(10) in gap else ' '}{piece}")
    return "".join(parts) + closing


def _moved(comment: str, gap: str, indent: str) -> str:
    """A comment whose first line has moved: its other lines move as far."""
    column = len(gap.rpartition("\n")[2].expandtabs(2))
    by = len(indent) - column
    first, *rest = comment.split("\n")
    return "\n".join([first, *(_shifted(line, by) for line in rest)])


def _shifted(line: str, by: int) -> str:
    bare = line.lstrip(" \t")
    if not bare:
        return ""
    return " " * max(0, len(line[: len(line) - len(bare)].expandtabs(2)) + by) + bare
