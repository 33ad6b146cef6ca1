"""The step from a single action to `<Variants>` and back: contents stay as they are written, apart from indentation."""

from __future__ import annotations

import re

from rise_engine.author.edit.outline import WrittenAction
from rise_engine.author.edit.plan import Plan, Splice
from rise_engine.scenario.grammar import COMMON
from rise_engine.syntax.changes import changed_text
from rise_engine.syntax.xml import Element
from rise_engine.syntax.xml_layout import (
    gap_behind,
    has_own_lines,
    indent_of,
    indent_unit,
    is_one_line,
    line_end_near,
    removal,
    removals,
)
from rise_engine.syntax.xml_writing import NewElement

_LINE_BEGIN = re.compile(r"(?>\r\n?|\n)(?=[^\r\n])")


def plan_add_variant(action: WrittenAction, new: NewElement, says: str) -> Plan:
    """Plan another wording after the last one."""
    node = action.node
    if action.is_variants:
        last = action.calls[-1].node if action.calls else node[-1]
        flat = is_one_line(last) or not action.calls
        return Plan((gap_behind(last).insert(new, flat=flat),), says=(says,))
    common = [child for child in node if child.tag in COMMON]
    outer, unit, line_end = indent_of(node), indent_unit(node.tree), line_end_near(node)
    kept = _without(node, common)
    own_line = has_own_lines(node)
    added = new.write(outer + unit, unit, line_end, flat=not own_line or not _LINE_BEGIN.search(kept))
    inside, end = "", ""
    if own_line:
        kept = _LINE_BEGIN.sub(lambda found: found.group() + unit, kept)
        inside, end = line_end + outer + unit, line_end + outer
    pieces = ["<Variants>", *(each.written for each in common), kept, added]
    return _instead(node, inside.join(pieces) + end + "</Variants>", says)


def _without(element: Element, gone: list[Element]) -> str:
    """Return an element as it is written, without some of its children."""
    start = element.start
    return changed_text(
        element.written, [Splice("", each.start - start, each.end - start, "") for each in removals(gone)]
    )


def _instead(node: Element, written: str, says: str) -> Plan:
    return Plan((Splice(node.tree.name, node.start, node.end, written),), says=(says,))


def plan_remove_variant(action: WrittenAction, variant: int, says: str) -> Plan:
    """Plan a wording's removal; a single one left becomes an action again, unless a comment is beside it."""
    gone = removal(action.calls[variant].node)
    if len(action.calls) > 2:
        return Plan((gone,), says=(says,))
    if action.node.marks():
        noticed = ("a comment is in `<Variants>`, which therefore stays, with one wording",)
        return Plan((gone,), says=(says,), noticed=noticed)
    common = [child.written for child in action.node if child.tag in COMMON]
    return _instead(action.node, _single(action.node, action.calls[1 - variant].node, common), says)


def _single(node: Element, kept: Element, common: list[str]) -> str:
    """Write a wording as an action, with what `<Variants>` defines for it."""
    text, outer = node.tree.text, indent_of(node)
    opening, inner = text[kept.start : kept.inner_start], text[kept.inner_start : kept.inner_end]
    closing = text[kept.inner_end : kept.end]
    if kept.is_closed:
        opening, closing = opening[:-2].rstrip() + ">", f"</{kept.tag}>"
    if not has_own_lines(node) or not has_own_lines(kept):
        return opening + "".join(common) + inner + closing
    line_end, unit = line_end_near(node), indent_unit(node.tree)
    further = indent_of(kept).removeprefix(outer) if indent_of(kept).startswith(outer) else ""
    inside = line_end + outer + unit
    if is_one_line(kept):
        rest = [inner] if kept.marks() else [child.written for child in kept]
        return inside.join([opening, *common, *rest]) + line_end + outer + closing
    inner = re.sub(
        r"(?>\r\n?|\n)" + re.escape(further), lambda found: found.group()[: len(found.group()) - len(further)], inner
    )
    return inside.join([opening, *common]) + inner + closing
