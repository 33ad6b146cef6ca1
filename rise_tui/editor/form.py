"""Forms on the screen: a list of fields that are changed one by one, and a form that is filled in as a whole."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.message import Message
from textual.suggester import Suggester
from textual.widgets import Input

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import EditRefused
from rise_tui.editor.model.fields import (
    EditField,
    FieldChoice,
    FieldNote,
    FormColumns,
    field_line,
    field_rows,
    form_columns,
    note_lines,
)
from rise_tui.editor.page import EditFrame, EditPage
from rise_tui.rendering.text import StyledLine, crop, line_width, wrap
from rise_tui.widgets.prompt_bar import TextField
from rise_tui.widgets.row_list import RowList, RowView
from rise_tui.widgets.static_lines import StaticLines

Step: TypeAlias = Literal[0, 1, -1]
"""Where the cursor goes: to this field, the next, the previous one."""
TAKES: dict[str, Step] = {"enter": 0, "tab": 1, "down": 1, "shift+tab": -1, "up": -1}
"""Keys that accept what is typed."""


class EndingSuggester(Suggester):
    """Shows a likely ending after what is typed; → accepts it."""

    def __init__(self, ending: Callable[[str], str]) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._ending = ending

    async def get_suggestion(self, value: str) -> str | None:
        ending = self._ending(value)
        return value + ending if ending else None


class FieldList(Vertical):
    """Shows fields (`show`). The field under the cursor is changed in its row. Messages carry the new value."""

    DEFAULT_CSS = """
    FieldList { height: 1fr; layers: default edit; }
    FieldList TextField { layer: edit; display: none; }
    FieldList #said { height: 2; }
    """

    @dataclass
    class SetField(Message):
        """Give a field another text; None: remove it."""

        field: EditField
        text: str | None

    @dataclass
    class FieldTyped(Message):
        """The text of a field while it is typed."""

        field: EditField
        text: str

    @dataclass
    class OpenField(Message):
        """Open the list of a field's choices."""

        field: EditField

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.rows = RowList()
        self.input = TextField(select_on_focus=False, suggester=EndingSuggester(self.ending))
        self._said = StaticLines(id="said")
        self._fields: dict[str, EditField] = {}
        self._typing: EditField | None = None
        self._notes: Sequence[FieldNote] = ()
        self._option = -1
        """The option under the cursor, in a field that shows all its options."""

    def compose(self) -> ComposeResult:
        yield self.rows
        yield self._said
        yield self.input

    @property
    def is_typing(self) -> bool:
        return self._typing is not None

    @property
    def current(self) -> EditField | None:
        """The field under the cursor."""
        return self._fields.get(self.rows.current_id)

    @property
    def text(self) -> str:
        """The characters of all rows and of the lines below."""
        return f"{self.rows.text}\n{self._said.text}"

    above = 0
    """Lines above the rows."""

    @property
    def _columns(self) -> FormColumns:
        return form_columns(tuple(self._fields.values()), self._width)

    @property
    def _width(self) -> int:
        return max(20, self.rows.row_width)

    def show(self, fields: Sequence[EditField]) -> None:
        """Show these fields. The field that is being typed in keeps its text."""
        self._fields = {each.id: each for each in fields}
        at = self._typing.id if self._typing is not None else self.rows.current_id
        self.rows.show(field_rows(fields, self._width, (at, self._option)))
        if self._typing is not None and self._typing.id in self._fields:
            self._typing = self._fields[self._typing.id]
            self._place_input()  # a field can open before the form has its width
        elif self._typing is not None:
            self.close()
        self._draw_said()

    def say(self, *notes: FieldNote) -> None:
        """Show remarks about the field instead of its own note."""
        self._notes = notes
        self._draw_said()

    def _draw_said(self) -> None:
        width, height = max(20, self._said.size.width), max(2, self._said.size.height)
        field = self._typing or self.current
        lines: list[StyledLine] = []
        if self._notes:
            lines = note_lines(self._notes, width - 4, height)
        elif field is not None and (note := field.reason or field.note) and (self.is_typing or self._is_cut(field)):
            lines = [((piece, "muted"),) for piece in wrap(note, width - 4)[:height]]
        self._said.show(*(crop((("   ", "plain"), *line), width) for line in lines))

    def _is_cut(self, field: EditField) -> bool:
        """Whether the row is too narrow for the whole note."""
        return line_width(field_line(field, self._columns)) > self.rows.row_width

    # --- changing -----------------------------------------------------------------------------------------------------

    def open_current(self, *, select: bool = False) -> None:
        """Open the field under the cursor.

        :param select: whether what is typed replaces the whole value.
        """
        field = self.current
        if field is None or field.reason or field.kind == "fixed":
            return
        if field.kind != "text":
            self.post_message(self.OpenField(field))
            return
        self._typing = field
        self._place_input()
        with self.input.prevent(Input.Changed):
            self.input.placeholder = field.empty if field.text is None else ""
            self.put(field.text or "")
            if select:
                self.input.select_all()
        self.input.display = True
        self.screen.set_focus(self.input)
        self.say()

    def put(self, text: str) -> None:
        """Put a text into the open field, with the cursor at its end."""
        self.input.value = text
        self.input.cursor_position = len(text)

    def _place_input(self) -> None:
        """Lay the open field over the value in its row, and over the note behind it."""
        left = self._columns.value
        self.input.styles.offset = (left, self.rows.cursor - self.rows.scroll_offset.y + self.above)
        self.input.styles.width = max(10, self.rows.row_width - left)

    def clear_current(self) -> None:
        """Remove the value of the field under the cursor."""
        field = self.current
        if field is not None and not field.reason and field.kind in ("text", "choice") and field.text is not None:
            self.post_message(self.SetField(field, None))

    def close(self) -> None:
        """Close the open field, unchanged."""
        if self._typing is not None:
            self._typing = None
            self.input.display = False
            self.say()
            self.screen.set_focus(self.rows)

    def ending(self, text: str) -> str:
        """A likely ending for what is typed."""
        return ""

    def typed(self, field: EditField, text: str) -> None:
        """Report that the text of the open field has changed."""
        self.post_message(self.FieldTyped(field, text))

    @on(Input.Changed)
    def _input_changed(self, event: Input.Changed) -> None:
        event.stop()
        if self._typing is not None:
            self.typed(self._typing, event.value)

    def on_key(self, event: events.Key) -> None:
        if self.carry_out_key(event.key):
            event.stop()
            event.prevent_default()

    def carry_out_key(self, key: str) -> bool:
        """Carry out a key that is not text; False: it means nothing here."""
        if self._typing is None:
            return False
        if key == "escape":
            self.close()
        elif key in TAKES:
            self._take(TAKES[key])
        return key == "escape" or key in TAKES

    def _take(self, step: Step) -> None:
        field, text = self._typing, self.input.value
        self.close()
        if field is not None and text != (field.text or ""):
            given = text if text or field.required else None
            self.post_message(self.SetField(field, given))
        if step:
            before = self.rows.cursor
            self.rows.action_step(step)
            following = self.current
            if self.rows.cursor != before and following is not None and following.kind == "text":
                self.open_current(select=True)

    @on(RowView.CursorMoved)
    def _moved(self, event: RowView.CursorMoved) -> None:
        if event.rows is self.rows:
            self.say()


class FormPage(EditPage):
    """A page with a list of fields. The subclass places the list and provides the fields."""

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__(frame, name)
        self.form = FieldList()

    @property
    def is_typing(self) -> bool:
        return self.form.is_typing

    @property
    def form_calls(self) -> Mapping[str, Callable[[], object]]:
        """What actions do while the form has the focus."""
        return {"edit.open": self._open_current, "edit.remove": self._remove_current}

    def _open_current(self) -> None:
        self.form.open_current()
        self.frame.draw_bars()

    def _remove_current(self) -> None:
        if not self.remove_field():
            self.form.clear_current()

    def remove_field(self) -> bool:
        """Remove more than the text of the field under the cursor; False: only its text."""
        return False

    @on(FieldList.SetField)
    def _set(self, event: FieldList.SetField) -> None:
        event.stop()
        self._take(event.field, event.text)

    def _take(self, field: EditField, text: str | None) -> None:
        try:
            edits = field.edits(text)
        except EditRefused as refused:
            self.form.say(FieldNote("error", str(refused)))
            return
        self.frame.make(*edits)
        self.frame.draw_bars()

    @on(FieldList.OpenField)
    def _open(self, event: FieldList.OpenField) -> None:
        event.stop()
        field = event.field
        if field.kind == "many":
            now = tuple(filter(None, (field.text or "").split(",")))
            self.frame.choose_many(
                field.label, field.choices, now, lambda chosen: self._take(field, ",".join(chosen) or None)
            )
            return
        choices = list(field.choices)
        if not field.required and field.text is not None and field.id not in ("type", "failure"):
            choices.append(FieldChoice("", "– not given", field.note))
        self.frame.choose(field.label, choices, lambda chosen: self._take(field, chosen or None),
                          now=field.text or "", new=field.new)  # fmt: skip

    @on(FieldList.FieldTyped)
    def _typed(self, event: FieldList.FieldTyped) -> None:
        event.stop()

        def edits() -> tuple[AnyEdit, ...]:
            return event.field.edits(event.text or None)

        self.preview(edits, self.form.say)
