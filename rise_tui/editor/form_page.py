"""A page with a form: what its fields ask for is made, and what would be wrong is said while it is typed."""

from __future__ import annotations

import asyncio

from textual import on

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.author.edit.plan import EditRefused
from rise_engine.base.text import clean
from rise_tui.editor.field_list import FieldList
from rise_tui.editor.model.draft import first_new_finding
from rise_tui.editor.model.fields import EditField, FieldChoice
from rise_tui.editor.page import EditFrame, EditPage
from rise_tui.rendering.later import Later

PAINTED = 0.02
"""Seconds until a letter has been painted: a check beside it, in another thread, would hold it up."""


class FormPage(EditPage):
    """Holds `form`; the page says what fields are in it, and where it stands."""

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
        """Take away what the field under the cursor stands for, where that is more than its text."""
        return False

    def _edits(self, field: EditField, text: str | None) -> tuple[AnyEdit, ...]:
        return field.edits(text)

    @on(FieldList.SetField)
    def _set(self, event: FieldList.SetField) -> None:
        event.stop()
        self._take(event.field, event.text)

    def _take(self, field: EditField, text: str | None) -> None:
        try:
            edits = self._edits(field, text)
        except EditRefused as refused:
            self.form.say(str(refused), is_error=True)
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
        new = "as it is typed" if field.is_free else ""
        self.frame.choose(field.label, choices, lambda chosen: self._take(field, chosen or None),
                          now=field.text or "", new=new)  # fmt: skip

    @on(FieldList.FieldTyped)
    def _typed(self, event: FieldList.FieldTyped) -> None:
        event.stop()
        self.run_worker(Later(self._preview, event.field, event.text), group="preview", exclusive=True)

    async def _preview(self, field: EditField, text: str) -> None:
        """Say what would be wrong with the files then that is not wrong now, once the letter itself is shown."""
        await asyncio.sleep(PAINTED)
        try:
            edits = self._edits(field, text or None)
            if not edits:
                return
            checked = await self.frame.study.preview(*edits)
        except EditRefused as refused:
            self.form.say(clean(str(refused)), is_error=True)
            return
        first = first_new_finding(self.draft, checked)
        if not self.is_typing:
            return
        self.form.say(clean(first.message) if first is not None else "",
                      is_error=first is not None and first.severity == "error")  # fmt: skip
