"""A form that is filled in as a whole."""

from __future__ import annotations

from dataclasses import dataclass

from textual import on
from textual.app import ComposeResult
from textual.message import Message

from rise_tui.editor.form import TAKES, FieldList, Step
from rise_tui.editor.model.fields import (
    EditField,
    FieldNote,
    RuleForm,
    ticked,
)
from rise_tui.editor.pick_list import Picked, PickList
from rise_tui.rendering.text import crop
from rise_tui.widgets.row_list import RowView
from rise_tui.widgets.static_lines import StaticLines

KEEPS_TEXT = ("condition", "held", "value")
"""Fields that keep what is typed before a chosen name."""


class FormPanel(FieldList):
    """A form that is filled in as a whole. The field under the cursor is open; Enter carries the form out."""

    DEFAULT_CSS = """
    FormPanel { height: auto; max-height: 70%; display: none; }
    FormPanel.-open { display: block; }
    FormPanel #said { height: 3; }
    """
    above = 1

    @dataclass
    class Finished(Message):
        """Enter: carry the form out."""

        form: RuleForm

    @dataclass
    class FormChanged(Message):
        """A value of the form has changed."""

        form: RuleForm

    class FormLeft(Message):
        """Esc: change nothing."""

    @dataclass
    class ExtraAsked(Message):
        """F5: add something to the form, such as a key for an event."""

        form: RuleForm

    def __init__(self) -> None:
        super().__init__(id="form")
        self.form: RuleForm | None = None
        self.is_waiting = False
        """Whether the form is being carried out: a second Enter must not repeat it."""
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
        """Show a form with the cursor in field `focus`, or else in the first text field."""
        self.form, self.is_waiting, self._finding, self._problem = form, False, [], ""
        self._typing = None
        self.add_class("-open")
        first = next((each.id for each in form.fields if each.kind == "text"), form.fields[0].id)
        self._show_form()
        self._enter(focus or first)

    def close_form(self) -> None:
        """Close the form."""
        self.form, self._typing = None, None
        self.input.display = False
        self.remove_class("-open")

    def say_finding(self, *found: FieldNote) -> None:
        """Show what the check says about the study with this form's change."""
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
        """Put the cursor on a field. A text opens immediately; among options the cursor is on the chosen one."""
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
            if field.kind == "text" and field.note:
                notes = [*notes, FieldNote("info", field.note)]
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
        """Go to another field. The fields are a ring: only Esc and Enter leave the form."""
        ids = list(self._fields)
        self._enter(ids[(ids.index(self.rows.current_id) + step) % len(ids)])

    def _choose_option(self, field: EditField, key: str) -> None:
        """Move among the options, which are a ring. In a field of ticks, space ticks or unticks one."""
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
