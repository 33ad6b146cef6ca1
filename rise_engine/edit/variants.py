"""A single action becomes `<Variants>` and back: what stands in it stays as it is written, further in or out."""

from __future__ import annotations

import re

from rise_engine.edit.documents import Node
from rise_engine.edit.layout import (
    WritingGap,
    gap_behind,
    has_own_lines,
    indent_of,
    indent_unit,
    is_one_line,
    line_end_near,
    removal,
)
from rise_engine.edit.outline import WrittenAction
from rise_engine.edit.plan import Plan, Splice
from rise_engine.edit.writing import NewElement, insert, render
from rise_engine.scenario.acts import COMMON

_LINE_BEGIN = re.compile(rb"(?>\r\n?|\n)(?=[^\r\n])")


def plan_add_variant(file: str, node: Node, action: WrittenAction, new: NewElement, says: str) -> Plan:
    """Another wording, behind the last one."""
    if action.is_variants:
        calls = [child for child in node.children if child.tag not in COMMON]
        last = calls[-1] if calls else node.children[-1]
        flat = is_one_line(last) or not calls
        return Plan((insert(file, gap_behind(last), [new], flat=flat),), says=(says,))
    common = [child for child in node.children if child.tag in COMMON]
    own_line, outer = has_own_lines(node), indent_of(node)
    unit, line_end = indent_unit(node.document), line_end_near(node)
    kept = _without(node, common)
    gap = WritingGap(0, 0, b"", b"", outer + unit, unit, line_end, own_line)
    added = render(new, gap, flat=not _LINE_BEGIN.search(kept))
    if own_line:
        kept = _LINE_BEGIN.sub(lambda found: found.group() + unit, kept)
    inside, end = (line_end + outer + unit, line_end + outer) if own_line else (b"", b"")
    pieces = [b"<Variants>", *(each.written() for each in common), kept, added]
    return Plan((Splice(file, node.start, node.end, inside.join(pieces) + end + b"</Variants>"),), says=(says,))


def _without(node: Node, gone: list[Node]) -> bytes:
    """An element as it is written, without some of what it holds."""
    data, at, pieces = node.document.data, node.start, []
    for child in gone:
        start, end = removal(child)
        pieces.append(data[at : max(at, start)])
        at = max(at, end)
    return b"".join([*pieces, data[at : node.end]])


def plan_remove_variant(file: str, node: Node, calls: list[Node], variant: int, says: str) -> Plan:
    """A wording goes; the last one that is left is a single action again, unless a comment stands beside it."""
    gone = calls[variant]
    if len(calls) > 2:
        return Plan((Splice(file, *removal(gone), b""),), says=(says,))
    if node.marks:
        noticed = ("a comment stands in `<Variants>`, which therefore stays, with one wording",)
        return Plan((Splice(file, *removal(gone), b""),), says=(says,), noticed=noticed)
    kept = calls[1 - variant]
    common = [child.written() for child in node.children if child.tag in COMMON]
    return Plan((Splice(file, node.start, node.end, _single(node, kept, common)),), says=(says,))


def _single(node: Node, kept: Node, common: list[bytes]) -> bytes:
    """A wording with what `<Variants>` has said of it."""
    data, outer = node.document.data, indent_of(node)
    opening = data[kept.start : kept.inner_start]
    closing = data[kept.end_tag : kept.end]
    inner = data[kept.inner_start : kept.inner_end]
    if kept.is_closed:
        opening, closing, inner = opening[:-2].rstrip() + b">", b"</" + kept.tag.encode() + b">", b""
    if not has_own_lines(node) or not has_own_lines(kept):
        return opening + b"".join(common) + inner + closing
    line_end, unit = line_end_near(node), indent_unit(node.document)
    further = indent_of(kept)[len(outer) :] if indent_of(kept).startswith(outer) else b""
    inside = line_end + outer + unit
    if is_one_line(kept):
        rest = [child.written() for child in kept.children] if not kept.marks else [inner]
        return inside.join([opening, *common, *rest]) + line_end + outer + closing
    inner = re.sub(
        rb"(?>\r\n?|\n)" + re.escape(further), lambda found: found.group()[: len(found.group()) - len(further)], inner
    )
    return inside.join([opening, *common]) + inner + closing
