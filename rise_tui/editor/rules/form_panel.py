"""A form on the screen: a heading, its fields, and what it answers. It knows nothing of what it is about."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical, VerticalScroll
from textual.message import Message
from textual.widgets import Input

from rise_tui.editor.chooser import Chooser
from rise_tui.editor.model.condition_reading import FieldNote
from rise_tui.editor.model.fields import FieldChoice
from rise_tui.editor.model.form import RuleForm
from rise_tui.editor.rules.form_fields import FieldControl, FieldRow, WrittenField
from rise_tui.rendering.later import Later
from rise_tui.rendering.text import crop
from rise_tui.widgets.static_lines import StaticLines

KEEPS_TEXT = ("condition", "held", "value")
"""Fields into which a chosen name is put at the end of what is typed."""


class FormPanel(Vertical, can_focus=True):
    """Enter does what the form says, esc leaves everything as it was."""

    DEFAULT_CSS = """
    FormPanel { height: auto; max-height: 70%; display: none; }
    FormPanel.-open { display: block; }
    FormPanel #form-fields { height: auto; }
    FormPanel #form-answer { height: 1; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "leave", show=False),
        Binding("enter", "finish", show=False),
        Binding("f5", "extra", show=False),
    ]

    @dataclass
    class Finished(Message):
        """Enter: it is to become true."""

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
        self.rows: list[FieldRow] = []
        self._visited: set[str] = set()
        """Fields that were typed in, or left. Only then is it wrong that one of something new is empty."""
        self.is_opening = False
        """Whether its fields are just being made."""
        self.is_waiting = False
        """Whether what the form says is just being made: a second enter must not make it again."""
        self.heading, self.answer = StaticLines(id="form-heading"), StaticLines(id="form-answer")
        self.body = VerticalScroll(id="form-fields")
        self.body.can_focus = False

    @property
    def is_open(self) -> bool:
        return self.has_class("-open")

    def compose(self) -> ComposeResult:
        yield self.heading
        yield self.body
        yield self.answer

    def open(self, form: RuleForm, focus: str = "") -> None:
        """Show a form, and put the cursor into a field (else its first that is written).

        The keys go to the panel at once, so that none is taken for a command; `is_opening` says that they must wait.
        """
        self.form, self.is_waiting, self.is_opening = form, False, True
        self._visited = set()
        self.add_class("-open")
        self.screen.set_focus(self)
        self.say("")
        self.run_worker(Later(self._fill, focus), group="form", exclusive=True)

    async def _fill(self, focus: str) -> None:
        """Make the fields, and go into one."""
        try:
            await self._make_rows(0)
            self._show_heading()
            rows = self.rows
            chosen = next((row for row in rows if row.field.name == focus), None)
            chosen = chosen or next((row for row in rows if row.field.kind == "text"), rows[0])
            self.screen.set_focus(chosen.control)
        finally:
            self.is_opening = False

    def close(self) -> None:
        self.form = None
        self.remove_class("-open")

    def say(self, sentence: str) -> None:
        """What is in the way, in the line below the fields."""
        self.answer.show(((f" ✗ {sentence}", "fault"),) if sentence else ())

    async def _make_rows(self, kept: int) -> None:
        """The rows of the form, of which the first `kept` are there already."""
        form = self.form
        assert form is not None
        old, new = self.rows[kept:], [FieldRow(field, self._ending_of(field.name)) for field in form.fields[kept:]]
        self.rows = [*self.rows[:kept], *new]
        with self.app.batch_update():
            for row in old:
                await row.remove()
            await self.body.mount(*new)
            self._update_rows()

    def _update_rows(self) -> None:
        form = self.form
        assert form is not None
        notes = form.notes()
        for row, field in zip(self.rows, form.fields, strict=True):
            found = notes.get(field.name, [])
            if form.is_new and not field.value.strip() and field.name not in self._visited:
                found = [FieldNote("info", note.text) for note in found]
            row.update_row(field, found)

    def _ending_of(self, field: str):  # type: ignore[no-untyped-def]
        return lambda text: self.form.ending(field, text) if self.form is not None else ""

    def _show_heading(self) -> None:
        width = self.size.width or self.app.size.width
        title = f"── {self.form.title} " if self.form is not None else ""
        self.heading.show(crop(((title, "accent"), ("─" * max(0, width - len(title)), "muted")), max(1, width)))

    def on_resize(self) -> None:
        self._show_heading()

    @on(FieldControl.ChangeField)
    async def _change_field(self, event: FieldControl.ChangeField) -> None:
        event.stop()
        form = self.form
        if form is None or all(row.field.name != event.field for row in self.rows):
            return
        self.form, self.is_waiting = form.with_value(event.field, event.value), False
        self._visited.add(event.field)
        self.say("")
        before = [row.field.name for row in self.rows]
        after = [field.name for field in self.form.fields]
        if before == after:
            self._update_rows()
            return
        kept = next(
            (at for at, (old, new) in enumerate(zip(before, after, strict=False)) if old != new),
            min(len(before), len(after)),
        )
        await self._make_rows(kept)

    @on(FieldControl.GoOn)
    def _go_on(self, event: FieldControl.GoOn) -> None:
        """The fields are a ring: nothing but esc and enter leads out of the form."""
        event.stop()
        rows = self.rows
        at = next((index for index, row in enumerate(rows) if row.is_focused), 0)
        self._visited.add(rows[at].field.name)
        self._update_rows()
        rows[(at + event.step) % len(rows)].control.focus()

    @on(FieldControl.ListNames)
    def _list_names(self, event: FieldControl.ListNames) -> None:
        event.stop()
        row = next((row for row in self.rows if row.field.name == event.field), None)
        choices = self.form.choices(event.field) if self.form is not None else []
        if row is None or not choices:
            return
        control = row.control
        assert isinstance(control, WrittenField)

        def take(name: str | None) -> None:
            if not name:
                return
            if event.field in KEEPS_TEXT:
                text = control.value
                control.put(f"{text}{'' if not text or text[-1] in ' ([' else ' '}{name}")
            else:
                control.put(name)

        shown = [FieldChoice(choice.name, choice.name, choice.note) for choice in choices]
        chooser = Chooser(row.field.label, shown, now=control.value.strip(), new=row.field.new)
        self.app.push_screen(chooser, take)

    @on(Input.Submitted)
    def _submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self.action_finish()

    def action_finish(self) -> None:
        if self.form is None:
            return
        if problem := self.form.missing():
            self._visited |= {row.field.name for row in self.rows}
            self._update_rows()
            self.say(problem)
        elif not self.is_waiting:
            self.is_waiting = True
            self.post_message(self.Finished(self.form))

    def action_leave(self) -> None:
        self.post_message(self.FormLeft())

    def action_extra(self) -> None:
        if self.form is not None:
            self.post_message(self.ExtraAsked(self.form))
