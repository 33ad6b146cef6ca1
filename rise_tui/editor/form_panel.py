"""A form that is filled in as a whole."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from textual import on
from textual.app import ComposeResult

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import EditRefused
from rise_tui.editor.form import TAKES, FieldList
from rise_tui.editor.model.fields import EditField, FieldNote, Form, info
from rise_tui.editor.page import EditPage
from rise_tui.rendering.text import crop
from rise_tui.widgets.lines import RowView, StaticLines


class FormPanel(FieldList):
    """Shows a form (`open`). The field under the cursor is always open; Enter carries the form out, Esc leaves it."""

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
        """What would be newly wrong with the study."""

    def compose(self) -> ComposeResult:
        yield self.heading
        yield from super().compose()

    @property
    def is_open(self) -> bool:
        return self.form is not None

    def open(self, form: Form, focus: str, closed: Callable[[Form | None], None]) -> None:
        """Show a form with the cursor in field `focus`, or else in the first text field.

        :param closed: receives the form when it was carried out; None if the author has left it.
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

    def _say_found(self, *notes: FieldNote) -> None:
        self._found = notes
        self._draw_said()

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
        self._page.preview(self._edits_so_far, self._say_found)

    def _edits_so_far(self) -> tuple[AnyEdit, ...]:
        """The edits of the form; none while it is incomplete, because that is not wrong yet."""
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
        elif key in TAKES:  # the fields are a ring: only Esc and Enter leave the form
            ids = list(self._fields)
            self._enter(ids[(ids.index(field.id) + TAKES[key]) % len(ids)])
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
        """Carry the form out, if nothing is missing."""
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
