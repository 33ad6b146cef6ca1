"""The list of a study, the first page of the editor. Beside it: the item under the cursor and its uses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.widget import Widget

from rise_engine.author.edit.edits import AddAct, AddRule, AnyEdit, CopyAct, CopyRule, RemoveAct, RemoveRule, Rename
from rise_engine.author.edit.plan import EditRefused
from rise_engine.scenario.loader import LoadResult
from rise_tui.editor.model.acts import action_with
from rise_tui.editor.model.draft import FilePlace, is_study_alone
from rise_tui.editor.model.fields import FieldChoice
from rise_tui.editor.model.study_rows import (
    act_preview,
    best_row,
    find_at,
    row_id,
    split_row_id,
    study_rows,
    used_by,
    used_lines,
)
from rise_tui.editor.page import EditFrame, EditPage
from rise_tui.rendering.text import ListRow
from rise_tui.widgets.lines import RowList, RowView

MIN_ITEM_COLUMNS = 76
"""Minimum columns for the item under the cursor."""


class StudyPage(EditPage):
    """Acts, rules, and the other pages."""

    KIND: ClassVar[str] = "study"
    CAN_FILTER = True
    DEFAULT_CSS = """
    StudyPage #list { width: 1fr; }
    StudyPage #beside { width: 1fr; display: none; border-left: solid $rise-muted; }
    StudyPage.-beside #beside { display: block; }
    """

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__(frame, name)
        self.rows = RowList(id="list")
        self.beside = RowList(id="beside")
        self.beside.can_focus = False
        self._rows: list[ListRow] = []
        self._made_from: tuple[LoadResult, int, str] | None = None
        """The sources of the rows."""

    def compose(self) -> ComposeResult:
        with Horizontal():
            yield self.rows
            yield self.beside

    @property
    def first_focus(self) -> Widget | None:
        return self.rows

    @property
    def current(self) -> tuple[str, str]:
        """Kind and name of the item under the cursor."""
        return split_row_id(self.rows.current_id)

    @property
    def hints(self) -> Mapping[str, str]:
        kind, _ = self.current
        if is_study_alone(self.draft):
            return {"edit.open": "open"}
        also = {"edit.rename": "rename", "edit.copy": "copy"} if kind in ("act", "rule") else {}
        return {"edit.open": "open", "edit.add": "add", **also}

    @property
    def place(self) -> FilePlace | None:
        kind, name = self.current
        outline = self.draft.outline
        found = outline.act(name) if kind == "act" else outline.rule(name) if kind == "rule" else None
        if found is not None:
            return FilePlace(found.file, found.line, found.last_line)
        file = {
            "file": name,
            "memory": "memory.json",
            "keys": "scenario.toml",
            "settings": "scenario.toml",
        }.get(kind)
        return FilePlace(file, 1, 1) if file else None

    def draw(self) -> None:
        self.set_class(self.size.width >= MIN_ITEM_COLUMNS, "-beside")
        made_from = self.draft.checked, max(20, self.rows.row_width), self.wanted
        if self._made_from is None or made_from[0] is not self._made_from[0] or made_from[1:] != self._made_from[1:]:
            self._made_from = made_from
            self._rows = study_rows(self.draft, *made_from[1:])
        self.rows.show(self._rows)
        self._draw_beside()

    @on(RowView.CursorMoved)
    def _draw_beside(self) -> None:
        kind, name = self.current
        width = max(20, self.beside.row_width)
        act = self.draft.outline.act(name) if kind == "act" else None
        if act is not None:
            lines = act_preview(self.draft, act, width)
        else:
            lines = used_lines(self.draft, kind, name, width) if kind == "rule" else []
        self.beside.show([ListRow("", line, selectable=False) for line in lines])

    def filter(self, text: str) -> None:
        super().filter(text)
        if text:
            self.rows.select(best_row(self._rows, text))

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        kind, name = self.current
        calls: dict[str, Callable[[], object]] = {"edit.open": lambda: self._open(kind, name)}
        if not is_study_alone(self.draft):
            calls |= {
                "edit.add": self._ask_for_new,
                "edit.rename": lambda: self._ask_to_rename(kind, name),
                "edit.copy": lambda: self._ask_to_copy(kind, name),
                "edit.remove": lambda: self._remove(kind, name),
                "edit.uses": lambda: self._show_uses(kind, name),
            }
        return calls

    def _open(self, kind: str, name: str) -> None:
        if kind == "file":
            raise EditRefused(f"{name} cannot be read as it is: e opens it in your editor")
        if kind:
            self.frame.open_page(kind, self._found_in(kind, name))
            self._select(kind, name)

    def _found_in(self, kind: str, name: str) -> str:
        """The name of the page to open. For an act found by its words, it includes the action with them."""
        act = self.draft.outline.act(name) if kind == "act" else None
        found = action_with(act, self.wanted) if act is not None and self.wanted else ""
        return f"{name}\0{found}" if found else name

    def _ask_for_new(self) -> None:
        """Ask for a new rule if the cursor is on a rule, otherwise for a new act."""
        kind, name = self.current
        if kind == "rule":
            self._ask_for_rule(name)
            return
        after = name if kind == "act" else ""

        def take(typed: str) -> None:
            self.make(AddAct(typed, after=after), then=lambda: self._open_new("act", typed))

        where = f"It is added after {after}." if after else "It is added at the end of the last file of acts."
        self.frame.ask_text("A new act", "", take, hint=f"Its name for rules and keys. {where}")

    def _ask_for_rule(self, after: str) -> None:
        def take(typed: str) -> None:
            self.make(AddRule(typed, "Start", after=after), then=lambda: self._open_new("rule", typed))

        self.frame.ask_text("A new rule", "", take, hint="Its name. It begins in the state Start.")

    def _open_new(self, kind: str, name: str) -> None:
        """Open a new page. The cursor will be on its row when the page is left."""
        self._select(kind, name)
        self.frame.open_page(kind, name)

    def _ask_to_rename(self, kind: str, name: str) -> None:
        if kind not in ("act", "rule"):
            return

        def take(typed: str) -> None:
            if typed != name:
                edit = Rename("act" if kind == "act" else "rule", name, typed)
                self.make(edit, then=lambda: self._select(kind, typed))

        number = len(used_by(self.draft, kind, name))
        self.frame.ask_text(f"Rename the {kind} {name}", name, take, hint=f"Also in the {number} places that use it.")

    def _ask_to_copy(self, kind: str, name: str) -> None:
        if kind not in ("act", "rule"):
            return

        def take(typed: str) -> None:
            edit: AnyEdit = CopyAct(name, typed) if kind == "act" else CopyRule(name, typed)
            self.make(edit, then=lambda: self._select(kind, typed))

        self.frame.ask_text(f"Copy the {kind} {name}", f"{name}_2", take, hint="The name of the copy.")

    def _remove(self, kind: str, name: str) -> None:
        if kind == "act":
            self.make(RemoveAct(name))
        elif kind == "rule":
            self.make(RemoveRule(name))

    def _show_uses(self, kind: str, name: str) -> None:
        found = used_by(self.draft, kind, name)

        def go(chosen: str) -> None:
            page = find_at(self.draft, found[chosen].file, found[chosen].line)
            if page is not None:
                self.frame.open_page(*page)

        if found:
            choices = [FieldChoice(text, text) for text in found]
            self.frame.choose(f"{name} is used by", choices, go, enter="goes there")
        else:
            self.frame.say(f"{name}: nothing uses it" if name else "nothing is selected", "info")

    def _select(self, kind: str, name: str) -> None:
        """Go to a row and end the search."""
        self.leave()
        self.rows.select(row_id(kind, name))
        self._draw_beside()
        self.frame.draw_bars()
