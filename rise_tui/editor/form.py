"""Forms on the screen: a list of fields that are changed one by one, and a form that is filled in as a whole."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
    RuleForm,
    field_line,
    field_rows,
    form_columns,
    note_lines,
    ticked,
)
from rise_tui.editor.page import EditFrame, EditPage
from rise_tui.editor.pick_list import Picked, PickList
from rise_tui.rendering.text import StyledLine, crop, line_width, wrap
from rise_tui.widgets.memory_editor import TextField
from rise_tui.widgets.row_list import RowList, RowView
from rise_tui.widgets.static_lines import StaticLines

Step: TypeAlias = Literal[0, 1, -1]
"""To which field it goes on: this one, the next, the one before."""
TAKES: dict[str, Step] = {"enter": 0, "tab": 1, "down": 1, "shift+tab": -1, "up": -1}
"""Keys that take what is typed."""
KEEPS_TEXT = ("condition", "held", "value")
"""Fields in which a chosen name is added to what is typed."""


class EndingSuggester(Suggester):
    """Shows a likely ending behind what is typed; → takes it."""

    def __init__(self, ending: Callable[[str], str]) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._ending = ending

    async def get_suggestion(self, value: str) -> str | None:
        ending = self._ending(value)
        return value + ending if ending else None


class FieldList(Vertical):
    """Shows fields (`show`). The field under the cursor is changed in its row; messages say what it should become."""

    DEFAULT_CSS = """
    FieldList { height: 1fr; layers: default edit; }
    FieldList TextField { layer: edit; display: none; }
    FieldList #said { height: 2; }
    """

    @dataclass
    class SetField(Message):
        """Give a field another text; None: none."""

        field: EditField
        text: str | None

    @dataclass
    class FieldTyped(Message):
        """The text of a field while it is typed."""

        field: EditField
        text: str

    @dataclass
    class OpenField(Message):
        """Let one of its choices be chosen."""

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
        """The option under the cursor, where a field shows them all."""

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
        """Show these; the one that is being typed in stays as it is typed."""
        self._fields = {each.id: each for each in fields}
        at = self._typing.id if self._typing is not None else self.rows.current_id
        self.rows.show(field_rows(fields, self._width, (at, self._option)))
        if self._typing is not None and self._typing.id in self._fields:
            self._typing = self._fields[self._typing.id]
            self._place_input()  # a field can be opened before the form has its width
        elif self._typing is not None:
            self.close()
        self._draw_said()

    def say(self, *notes: FieldNote) -> None:
        """Remarks about the field, instead of its own note."""
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
        """Whether its row has no room for all of its note."""
        return line_width(field_line(field, self._columns)) > self.rows.row_width

    # --- changing -----------------------------------------------------------------------------------------------------

    def open_current(self, *, select: bool = False) -> None:
        """Change the field under the cursor.

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
        """Put a text into the open field, with the cursor behind it."""
        self.input.value = text
        self.input.cursor_position = len(text)

    def _place_input(self) -> None:
        """The open field lies over the value in its row, and over the note behind it."""
        left = self._columns.value
        self.input.styles.offset = (left, self.rows.cursor - self.rows.scroll_offset.y + self.above)
        self.input.styles.width = max(10, self.rows.row_width - left)

    def clear_current(self) -> None:
        """Take away the value of the field under the cursor."""
        field = self.current
        if field is not None and not field.reason and field.kind in ("text", "choice") and field.text is not None:
            self.post_message(self.SetField(field, None))

    def close(self) -> None:
        """Leave the open field as it was."""
        if self._typing is not None:
            self._typing = None
            self.input.display = False
            self.say()
            self.screen.set_focus(self.rows)

    def ending(self, text: str) -> str:
        """A likely ending for what is typed."""
        return ""

    def typed(self, field: EditField, text: str) -> None:
        """The text of the open field has changed."""
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
        """Carry out a key that is not typed; False: it means nothing here."""
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
    """A page that holds a list of fields; the subclass says which, and where the list stands."""

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__(frame, name)
        self.form = FieldList()

    @property
    def is_typing(self) -> bool:
        return self.form.is_typing

    def carry_out_in_form(self, action: str) -> bool:
        """What an action means while the form has the keys."""
        if action == "edit.open":
            self.form.open_current()
            self.frame.draw_bars()
            return True
        if action == "edit.remove":
            if not self.remove_field():
                self.form.clear_current()
            return True
        return False

    def remove_field(self) -> bool:
        """Take away more than the text of the field under the cursor; False: only its text."""
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


class FormPanel(FieldList):
    """A form that is filled in as a whole: the field under the cursor is open, enter carries the form out."""

    DEFAULT_CSS = """
    FormPanel { height: auto; max-height: 70%; display: none; }
    FormPanel.-open { display: block; }
    FormPanel #said { height: 3; }
    """
    above = 1

    @dataclass
    class Finished(Message):
        """Enter: carry it out."""

        form: RuleForm

    @dataclass
    class FormChanged(Message):
        """A value of the form is another."""

        form: RuleForm

    class FormLeft(Message):
        """Esc: nothing is changed."""

    @dataclass
    class ExtraAsked(Message):
        """F5: what goes with the form, as a key for an event."""

        form: RuleForm

    def __init__(self) -> None:
        super().__init__(id="form")
        self.form: RuleForm | None = None
        self.is_waiting = False
        """Whether the form is just being carried out: a second enter must not do it again."""
        self.heading = StaticLines(id="form-heading")
        self._finding: list[FieldNote] = []
        self._problem = ""

    def compose(self) -> ComposeResult:
        yield self.heading
        yield from super().compose()

    @property
    def is_open(self) -> bool:
        return self.form is not None

    def open(self, form: RuleForm, focus: str = "") -> None:
        """Show a form, with the cursor in a field (else in its first that is typed)."""
        self.form, self.is_waiting, self._finding, self._problem = form, False, [], ""
        self._typing = None
        self.add_class("-open")
        first = next((each.id for each in form.fields if each.kind == "text"), form.fields[0].id)
        self._show_form()
        self._enter(focus or first)

    def close_form(self) -> None:
        """Leave the form."""
        self.form, self._typing = None, None
        self.input.display = False
        self.remove_class("-open")

    def say_finding(self, *found: FieldNote) -> None:
        """What the check says about the study as the form would make it."""
        self._finding = list(found)
        self._draw_said()

    def _show_form(self) -> None:
        if self.form is None:
            return
        width = self.size.width or self.app.size.width
        title = f"── {self.form.title} "
        self.heading.show(crop(((title, "accent"), ("─" * max(0, width - len(title)), "muted")), max(1, width)))
        self.show(self.form.fields)
        self.rows.styles.height = self.rows.count

    def _enter(self, id: str) -> None:
        """Put the cursor on a field: a text is open at once, among options it stands on the chosen one."""
        self.rows.select(id)
        field = self.current
        if field is not None and field.kind == "text":
            self._option = -1
            self.open_current()
            self._show_form()
        elif field is not None:
            self._typing = None
            self.input.display = False
            values = [each.value for each in field.choices]
            self._option = values.index(field.text) if field.kind == "option" and field.text in values else 0
            self.screen.set_focus(self.rows)
            self._show_form()

    def _draw_said(self) -> None:
        field = self._typing or self.current
        if self.form is not None and field is not None:
            notes = self.form.notes(field.id)
            if not any(note.level == "error" for note in notes):
                notes = [*self._finding, *notes]
            if not notes and self.form.choices(field.id):
                notes = [FieldNote("info", "F2 lists the names")]
            self._notes = [FieldNote("error", self._problem)] if self._problem else notes
        super()._draw_said()

    # --- keys ---------------------------------------------------------------------------------------------------------

    def ending(self, text: str) -> str:
        return self.form.ending(self._typing.id, text) if self.form is not None and self._typing is not None else ""

    def typed(self, field: EditField, text: str) -> None:
        self._change(field.id, text)

    def _change(self, field: str, value: str) -> None:
        form = self.form
        if form is None or value == next((each.text or "" for each in form.fields if each.id == field), None):
            return
        self.form, self.is_waiting, self._problem, self._finding = form.with_value(field, value), False, "", []
        self._show_form()
        self.post_message(self.FormChanged(self.form))

    def carry_out_key(self, key: str) -> bool:
        form, field = self.form, self.current
        if form is None or field is None:
            return False
        if key == "enter":
            self.finish()
        elif key == "escape":
            self.post_message(self.FormLeft())
        elif key in TAKES:
            self._go_on(TAKES[key])
        elif key == "f2":
            self._list_names(field)
        elif key == "f5":
            self.post_message(self.ExtraAsked(form))
        elif field.kind in ("option", "ticks") and key in ("left", "right", "space"):
            self._choose_option(field, key)
        else:
            return False
        return True

    def _go_on(self, step: Step) -> None:
        """The fields are a ring: nothing but esc and enter leads out of the form."""
        ids = list(self._fields)
        self._enter(ids[(ids.index(self.rows.current_id) + step) % len(ids)])

    def _choose_option(self, field: EditField, key: str) -> None:
        """The options are a ring; of ticks, space takes one in or out."""
        if field.kind == "ticks" and key == "space":
            chosen = {*ticked(field)} ^ {field.choices[self._option].value}
            self._change(field.id, " ".join(each.value for each in field.choices if each.value in chosen))
            return
        self._option = (self._option + (-1 if key == "left" else 1)) % len(field.choices)
        if field.kind == "option":
            self._change(field.id, field.choices[self._option].value)
        else:
            self._show_form()

    def _list_names(self, field: EditField) -> None:
        choices = self.form.choices(field.id) if self.form is not None else []
        if not choices:
            return

        def take(picked: Picked | None) -> None:
            if picked is None or not picked.value:
                return
            text = self.input.value if field.id in KEEPS_TEXT else ""
            self.put(f"{text}{'' if not text or text[-1] in ' ([' else ' '}{picked.value}")

        self.app.push_screen(PickList(field.label, choices, now=(field.text or "").strip(), new=field.new), take)

    def finish(self) -> None:
        """Carry the form out, if nothing is missing."""
        if self.form is None:
            return
        self._problem = self.form.missing()
        self._draw_said()
        if not self._problem and not self.is_waiting:
            self.is_waiting = True
            self.post_message(self.Finished(self.form))

    @on(RowView.Resized)
    def _resized(self, event: RowView.Resized) -> None:
        event.stop()
        self._show_form()

    @on(RowView.CursorMoved)
    def _moved_here(self, event: RowView.CursorMoved) -> None:
        event.stop()
        self._enter(self.rows.current_id)
