"""An act: its actions in order of start, and the form of the selected one; from 120 columns, also its file's lines."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.widget import Widget

from rise_engine.author.edit.edits import AddAction, AddVariant, RemoveAction
from rise_engine.author.edit.outline import WrittenAct, WrittenAction
from rise_engine.author.edit.plan import EditRefused
from rise_tui.editor.form import FormPage
from rise_tui.editor.model.acts import (
    act_choices,
    act_seconds,
    action_content,
    action_fields,
    action_rows,
    action_type,
    file_lines,
    new_action_parameters,
    scale_line,
)
from rise_tui.editor.model.draft import FilePlace
from rise_tui.editor.model.fields import EditField, FieldChoice
from rise_tui.editor.model.said_texts import SaidText, said_texts
from rise_tui.editor.model.study_rows import keys_by_name, setting_notes, used_lines, wrong_files
from rise_tui.editor.page import EditFrame
from rise_tui.rendering.text import StyledLine, align_at_both_ends, crop, format_seconds, line_width, quoted
from rise_tui.widgets.lines import RowList, RowView, StaticLines

TALL = 34
"""Minimum rows for showing the lines of the file."""
FILE_LINES, USED_LINES = 7, 4


class ActPage(FormPage):
    """One act."""

    KIND: ClassVar[str] = "act"
    DEFAULT_CSS = """
    ActPage #head, ActPage #parting { background: $rise-bar; }
    ActPage #actions { height: auto; max-height: 45%; min-height: 3; }
    ActPage #file { height: 13; display: none; }
    ActPage.-tall #file { display: block; }
    """

    def __init__(self, frame: EditFrame, name: str = "") -> None:
        """`name`: the act; after a zero character, the first action of the cursor."""
        act, _, action = name.partition("\0")
        super().__init__(frame, act)
        self.head, self.scale = StaticLines(id="head"), StaticLines(id="scale")
        self.actions = RowList(id="actions")
        self.parting, self.file = StaticLines(id="parting"), StaticLines(id="file")
        self._goes_to = action
        """The action that gets the cursor when it exists."""

    def compose(self) -> ComposeResult:
        yield self.head
        yield self.scale
        yield self.actions
        yield self.parting
        yield self.form
        yield self.file

    @property
    def first_focus(self) -> Widget | None:
        return self.actions

    @property
    def act(self) -> WrittenAct | None:
        return self.draft.outline.act(self.shown_name)

    @property
    def action(self) -> WrittenAction | None:
        """The action under the cursor."""
        act, id = self.act, self.actions.current_id
        return next((each for each in act.actions if each.id == id), None) if act is not None else None

    @property
    def content_exists(self) -> bool:
        return self.act is not None

    @property
    def place(self) -> FilePlace | None:
        act, action = self.act, self.action
        if act is None:
            return None
        shown = action or act
        return FilePlace(act.file, shown.line, shown.last_line)

    @property
    def hints(self) -> Mapping[str, str]:
        if self.form.rows.has_focus:
            return {"edit.open": "change", "edit.remove": "clear", "edit.other": "actions"}
        words = {"edit.open": "change", "edit.add": "add", "edit.remove": "remove"}
        return {**words, "edit.waits": "waits", "edit.wording": "wording"}

    # --- drawing ----------------------------------------------------------------------------------------------------

    def draw(self) -> None:
        act = self.act
        if act is None:
            return
        self.set_class(self.app.size.height >= TALL, "-tall")
        width = max(40, self.size.width)
        lines = frozenset(wrong_files(self.draft).get(act.file, ()))
        wrong = frozenset(action.line for action in act.actions if any(map(action.has_line, lines)))
        self.scale.show(scale_line(act, self.draft.checked, width - 1))
        self.actions.show(action_rows(act, self.draft.checked, width - 1, wrong_lines=wrong))
        if self._goes_to:
            self.actions.select(self._goes_to)
            self._goes_to = ""
        self._draw_head(act, width)
        self._draw_action()

    def _draw_head(self, act: WrittenAct, width: int) -> None:
        notes = []
        if keys := keys_by_name(self.draft).get(("act", act.name)):
            notes.append(f"key{'s' if len(keys) > 1 else ''} {' '.join(key.label for key in keys)}")
        notes += setting_notes(self.draft, act)
        notes += [f"from the template {act.template}"] if act.template else [act.reason] if act.reason else []
        left: StyledLine = ((f" {act.name}", "strong"), (f"  {' · '.join(notes)}", "muted"))
        seconds = format_seconds(act_seconds(act, self.draft.checked))
        right: StyledLine = ((f"{act.file}:{act.line}  ~{seconds} s ", "muted"),)
        self.head.show(align_at_both_ends(left, right, width))

    @on(RowView.CursorMoved)
    def _draw_action(self) -> None:
        act, action = self.act, self.action
        width = max(40, self.size.width)
        if act is None or action is None:
            self.parting.show(((" no action yet: a adds one", "muted"),))
            self.form.show([])
            return
        name = "wordings, one by chance" if action.is_variants else action_type(action)
        said = self._said()
        line: StyledLine = (
            (f" {action.id}  {name}", "accent"),
            (f"  {action.reason}" if action.reason else "", "wait"),
            (f"  says {quoted(said[0].text)}" if said else "", "plain"),
        )
        more: StyledLine = ((f"  u +{len(said) - 1} ", "key"),) if len(said) > 1 else ()
        self.parting.show((*crop(line, width - line_width(more)), *more))
        self.form.show(action_fields(act, action, self.draft.checked))
        self._draw_file(act, width)

    def _draw_file(self, act: WrittenAct, width: int) -> None:
        if self.place is None or not self.has_class("-tall"):
            return
        lines = file_lines(self.draft, self.place, width, FILE_LINES)
        head: StyledLine = ((f" THE FILE  {act.file}", "accent"),)
        used = used_lines(self.draft, "act", act.name, width)[: USED_LINES + 1]
        self.file.show(head, *(crop(line, width) for line in lines), *(crop(line, width) for line in used))

    def _said(self) -> list[SaidText]:
        """What the texts of the action under the cursor say, if that depends on the memory."""
        act, action = self.act, self.action
        if act is None or action is None:
            return []
        texts = [each for each in self.draft.checked.texts if each.act == act.name and each.action.id == action.id]
        return [said for each in texts for said in said_texts(self.draft, each)]

    # --- keys -------------------------------------------------------------------------------------------------------

    @property
    def calls(self) -> Mapping[str, Callable[[], object]]:
        on_form, act = self.form.rows.has_focus, self.act
        calls: dict[str, Callable[[], object]] = {
            "edit.add": self._ask_for_action,
            "edit.remove": self._remove,
            "edit.waits": self._ask_for_waits,
            "edit.wording": self._add_wording,
            "edit.uses": self._list_said,
        }
        if act is not None and act.reason:
            calls = dict.fromkeys(calls, lambda: self.frame.say(f"{act.name}: {act.reason}", "wait"))
        calls |= {"edit.open": lambda: self.set_form_focus(on_form=True)}
        if on_form and (why := self._why_fixed(self.form.current)):
            calls |= dict.fromkeys(self.form_calls, lambda: self.frame.say(why, "wait"))
        elif on_form:
            calls |= self.form_calls
        return {**calls, "edit.other": lambda: self.set_form_focus(on_form=not on_form)}

    def leave(self) -> bool:
        if self.form.rows.has_focus:
            self.set_form_focus(on_form=False)
            return True
        return False

    def _why_fixed(self, field: EditField | None) -> str:
        """Why a field cannot be changed here, and where it can be; empty: it can."""
        action = self.action
        if action is None or field is None:
            return ""
        why = field.reason or (action.reason if field.kind == "fixed" else "")
        return f"{field.label} cannot be changed here: {why}; e opens the file at this line" if why else ""

    def set_form_focus(self, *, on_form: bool) -> None:
        """Move the focus to the form, or to the actions."""
        if on_form and self.action is not None:
            if self.form.current is None or self.form.current.id == "type":  # the type rarely changes
                self.form.rows.move_cursor(min(1, self.form.rows.count - 1), by_wizard=False)
            self.form.say()  # the note of this field is shown below the form
            self.screen.set_focus(self.form.rows)
        else:
            self.screen.set_focus(self.actions)
        self.frame.draw_bars()

    def _ask_for_action(self) -> None:
        current = self.action

        def take(type: str) -> None:
            spec = self.draft.checked.robot.actions.get(type)
            values = new_action_parameters(spec) if spec is not None else {}
            wait_for = (current.id,) if current is not None and current.id else ()
            before = {each.id for each in self.act.actions} if self.act is not None else set()
            edit = AddAction(self.shown_name, type, values, wait_for, after=current.id if current is not None else "")
            self.make(edit, then=lambda: self._go_to_new(before))

        where = f"It begins after {current.id}; w changes that." if current is not None else ""
        self.frame.choose(f"Which action?  {where}", act_choices(self.draft.checked), take)

    def _go_to_new(self, before: set[str]) -> None:
        act = self.act
        new = next((each.id for each in act.actions if each.id not in before), "") if act is not None else ""
        if new:
            self.actions.select(new)
            self._draw_action()
            self.set_form_focus(on_form=True)
            self.form.rows.move_cursor(min(1, self.form.rows.count - 1), by_wizard=False)
            self.form.open_current(select=True)

    def _remove(self) -> None:
        if self.action is not None:
            self.make(RemoveAction(self.shown_name, self.action.id))

    def _ask_for_waits(self) -> None:
        field = self.form.field("waits")
        if why := self._why_fixed(field):
            raise EditRefused(why)
        if field is not None:
            self.form.list_choices(field)

    def _list_said(self) -> None:
        """List what the action says in each condition, in each language and for each row of a table."""
        said = self._said()
        if not said:
            raise EditRefused("it says the same in every condition: its text has no memory values")
        choices = [FieldChoice(str(number), each.text, each.where) for number, each in enumerate(said)]
        self.frame.choose("What it says, and where", choices, lambda chosen: None, enter="closes")

    def _add_wording(self) -> None:
        action = self.action
        if action is None or not action.calls or "message" not in action.calls[0].parameters:
            raise EditRefused("only texts have wordings")

        def take(text: str) -> None:
            others = {name: value.text for name, value in action.calls[0].parameters.items() if name != "message"}
            self.make(AddVariant(self.shown_name, action.id, {"message": text, **others}))

        self.frame.ask_text("Another wording", "", take, hint=f"Beside: {action_content(action)}"[:64])
