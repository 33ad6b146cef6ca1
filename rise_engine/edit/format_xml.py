"""The usual layout of files of acts and rules: indentation, one blank between attributes, a line for each element.

Nothing that is read changes, and no comment goes. What holds text, and what lies within it, stays as it is written;
what an author has put in one line and fits there stays in one line.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

from rise_engine.edit.plan import EditRefused
from rise_engine.text import BLANKS

WIDTH = 120
"""Columns of a line, where that can be had."""
_INDENT = "  "
_WRAPPERS = ("Dialogs", "InteractionRules")
"""Their children stand at the margin, with an empty line between those that take several lines."""
_PIECE = re.compile(
    r"(?P<comment><!--.*?-->)|(?P<cdata><!\[CDATA\[.*?\]\]>)|(?P<instruction><\?.*?\?>)|(?P<end></[^>]*>)"
    r"|(?P<start><[^\s/>]+(?:\s+[^\s=]+\s*=\s*(?:\"[^\"]*\"|'[^']*'))*\s*/?>)|(?P<text>[^<]+)",
    re.DOTALL,
)
_ATTRIBUTE = re.compile(r"\s+([^\s=]+)\s*=\s*(\"[^\"]*\"|'[^']*')")
_NAME = re.compile(r"<([^\s/>]+)")


class _Node:
    """An element, or something beside elements: a comment, an instruction, a text, a CDATA section."""

    def __init__(self, kind: str, written: str) -> None:
        self.kind = kind
        self.written = written
        """Of an element, its start tag."""
        self.gap = ""
        """The blanks before it."""
        self.children: list[_Node] = []
        self.end_gap = ""
        """Before the end tag."""
        self.end = ""
        self.inner = ""
        """All between the tags, as written."""

    @property
    def name(self) -> str:
        found = _NAME.match(self.written)
        return found.group(1) if found is not None else ""

    @property
    def elements(self) -> list[_Node]:
        return [child for child in self.children if child.kind == "element"]

    @property
    def is_verbatim(self) -> bool:
        """Whether its content stays as it is: it holds text, or no element."""
        return not self.elements or any(child.kind in ("text", "cdata") for child in self.children)

    @property
    def height(self) -> int:
        if self.kind != "element" or self.is_verbatim:
            return 0
        return 1 + max(child.height for child in self.elements)

    @property
    def whole(self) -> str:
        return f"{self.written}{self.inner}{self.end}"


def format_xml(text: str) -> str:
    """A file in the usual layout; a second time, it stays as it is.

    :param text: well-formed, without byte order mark. Line ends of any kind; the most frequent one is taken for all.
    :raises EditRefused: it is not well-formed.
    """
    newline = max(
        ("\n", "\r\n", "\r"), key=lambda each: len(re.findall(f"(?<!\r){each}(?!\n)" if each != "\r\n" else each, text))
    )
    nodes = _read(text.replace("\r\n", "\n").replace("\r", "\n"))
    lines: list[str] = []
    for at, node in enumerate(nodes):
        _write(node, "", lines, first=at == 0)
    return "\n".join(line.rstrip() if not line.strip() else line for line in lines).replace("\n", newline) + newline


def _read(text: str) -> list[_Node]:
    """What stands at the top of a file."""
    top = _Node("element", "")
    stack = [(top, 0)]
    at, gap = 0, ""
    while at < len(text):
        found = _PIECE.match(text, at)
        if found is None or found.lastgroup is None:
            raise EditRefused("it is not well-formed XML; mend that first")
        kind, written = found.lastgroup, found.group()
        holder = stack[-1][0]
        if kind == "text" and not written.strip(BLANKS):
            gap = written
        elif kind == "end":
            node, inner_at = stack.pop()
            if not stack:
                raise EditRefused("it is not well-formed XML; mend that first")
            node.end_gap, node.end, node.inner, gap = gap, written, text[inner_at:at], ""
        else:
            node = _Node("element" if kind == "start" else kind, written)
            node.gap, gap = gap, ""
            holder.children.append(node)
            if kind == "start" and not written.endswith("/>"):
                stack.append((node, found.end()))
        at = found.end()
    if len(stack) > 1:
        raise EditRefused("it is not well-formed XML; mend that first")
    return top.children


def _write(node: _Node, indent: str, lines: list[str], *, first: bool, tall_before: bool = False) -> None:
    """Add a node to the lines of a file."""
    empty = node.gap.count("\n") > 1
    same = not first and "\n" not in node.gap
    if node.kind != "element":
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
    inside = indent if node.name in _WRAPPERS else indent + _INDENT
    tall = False
    for at, child in enumerate(node.children):
        before = len(lines)
        if at == 0 and child.gap.count("\n") > 1:
            lines.append("")
        _write(
            child, inside, lines, first=at == 0, tall_before=node.name in _WRAPPERS and tall and child.kind == "element"
        )
        tall = child.kind == "element" and len(lines) - before > 2
    lines += [""] * (node.end_gap.count("\n") > 1)
    lines.append(indent + node.end.replace(" ", ""))


def _can_follow(line: str, written: str, node: _Node) -> bool:
    """Whether a leaf stays behind the one before it, on its line: both are leaves, and there is room."""
    last = line.rstrip()
    behind_leaf = bool(re.search(r"(</[^>]*>|/>|-->)$", last)) and "\n" not in last
    return behind_leaf and not node.written.endswith("/>") and len(line) + len(node.gap) + len(written) <= WIDTH


def _one_line(node: _Node, indent: str) -> str | None:
    """An element in one line: one without elements, or with those that the author has put there and that fit."""
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
    pieces = []
    for child in node.children:
        pieces += [child.gap, (_one_line(child, "") or child.whole) if child.kind == "element" else child.written]
    return "".join([*pieces, node.end_gap])


def _tag(node: _Node, indent: str) -> str:
    """A start tag: one blank between attributes; over several lines only where it does not fit in one."""
    attributes = list(_ATTRIBUTE.finditer(node.written))
    closing = "/>" if node.written.endswith("/>") else ">"
    pieces = [f"{found.group(1)}={found.group(2)}" for found in attributes]
    tag = " ".join([f"<{node.name}", *pieces]) + closing
    gaps = [node.written[found.start() : found.start(1)] for found in attributes]
    if len(indent) + len(tag) <= WIDTH or not any("\n" in gap for gap in gaps):
        return tag
    beside = "\n" + indent + " " * (len(node.name) + 2)
    parts = [f"<{node.name} {pieces[0]}"]
    for gap, piece in zip(gaps[1:], pieces[1:], strict=True):
        parts.append(f"{beside if chr(10) in gap else ' '}{piece}")
    return "".join(parts) + closing


def _moved(comment: str, gap: str, indent: str) -> str:
    """A comment whose first line stands elsewhere now: its other lines move as far."""
    column = len(gap.rpartition("\n")[2].expandtabs(2))
    by = len(indent) - column
    first, *rest = comment.split("\n")
    return "\n".join([first, *(_shifted(line, by) for line in rest)])


def _shifted(line: str, by: int) -> str:
    bare = line.lstrip(" \t")
    if not bare:
        return ""
    return " " * max(0, len(line[: len(line) - len(bare)].expandtabs(2)) + by) + bare


def comments_of(text: str) -> Iterator[str]:
    """The comments of a file in their order, without their blanks."""
    for found in _PIECE.finditer(text):
        if found.lastgroup == "comment":
            yield " ".join(found.group().split())
