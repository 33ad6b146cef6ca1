"""An element moves among its siblings, with its lines and the comments that belong to it."""

from __future__ import annotations

from rise_engine.edit.documents import Node
from rise_engine.edit.layout import block_of, gap_before, gap_behind, has_own_lines, removal
from rise_engine.edit.plan import Splice


def move_siblings(
    file: str, first: Node, last: Node, to_first: Node, to_last: Node, *, behind: bool
) -> tuple[Splice, Splice]:
    """The splices that put the siblings `first` to `last` before or behind the siblings `to_first` to `to_last`."""
    data = first.document.data
    if all(has_own_lines(node) for node in (first, last, to_first, to_last)):
        start, end = block_of(first, last)
        target = block_of(to_first, to_last)
        at = target[1] if behind else target[0]
        return Splice(file, start, end, b""), Splice(file, at, at, data[start:end])
    gap = gap_behind(to_last) if behind else gap_before(to_first)
    start, end = removal(first, last)
    if start < gap.start < end:
        gap_at = start if gap.start - start < end - gap.start else end
        return Splice(file, start, end, b""), Splice(file, gap_at, gap_at, gap.before + data[first.start : last.end])
    return Splice(file, start, end, b""), gap.splice(file, data[first.start : last.end])
