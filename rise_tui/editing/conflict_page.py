"""The page of a file that git could not join: at each place the author keeps one of two versions, or both."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from textual.app import ComposeResult
from textual.widget import Widget

from rise_engine.edit.edits import ResolveConflict
from rise_tui.editing.model.conflict_rows import conflict_id, conflict_place, conflict_rows, split_conflict_id
from rise_tui.editing.model.draft import FilePlace, count
from rise_tui.editing.page import EditFrame, EditPage
from rise_tui.rendering.text import crop
from rise_tui.widgets.row_list import RowList
from rise_tui.widgets.static_lines import StaticLines


class ConflictPage(EditPage):
    """`shown_name` is the file. It closes when nothing is left to be chosen."""

    KIND: ClassVar[str] = "merge"
    DEFAULT_CSS = """
    ConflictPage #head { background: $rise-bar; }
    """

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__(frame, name)
        self.head, self.rows = StaticLines(id="head"), RowList(id="list")

    def compose(self) -> ComposeResult:
        yield self.head
        yield self.rows

    @property
    def first_focus(self) -> Widget | None:
        return self.rows

    @property
    def still_there(self) -> bool:
        return self.shown_name in self.draft.conflicts

    @property
    def hints(self) -> Mapping[str, str]:
        return {"edit.open": "choose these lines"}

    @property
    def place(self) -> FilePlace | None:
        chosen = split_conflict_id(self.rows.current_id)
        return conflict_place(self.draft, self.shown_name, chosen[0] if chosen is not None else 0)

    def draw(self) -> None:
        places = count(self.draft.conflicts.get(self.shown_name, 0), "place")
        note = f"  git could not join two versions, in {places}: choose"
        self.head.show(crop(((f" {self.shown_name}", "strong"), (note, "muted")), max(20, self.size.width)))
        self.rows.show(conflict_rows(self.draft, self.shown_name, max(20, self.rows.row_width)))
        if not self.rows.current_id:
            self.rows.action_edge(-1)

    def carry_out(self, action: str) -> bool:
        chosen = split_conflict_id(self.rows.current_id)
        if action != "edit.open" or chosen is None:
            return False
        self.frame.make(ResolveConflict(self.shown_name, *chosen), then=self._go_to_next)
        return True

    def _go_to_next(self) -> None:
        """No second press on what was chosen last chooses the same of the next."""
        chosen = split_conflict_id(self.rows.current_id)
        if chosen is not None:
            self.rows.select(conflict_id(chosen[0], "yours"))
