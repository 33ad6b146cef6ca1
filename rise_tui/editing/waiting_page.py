"""The page of changes that wait: own ones in whose way somebody else's stand, and proposed ones, each to be decided."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.widget import Widget

from rise_engine.edit.waiting import Outlook
from rise_tui.editing.model.draft import FilePlace
from rise_tui.editing.model.waiting_rows import compared, outlook_rows, waiting_rows, waiting_text
from rise_tui.editing.page import EditFrame, EditPage
from rise_tui.rendering.text import crop
from rise_tui.widgets.row_list import RowList, RowView
from rise_tui.widgets.static_lines import StaticLines


class WaitingPage(EditPage):
    """A list, and below it what the change under the cursor would do: `enter`, `space` make it, `del` gives it up."""

    KIND: ClassVar[str] = "waiting"
    DEFAULT_CSS = """
    WaitingPage #head { background: $rise-bar; }
    WaitingPage #list { height: 2fr; }
    WaitingPage #beside { height: 3fr; border-top: solid $rise-muted; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("space", "make", show=False)]

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__(frame, name)
        self.head = StaticLines(id="head")
        self.rows, self.beside = RowList(id="list"), RowList(id="beside")
        self.beside.can_focus = False
        self._next = ""
        """Where the cursor goes when the list is drawn next: one that was given up is not followed to its end."""
        self.rows.continuation = self.beside

    def compose(self) -> ComposeResult:
        yield self.head
        yield self.rows
        yield self.beside

    @property
    def first_focus(self) -> Widget | None:
        return self.rows

    @property
    def current(self) -> Outlook | None:
        """The change under the cursor, and what would come of it."""
        id = self.rows.current_id
        return next((each for each in self.draft.waiting if str(each.waiting.number) == id), None)

    @property
    def hints(self) -> Mapping[str, str]:
        found = self.current
        if found is None:
            return {}
        own = found.waiting.origin == "yours"
        if found.waiting.given_up:
            return {"edit.open": "make it after all", "edit.remove": "back to the list"}
        return {"edit.open": "make yours" if own else "accept", "edit.remove": "keep theirs" if own else "refuse"}

    @property
    def place(self) -> FilePlace | None:
        found = self.current
        first = next(compared(found), None) if found is not None else None
        if first is None:
            return None
        file, _, where = first[0].rpartition(", ")
        number = where.rpartition(" ")[2]
        line = max(1, int(number)) if number.isdecimal() else 1
        return FilePlace(file, line, line)

    def draw(self) -> None:
        width = max(20, self.size.width)
        what = waiting_text(self.draft) or "everything is decided: esc leads back"
        self.head.show(crop(((" CHANGES THAT WAIT", "strong"), (f"  {what}", "muted")), width))
        self.rows.show(waiting_rows(self.draft, max(20, self.rows.row_width)))
        if self._next:
            self.rows.select(self._next)
            self._next = ""
        if not self.rows.current_id:
            self.rows.action_edge(-1)
        self._draw_beside()

    @on(RowView.CursorMoved)
    def _draw_beside(self) -> None:
        found = self.current
        self.beside.show(outlook_rows(found, max(20, self.beside.row_width)) if found is not None else [])
        self.beside.scroll_to(y=0, animate=False)

    def carry_out(self, action: str) -> bool:
        if action == "edit.open":
            self.action_make()
        elif action == "edit.remove":
            self._give_up()
        else:
            return False
        return True

    def action_make(self) -> None:
        """Make the change under the cursor."""
        found = self.current
        if found is None:
            self.frame.say("nothing waits here any more", "wait")
        elif found.why_not:
            self.frame.say(f"it cannot be made now: {found.why_not}", "wait")
        else:
            self.frame.work(self._make(found))

    async def _make(self, found: Outlook) -> str:
        change = await self.frame.study.make_waiting(found.waiting.number)
        return "; ".join((*change.says, *change.noticed)) or "the files say so already"

    def _give_up(self) -> None:
        found = self.current
        if found is not None:
            self.frame.work(self._decline(found))

    async def _decline(self, found: Outlook) -> str:
        waiting = found.waiting
        ids = [str(each.waiting.number) for each in self.draft.waiting if each.waiting.given_up == waiting.given_up]
        at = ids.index(str(waiting.number))
        self._next = (ids[at + 1 :] or ids[:at][-1:] or [""])[0]
        await self.frame.study.give_up(waiting.number, given_up=not waiting.given_up)
        if waiting.given_up:
            return "it waits again"
        what = "the other's stays; yours" if waiting.origin == "yours" else "refused; it"
        return f"{what} can still be made until you leave the editor: it is at the end of this list"
