"""A form: fields under each other, of which the one under the cursor is changed in its place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal, TypeAlias

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.message import Message
from textual.widgets import Input

from rise_tui.editor.model.fields import EditField, FormColumns, field_line, field_rows, form_columns
from rise_tui.rendering.text import StyledLine, TextRole, crop, line_width, wrap
from rise_tui.widgets.prompt_bar import TextField
from rise_tui.widgets.row_list import RowList, RowView
from rise_tui.widgets.static_lines import StaticLines

Step: TypeAlias = Literal[0, 1, -1]
"""To which field it goes on: this one, the next, the one before."""


class FieldInput(TextField):
    """A value that is typed in its row; tab takes it and goes on to the next field."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("tab", "take(1)", show=False),
        Binding("shift+tab", "take(-1)", show=False),
        Binding("down", "take(1)", show=False),
        Binding("up", "take(-1)", show=False),
    ]

    @dataclass
    class Taken(Message):
        """It is to be as typed."""

        step: Step

    class Left(Message):
        """It is to be as it was."""

    def action_take(self, step: Step) -> None:
        self.post_message(self.Taken(step))

    def on_key(self, event: events.Key) -> None:
        if event.key == "escape":
            event.stop()
            event.prevent_default()
            self.post_message(self.Left())


class FieldList(Vertical):
    """Shows fields (`show`); says what is to become of them."""

    DEFAULT_CSS = """
    FieldList { height: 1fr; layers: default edit; }
    FieldList FieldInput { layer: edit; display: none; }
    FieldList FieldInput.-open { display: block; }
    FieldList #said { height: 2; }
    """

    @dataclass
    class SetField(Message):
        """A field is to have another text; None: none."""

        field: EditField
        text: str | None

    @dataclass
    class FieldTyped(Message):
        """A field is being typed in, and would be so."""

        field: EditField
        text: str

    @dataclass
    class OpenField(Message):
        """One of its choices is asked for."""

        field: EditField

    def __init__(self) -> None:
        super().__init__()
        self.rows = RowList()
        self._input = FieldInput(select_on_focus=False)
        self._said = StaticLines(id="said")
        self._fields: dict[str, EditField] = {}
        self._typing: EditField | None = None
        self._finding: tuple[str, bool] = ("", False)

    def compose(self) -> ComposeResult:
        yield self.rows
        yield self._said
        yield self._input

    @property
    def is_typing(self) -> bool:
        return self._typing is not None

    @property
    def current(self) -> EditField | None:
        """The field under the cursor."""
        return self._fields.get(self.rows.current_id)

    @property
    def _columns(self) -> FormColumns:
        return form_columns(tuple(self._fields.values()), max(20, self.rows.row_width))

    @property
    def text(self) -> str:
        """The characters of all rows and of what is said below."""
        return f"{self.rows.text}\n{self._said.text}"

    def show(self, fields: Sequence[EditField]) -> None:
        """Show these; one that is being typed in stays as it is typed."""
        self._fields = {each.id: each for each in fields}
        self.rows.show(field_rows(fields, max(20, self.rows.row_width)))
        if self._typing is not None and self._typing.id in self._fields:
            self._typing = self._fields[self._typing.id]
            self._place_input()  # a field can be opened before the form has its width
        elif self._typing is not None:
            self.close()
        self._draw_said()

    def say(self, finding: str, *, is_error: bool = False) -> None:
        """What is wrong with what is typed."""
        self._finding = (finding, is_error)
        self._draw_said()

    def _draw_said(self) -> None:
        finding, is_error = self._finding
        width = max(20, self._said.size.width)
        field = self._typing or self.current
        lines: list[StyledLine] = []
        if finding:
            role: TextRole = "fault" if is_error else "wait"
            pieces = wrap(finding, width - 6)
            lines = [crop(((f"   {'✗' if is_error else '▲'} {piece}" if not at else f"     {piece}", role),), width)
                     for at, piece in enumerate(pieces[:2])]  # fmt: skip
        elif field is not None and (note := field.reason or field.note) and (self.is_typing or self._is_cut(field)):
            lines = [((f"   {piece}", "muted"),) for piece in wrap(note, width - 4)[:2]]
        self._said.show(*lines)

    def _is_cut(self, field: EditField) -> bool:
        """Whether its row has no room for all of its note."""
        return line_width(field_line(field, self._columns)) > self.rows.row_width

    # --- changing -----------------------------------------------------------------------------------------------------

    def open_current(self, *, select: bool = False) -> None:
        """Change the field under the cursor.

        :param select: whether what is typed replaces all that stands there.
        """
        field = self.current
        if field is None or field.reason or field.kind == "fixed":
            return
        if field.kind != "text":
            self.post_message(self.OpenField(field))
            return
        self._typing = field
        self._place_input()
        with self._input.prevent(Input.Changed):
            self._input.value = field.text or ""
            self._input.cursor_position = len(self._input.value)
            if select:
                self._input.select_all()
        self._input.add_class("-open")
        self._input.focus()
        self.say("")

    def _place_input(self) -> None:
        """The open field lies over the value in its row, and over the note behind it."""
        left = self._columns.value
        self._input.styles.offset = (left, self.rows.cursor - self.rows.scroll_offset.y)
        self._input.styles.width = max(10, self.rows.row_width - left)

    def clear_current(self) -> None:
        """Nothing is to be given in the field under the cursor."""
        field = self.current
        if field is not None and not field.reason and field.kind in ("text", "choice") and field.text is not None:
            self.post_message(self.SetField(field, None))

    def close(self) -> None:
        """Leave the open field as it was."""
        if self._typing is not None:
            self._typing = None
            self._input.remove_class("-open")
            self.say("")
            self.rows.focus()

    @on(Input.Changed)
    def _typed(self, event: Input.Changed) -> None:
        event.stop()
        if self._typing is not None:
            self.post_message(self.FieldTyped(self._typing, event.value))

    @on(Input.Submitted)
    def _submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self._take(0)

    @on(FieldInput.Taken)
    def _taken(self, event: FieldInput.Taken) -> None:
        event.stop()
        self._take(event.step)

    @on(FieldInput.Left)
    def _left(self, event: FieldInput.Left) -> None:
        event.stop()
        self.close()

    def _take(self, step: Step) -> None:
        field, text = self._typing, self._input.value
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
            self.say("")
