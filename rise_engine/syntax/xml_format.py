"""The usual layout of files of acts and rules: indentation, one blank between attributes, a line for each element.

It changes nothing that is read and keeps all comments. Elements with text keep their content as written. Elements that
an author has put in one line stay there if they fit.
"""

from __future__ import annotations

import re

from rise_engine.base.text import BLANKS
from rise_engine.syntax.xml import Element, XmlTree, pieces

WIDTH = 120
"""The longest line where possible, in columns."""
_INDENT = "  "
ACT_WRAPPERS = ("Dialogs", "AgentDialogs", "CommunicationRobotActs")
"""The wrapper elements of a file's acts."""
RULE_WRAPPERS = ("InteractionRules",)
WRAPPERS = (*ACT_WRAPPERS, *RULE_WRAPPERS)
"""Their children are not indented, with an empty line between those that take several lines."""


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
        """Everything between the tags, as written."""
        self.is_verbatim = True
        """Whether its content stays as written: it holds text, or no element."""
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
    """Whether a leaf stays on the line of the leaf before it: both are leaves, and there is room."""
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
    """A start tag with one blank between attributes. It takes several lines only if it does not fit in one."""
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
