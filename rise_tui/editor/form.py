"""Forms on the screen: the fields of a page, changed one by one, and a form that is filled in as a whole."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Literal, TypeAlias

from textual import events, on
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.widgets import Input

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import EditRefused
from rise_tui.editor.dialogs import Picked, PickList
from rise_tui.editor.model.fields import (
    EditField,
    FieldChoice,
    FieldNote,
    Form,
    FormColumns,
    complete_name,
    field_line,
    field_rows,
    form_columns,
    info,
    note_lines,
)
from rise_tui.editor.model.study_names import suggest_ending
from rise_tui.editor.page import EditFrame, EditPage
from rise_tui.rendering.text import crop, line_width
from rise_tui.widgets.fields import EndingSuggester, TextField
from rise_tui.widgets.lines import RowList, RowView, StaticLines

Step: TypeAlias = Literal[0, 1, -1]
"""The cursor's next field: this one, the next, the previous one."""
ACCEPTING_KEYS: dict[str, Step] = {"enter": 0, "tab": 1, "down": 1, "shift+tab": -1, "up": -1}
"""Keys that accept the typed text."""


class FieldList(Vertical):
    """Shows fields (`show`). The field under the cursor opens in its row, and is changed when its text is accepted."""

    DEFAULT_CSS = """
    FieldList { height: 1fr; layers: default edit; }
    FieldList TextField { layer: edit; display: none; }
    FieldList #said { height: 2; }
    """
    above = 0
    """Lines above the rows."""

    def __init__(self, page: EditPage, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.rows = RowList()
        self.input = TextField(select_on_focus=False, suggester=EndingSuggester(self._ending))
        self._remarks = StaticLines(id="said")
        self._page = page
        self._fields: dict[str, EditField] = {}
        self._typing: EditField | None = None
        self._notes: Sequence[FieldNote] = ()
        self._option = -1
        """The option under the cursor, in a field that shows all its options."""

    def compose(self) -> ComposeResult:
        yield self.rows
        yield self._remarks
        yield self.input

    @property
    def is_typing(self) -> bool:
        return self._typing is not None

    @property
    def current(self) -> EditField | None:
        """The field under the cursor."""
        return self.field(self.rows.current_id)

    def field(self, id: str) -> EditField | None:
        """One of the fields; None: not shown now."""
        return self._fields.get(id)

    @property
    def text(self) -> str:
        """The characters of all rows and of the lines below."""
        return f"{self.rows.text}\n{self._remarks.text}"

    # --- drawing ------------------------------------------------------------------------------------------------------

    @property
    def _columns(self) -> FormColumns:
        return form_columns(tuple(self._fields.values()), self._width)

    @property
    def _width(self) -> int:
        return max(20, self.rows.row_width)

    def show(self, fields: Sequence[EditField]) -> None:
        """Show these fields. The field with the cursor keeps its typed text."""
        self._fields = {each.id: each for each in fields}
        at = self._typing.id if self._typing is not None else self.rows.current_id
        self.rows.show(field_rows(fields, self._width, (at, self._option)))
        if self._typing is not None and self._typing.id in self._fields:
            self._typing = self._fields[self._typing.id]
            self._place_input()  # a field can open before the form has its width
        elif self._typing is not None:
            self.close()
        self._draw_remarks()

    def say(self, *notes: FieldNote) -> None:
        """Show remarks about the typed text."""
        self._notes = notes
        self._draw_remarks()

    def _draw_remarks(self) -> None:
        field = self._typing or self.current
        notes = self.notes_on(field) if field is not None else self._notes
        width, height = max(20, self._remarks.size.width), max(2, self._remarks.size.height)
        lines = note_lines(notes, width - 4, height)
        self._remarks.show(*(crop((("   ", "plain"), *line), width) for line in lines))

    def notes_on(self, field: EditField) -> Sequence[FieldNote]:
        """Return the remarks about a field, the most important first."""
        is_seen = not self.is_typing and not self._is_cut(field)
        return self._notes or info("" if is_seen else field.reason or field.note)

    def _is_cut(self, field: EditField) -> bool:
        """Whether the row is too narrow for the whole note."""
        return line_width(field_line(field, self._columns)) > self.rows.row_width

    # --- fields -------------------------------------------------------------------------------------------------------

    def open_current(self, *, select: bool = False) -> None:
        """Open the field under the cursor.

        :param select: whether typed text replaces the whole value.
        """
        field = self.current
        if field is None or field.reason or field.kind == "fixed":
            return
        if field.kind != "text":
            self.list_choices(field)
            return
        self._typing = field
        self._place_input()
        with self.input.prevent(Input.Changed):
            self.input.placeholder = field.empty if field.text is None else ""
            self._put(field.text or "")
            if select:
                self.input.select_all()
        self.input.display = True
        self.screen.set_focus(self.input)
        self.say()

    def _put(self, text: str) -> None:
        """Put a text into the open field, with the cursor at its end."""
        self.input.value = text
        self.input.cursor_position = len(text)

    def _place_input(self) -> None:
        """Lay the open field over the value in its row, and over the note behind it."""
        left = self._columns.value
        self.input.styles.offset = (left, self.rows.cursor - self.rows.scroll_offset.y + self.above)
        self.input.styles.width = max(10, self.rows.row_width - left)

    def close(self) -> None:
        """Close the open field, unchanged."""
        if self._typing is not None:
            self._typing = None
            self.input.display = False
            self.say()
            self.screen.set_focus(self.rows)

    def clear_current(self) -> None:
        """Remove the value of the field under the cursor."""
        field = self.current
        if field is not None and not field.reason and field.kind in ("text", "choice") and field.text is not None:
            self._set(field, None)

    def _set(self, field: EditField, text: str | None) -> None:
        """Give a field of a page another text; None: remove it."""
        try:
            edits = field.edits(text)
        except EditRefused as refused:
            self.say(FieldNote("error", str(refused)))
        else:
            self._page.make(*edits)

    def list_choices(self, field: EditField) -> None:
        """Open the list of a field's choices. The chosen name goes into an open field."""
        text, choices, ticks = (field.text or "").strip(), list(field.choices), None
        if field.kind == "many":
            text, ticks = "", field.chosen
        elif field.kind == "choice" and field.can_be_cleared and not field.required and field.text is not None:
            choices.append(FieldChoice("", "– not given", field.note))

        def take(picked: Picked | None) -> None:
            if picked is None:
                return
            if field.kind == "many":
                self._set(field, ",".join(picked.ticked) or None)
            elif field.kind == "choice":
                self._set(field, picked.value or None)
            elif picked.value:
                begun = self.input.value if field.is_expression else ""
                self._put(f"{begun}{'' if not begun or begun[-1] in ' ([' else ' '}{picked.value}")

        question = field.question or field.label
        self.app.push_screen(PickList(question, choices, now=text, new=field.new, ticked=ticks), take)

    def _ending(self, text: str) -> str:
        """Return a likely ending for the typed text."""
        names = [each.value for each in self._typing.choices] if self._typing is not None else []
        is_expression = self._typing is not None and self._typing.is_expression
        return suggest_ending(text, names) if is_expression else complete_name(text, names)

    @on(Input.Changed)
    def _typed(self, event: Input.Changed) -> None:
        event.stop()
        if self._typing is not None:
            self.typed(self._typing, event.value)

    def typed(self, field: EditField, text: str) -> None:
        """Check the typed text."""
        self._page.preview(lambda: field.edits(text or None), self.say)

    # --- keys ---------------------------------------------------------------------------------------------------------

    def on_key(self, event: events.Key) -> None:
        if self.carry_out_key(event.key):
            event.stop()
            event.prevent_default()

    def carry_out_key(self, key: str) -> bool:
        """Carry out a key that is not text; False: it has no meaning here."""
        if self._typing is None:
            return False
        if key == "escape":
            self.close()
        elif key in ACCEPTING_KEYS:
            self._take(ACCEPTING_KEYS[key])
        return key == "escape" or key in ACCEPTING_KEYS

    def _take(self, step: Step) -> None:
        """Accept the typed text, and open the next field."""
        field, text = self._typing, self.input.value
        self.close()
        if field is not None and text != (field.text or ""):
            self._set(field, text if text or field.required else None)
        before = self.rows.cursor
        if step:
            self.rows.action_step(step)
        following = self.current
        if self.rows.cursor != before and following is not None and following.kind == "text":
            self.open_current(select=True)

    @on(RowView.CursorMoved)
    def _moved(self) -> None:
        self.say()


class FormPage(EditPage):
    """A page with a list of fields. The subclass places the list and provides the fields."""

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        super().__init__(frame, name)
        self.form = FieldList(self)

    @property
    def is_typing(self) -> bool:
        return self.form.is_typing

    @property
    def form_calls(self) -> Mapping[str, Callable[[], object]]:
        """The effects of actions while the form has the focus."""
        return {"edit.open": self.form.open_current, "edit.remove": self.form.clear_current}


class FormPanel(FieldList):
    """Shows a form (`open`). The field under the cursor is always open. Enter carries out the form, Esc leaves it."""

    DEFAULT_CSS = """
    FormPanel { height: auto; max-height: 70%; }
    FormPanel #said { height: 3; }
    """
    above = 1

    def __init__(self, page: EditPage) -> None:
        super().__init__(page, id="form")
        self.heading = StaticLines(id="form-heading")
        self.form: Form | None = None
        self._when_closed: Callable[[Form | None], None] = lambda form: None
        self._found: Sequence[FieldNote] = ()
        """The new diagnostics that the study would have."""

    def compose(self) -> ComposeResult:
        yield self.heading
        yield from super().compose()

    @property
    def is_open(self) -> bool:
        return self.form is not None

    def open(self, form: Form, focus: str, closed: Callable[[Form | None], None]) -> None:
        """Show a form with the cursor in field `focus`, or else in the first text field.

        :param closed: receives the form when it was carried out; None: the author left it.
        """
        self.form, self._when_closed, self._found, self._typing = form, closed, (), None
        self._show_form()
        first = next((each.id for each in self._fields.values() if each.kind == "text"), next(iter(self._fields)))
        self._enter(focus or first)

    def _close_form(self, form: Form | None) -> None:
        self.form, self._typing = None, None
        self.input.display = False
        self._when_closed(form)

    def _show_form(self) -> None:
        if self.form is None:
            return
        width = self.size.width or self.app.size.width
        title = f"── {self.form.title} "
        self.heading.show(crop(((title, "accent"), ("─" * max(0, width - len(title)), "muted")), max(1, width)))
        self.show(self.form.fields)
        self.rows.styles.height = self.rows.count

    def notes_on(self, field: EditField) -> Sequence[FieldNote]:
        if self._notes:
            return self._notes
        is_text = field.kind == "text"
        notes = [*self._found, *field.remarks, *info(field.note if is_text else "")]
        return notes or info("F2 lists the names" if is_text and field.choices else "")

    def _show_found(self, *notes: FieldNote) -> None:
        self._found = notes
        self._draw_remarks()

    def _enter(self, id: str) -> None:
        """Put the cursor on a field. A text opens immediately; among options the cursor is on the chosen one."""
        self.rows.select(id)
        field, self._notes = self.current, ()
        if field is None:
            return
        if field.kind == "text":
            self._option = -1
            self.open_current()
        else:
            self._typing = None
            self.input.display = False
            values = [each.value for each in field.choices]
            self._option = values.index(field.text) if field.kind == "option" and field.text in values else 0
            self.screen.set_focus(self.rows)
        self._show_form()

    def typed(self, field: EditField, text: str) -> None:
        self._change(field.id, text)

    def _change(self, field: str, value: str) -> None:
        form = self.form
        if form is None or value == (self._fields[field].text or ""):
            return
        self.form, self._notes, self._found = form.with_value(field, value), (), ()
        self._show_form()
        self._page.preview(self._edits_so_far, self._show_found)

    def _edits_so_far(self) -> tuple[AnyEdit, ...]:
        """Return the edits of the form; none while it is incomplete, because that is no error yet."""
        try:
            return self.form.edits() if self.form is not None else ()
        except EditRefused:
            return ()

    def carry_out_key(self, key: str) -> bool:
        form, field = self.form, self.current
        if form is None or field is None:
            return False
        if key == "enter":
            self._finish(form, lambda: self._close_form(form))
        elif key == "escape":
            self._close_form(None)
        elif key in ACCEPTING_KEYS:  # the fields are a ring: only Esc and Enter leave the form
            ids = list(self._fields)
            self._enter(ids[(ids.index(field.id) + ACCEPTING_KEYS[key]) % len(ids)])
        elif key == "f2":
            if field.kind == "text" and field.choices:
                self.list_choices(field)
        elif key == "f5":
            if (following := form.following()) is not None:
                self._finish(form, lambda: self.open(following, "", self._when_closed))
        elif field.kind in ("option", "ticks") and key in ("left", "right", "space"):
            self._choose_option(field, key)
        else:
            return False
        return True

    def _finish(self, form: Form, then: Callable[[], None]) -> None:
        """Carry out the form, if nothing is missing."""
        try:
            edits = form.edits()
        except EditRefused as refused:
            self.say(FieldNote("error", str(refused)))
        else:
            self._page.make(*edits, then=then)

    def _choose_option(self, field: EditField, key: str) -> None:
        """Move among the options, which are a ring. In a field of ticks, space ticks or unticks one."""
        if field.kind == "ticks" and key == "space":
            chosen = {*field.chosen} ^ {field.choices[self._option].value}
            self._change(field.id, ",".join(each.value for each in field.choices if each.value in chosen))
            return
        self._option = (self._option + (-1 if key == "left" else 1)) % len(field.choices)
        if field.kind == "option":
            self._change(field.id, field.choices[self._option].value)
        else:
            self._show_form()

    @on(RowView.Resized)
    def _resized(self, event: RowView.Resized) -> None:
        event.stop()
        self._show_form()

    @on(RowView.CursorMoved)
    def _clicked(self, event: RowView.CursorMoved) -> None:
        event.stop()
        self._enter(self.rows.current_id)
