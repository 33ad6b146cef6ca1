"""A page with a list. A field below it changes the item under the cursor, on the lines that it needs."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.widget import Widget
from textual.widgets import TextArea

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import EditRefused
from rise_engine.base.text import clean
from rise_tui.editor.model.fields import FieldNote, note_lines
from rise_tui.editor.page import EditFrame, EditPage
from rise_tui.rendering.text import ListRow, StyledLine, crop, shorten
from rise_tui.rise_app import TakesText
from rise_tui.widgets.lines import RowList, RowView, StaticLines

LABEL = 8
"""Cells before the typed text."""
REMARK_ROWS, MIN_ROWS = 2, 3
"""Rows for the remarks below the field, and the list's minimum rows."""


STEPS = {"enter": 0, "tab": 1, "shift+tab": -1}
"""Keys that accept the typed text, and the step to the next text."""


class SentenceField(TextArea, TakesText):
    """A field for a sentence. Enter and Tab accept it, Esc restores it. A pasted line end becomes a blank."""

    DEFAULT_CSS = """
    SentenceField, SentenceField:focus {
        height: auto; min-height: 1; border: none; padding: 0; background: $panel; scrollbar-size-vertical: 1;
        & .text-area--cursor-line { background: $panel; }
    }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("home", "cursor_text_start", show=False),
                                             Binding("end", "cursor_text_end", show=False)]  # fmt: skip

    def __init__(self, page: SentencePage, *, exact: bool = False) -> None:
        """`exact`: whether blanks and line ends count."""
        super().__init__(compact=True, highlight_cursor_line=False)
        self._page, self._is_exact = page, exact

    def begin(self, text: str) -> None:
        """Begin to type in this text."""
        self.load_text(text)
        self.action_cursor_text_end()

    @property
    def sentence(self) -> str:
        """The typed text; on one line, unless blanks and line ends count."""
        return self.text if self._is_exact else " ".join(self.text.split())

    def action_cursor_text_start(self) -> None:
        """Move to the first character."""
        self.move_cursor((0, 0))

    def action_cursor_text_end(self) -> None:
        """Move after the last character."""
        self.move_cursor(self.document.end)

    async def on_key(self, event: events.Key) -> None:
        if event.key in STEPS:
            self._page.take(self.sentence, STEPS[event.key])
        elif event.key == "escape":
            self._page.close_field()
        else:
            return
        event.stop()
        event.prevent_default()

    async def on_paste(self, event: events.Paste) -> None:
        event.prevent_default()
        event.stop()
        self.replace(clean(" ".join(event.text.split())), *self.selection, maintain_selection_offset=False)


class SentencePage(EditPage):
    """A list, the full value under the cursor below it, and the field that changes it."""

    MIN_DETAIL: ClassVar[int]
    """Rows for the item under the cursor, if there is room."""
    DEFAULT_CSS = """
    SentencePage #head, SentencePage #parting { background: $rise-bar; }
    SentencePage #typed { display: none; height: auto; }
    SentencePage #label { width: 8; }
    SentencePage #said { display: none; height: 2; }
    SentencePage.-typing #typed, SentencePage.-typing #said { display: block; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [Binding("space", "read_on", show=False)]

    def __init__(self, frame: EditFrame, name: str, rows: RowView, *, exact: bool = False) -> None:
        """`exact`: whether blanks and line ends in the typed text count."""
        super().__init__(frame, name)
        self.head, self.rows, self.parting = StaticLines(id="head"), rows, StaticLines(id="parting")
        self.detail = RowList(id="detail")
        self.detail.can_focus = False
        self.label, self.field, self.remarks = (
            StaticLines(id="label"),
            SentenceField(self, exact=exact),
            StaticLines(id="said"),
        )
        self._is_open = False

    def compose_head(self) -> ComposeResult:
        """The lines above the list."""
        yield self.head

    def compose(self) -> ComposeResult:
        yield from self.compose_head()
        yield self.rows
        yield self.parting
        yield self.detail
        with Horizontal(id="typed"):
            yield self.label
            yield self.field
        yield self.remarks

    @property
    def first_focus(self) -> Widget | None:
        return self.rows

    @property
    def own_hints(self) -> Sequence[tuple[str, str]]:
        is_more = self.detail.count > max(1, self.detail.size.height)
        return [("space", "read on")] if is_more else []

    def show_detail(self, lines: Sequence[StyledLine]) -> None:
        """Show these lines as high as they need, if there is room; never lower than usual while nothing is typed."""
        room = self.size.height - 3
        if self.is_typing:
            half = max(2, (room - REMARK_ROWS) // 2)
            self.field.styles.max_height = half
            height = min(len(lines), max(1, room - REMARK_ROWS - half))
        else:
            height = max(1, min(max(self.MIN_DETAIL, len(lines)), room - MIN_ROWS))
        if self.detail.styles.height is None or self.detail.styles.height.value != height:
            self.detail.styles.height = height
        self.detail.show([ListRow(str(at), line, selectable=False) for at, line in enumerate(lines)])
        self.detail.scroll_to(y=len(lines) if self.is_typing else 0, animate=False)

    def action_read_on(self) -> None:
        """Show the next lines if there are more than fit; after the last ones, the first ones."""
        top, height = self.detail.scroll_offset.y, max(1, self.detail.size.height)
        following = top + height - 1 if top + height < self.detail.count else 0
        self.detail.scroll_to(y=following, animate=False)

    @abstractmethod
    def draw_detail(self) -> None:
        """Show the item under the cursor, or the lines beside the typed text."""

    @abstractmethod
    def edits_typed(self, remarks: str) -> tuple[AnyEdit, ...]:
        """The edits for the typed text. :raises EditRefused: it has no meaning."""

    @abstractmethod
    def go_on(self, step: int, *, changed: bool) -> None:
        """After the field was accepted, continue with the next text (1), the previous one (-1), or none (0)."""

    def step_over(self, step: int) -> int:
        """The step for `go_on`. Called when the typed text is accepted, before its edits are made."""
        return step

    @property
    def is_typing(self) -> bool:
        return self._is_open

    def open_field(self, label: str, text: str) -> None:
        """Open the field with this text."""
        self._is_open = True
        self.add_class("-typing")
        self.label.show(((f" ▸{shorten(label, LABEL - 3)}", "accent"),))
        with self.field.prevent(TextArea.Changed):
            self.field.begin(text)
        self.field.focus()
        self.show_remarks()
        self.draw_detail()
        self.frame.draw_bars()

    def close_field(self) -> None:
        """Close the field."""
        self._is_open = False
        self.remove_class("-typing")
        self.rows.focus()
        self.draw_detail()
        self.frame.draw_bars()

    def show_remarks(self, *notes: FieldNote) -> None:
        """Show remarks about the typed text."""
        lines = note_lines(notes, max(20, self.size.width - LABEL - 2), REMARK_ROWS)
        self.remarks.show(*(crop(((" " * LABEL, "plain"), *line), self.size.width) for line in lines))

    def take(self, typed: str, step: int) -> None:
        """Accept the typed text, and go on to the next text (1), the previous one (-1), or none (0)."""
        if not self.is_typing:
            return
        try:
            edits = self.edits_typed(typed)
        except EditRefused as refused:
            self.show_remarks(FieldNote("error", clean(str(refused))))
            return
        step = self.step_over(step)
        self.close_field()
        self.make(*edits, then=lambda: self.go_on(step, changed=bool(edits)))

    @on(TextArea.Changed)
    def _typed(self, event: TextArea.Changed) -> None:
        event.stop()
        if self.is_typing:
            remarks = self.field.sentence
            self.preview(lambda: self.edits_typed(remarks), self.show_remarks)
