"""The two lists of a rule: its graph, and what the state under the cursor does."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.message import Message

from rise_tui.editor.model.state_parts import PartRow
from rise_tui.rendering.text import ListRow, StyledLine, StyledSpan, TextRole, align_at_both_ends, shorten
from rise_tui.widgets.row_list import RowList


class RuleGraphList(RowList):
    """The drawing. The cursor walks over states and ways; left and right go from a state to the way in its row."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left", "beside(-1)", show=False),
        Binding("right", "beside(1)", show=False),
    ]

    @dataclass
    class GoBeside(Message):
        """To the way in the row of a state, or back."""

        step: int

    def move_cursor(self, index: int, *, by_wizard: bool = True) -> None:
        """Out of view it goes on by a third of it: what follows is seen, and not each row more paints all rows anew."""
        top, height = self.scroll_offset.y, self.size.height
        super().move_cursor(index, by_wizard=by_wizard)
        if height and self.cursor >= top + height:
            self.scroll_to(y=self.cursor - 2 * height // 3, animate=False)
        elif height and 0 <= self.cursor < top:
            self.scroll_to(y=self.cursor - height // 3, animate=False)

    def action_beside(self, step: int) -> None:
        self.post_message(self.GoBeside(step))


class PartList(RowList):
    """What a state does, and its ways out."""

    def __init__(self) -> None:
        super().__init__(id="rule-parts")
        self._parts: Sequence[PartRow] = ()

    def show_parts(self, parts: Sequence[PartRow], width: int, marks: Sequence[StyledSpan]) -> None:
        """
        :param marks: for each part the mark of a finding.
        """
        self._parts = parts
        self.show([ListRow(part.id, part_line(part, mark, width)) for part, mark in zip(parts, marks, strict=True)])

    @property
    def part(self) -> PartRow | None:
        """What is under the cursor."""
        return self._parts[self.cursor] if 0 <= self.cursor < len(self._parts) else None


def part_line(part: PartRow, mark: StyledSpan, width: int) -> StyledLine:
    """One row: indented, with its target at the end, which is seen whatever else is cut."""
    indent = " " * (2 * part.depth)
    if part.kind == "heading":
        return (mark, (part.text, "strong"))
    role: TextRole = "muted" if part.reason else "plain"
    if part.kind == "way":
        target = f" → {part.target}" if part.target is not None else "  stays here"
        end: StyledLine = ((shorten(target, max(8, width // 2)), "muted" if part.target is None else role),)
        guard: StyledLine = ((f" but only if {part.guard}", "muted"),) if part.guard else ()
        return align_at_both_ends((mark, (f" {part.text}", role), *guard), end, width)
    if part.kind == "parameter":
        return (mark, (indent + part.text, role), (f"   {part.guard}" if part.guard else "", "muted"))
    if part.kind in ("if", "branch", "choice"):
        return (mark, (indent + part.text, "muted" if part.reason else "accent"))
    return (mark, (indent + part.text, "muted" if part.kind == "empty" else role))
