"""The fields of a form: written, chosen, ticked. Each is one stop for the tab key."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from textual import events, on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal, Vertical
from textual.message import Message
from textual.suggester import Suggester
from textual.widgets import Input

from rise_tui.editor.model.condition_reading import FieldNote, NoteLevel
from rise_tui.editor.model.form import RuleField
from rise_tui.rendering.text import StyledLine, StyledSpan, TextRole, crop, line_width, wrap
from rise_tui.widgets.prompt_bar import TextField
from rise_tui.widgets.static_lines import StaticLines

LABEL_WIDTH = 16
"""Cells of a field's name, with the blanks around it."""
NOTE_MARKS: dict[NoteLevel, StyledSpan] = {"error": ("✗ ", "fault"), "warning": ("▲ ", "wait"), "info": ("", "muted")}
NOTE_ROLES: dict[NoteLevel, TextRole] = {"error": "fault", "warning": "wait", "info": "muted"}


def note_lines(notes: list[FieldNote], width: int, rows: int) -> list[StyledLine]:
    """The notes over as many lines as there are, the last one cut off."""
    lines: list[StyledLine] = []
    for note in notes:
        mark, role = NOTE_MARKS[note.level], NOTE_ROLES[note.level]
        lead = line_width((mark,))
        for number, piece in enumerate(wrap(note.text, max(10, width - lead))):
            lines.append((mark if number == 0 else (" " * lead, "plain"), (piece, role)))
    if len(lines) > rows:
        lines[rows - 1] = crop((*lines[rows - 1], (" …" + " " * width, "muted")), width)
    return lines[:rows]


class EndingSuggester(Suggester):
    """Shows behind what is typed how it may go on; → takes it."""

    def __init__(self, ending: Callable[[str], str]) -> None:
        super().__init__(use_cache=False, case_sensitive=True)
        self._ending = ending

    async def get_suggestion(self, value: str) -> str | None:
        ending = self._ending(value)
        return value + ending if ending else None


class FieldControl:
    """What a field asks of its form."""

    @dataclass
    class ChangeField(Message):
        """Another value."""

        field: str
        value: str

    @dataclass
    class GoOn(Message):
        """To the next field, or the one before."""

        step: int

    @dataclass
    class ListNames(Message):
        """Show the names that can be chosen."""

        field: str


class WrittenField(TextField):
    """A field that is written."""

    DEFAULT_CSS = """
    WrittenField, WrittenField:focus { width: 1fr; background: $surface; }
    WrittenField:focus { background: $rise-cursor; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("f2", "list", show=False),
        Binding("tab,down", "go_on(1)", show=False),
        Binding("shift+tab,up", "go_on(-1)", show=False),
    ]

    def __init__(self, field: RuleField, ending: Callable[[str], str]) -> None:
        super().__init__(
            field.value, placeholder=field.placeholder, select_on_focus=False, suggester=EndingSuggester(ending)
        )
        self.field_name = field.name

    def action_go_on(self, step: int) -> None:
        self.post_message(FieldControl.GoOn(step))

    def action_list(self) -> None:
        self.post_message(FieldControl.ListNames(self.field_name))

    def put(self, text: str) -> None:
        """Other text, with the cursor behind it."""
        self.value = text
        self.cursor_position = len(text)

    @on(Input.Changed)
    def _input_changed(self, event: Input.Changed) -> None:
        event.stop()
        self.post_message(FieldControl.ChangeField(self.field_name, self.value))


class OptionField(StaticLines, can_focus=True):
    """One of a few words, or any of them: left and right go from one to the next; a blank ticks."""

    DEFAULT_CSS = """
    OptionField { width: 1fr; }
    """
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left", "step(-1)", show=False),
        Binding("right", "step(1)", show=False),
        Binding("space", "tick", show=False),
        Binding("tab,down", "go_on(1)", show=False),
        Binding("shift+tab,up", "go_on(-1)", show=False),
    ]

    def __init__(self, field: RuleField) -> None:
        super().__init__()
        self._field = field
        self.field_name = field.name
        self._at = 0
        if field.kind == "choice":
            self._at = next((index for index, (word, _) in enumerate(field.options) if word == field.value), 0)

    def update_field(self, field: RuleField) -> None:
        """The same field with another value."""
        self._field = field
        self.draw()

    @property
    def _ticked(self) -> list[str]:
        return self._field.value.split() if self._field.kind == "ticks" else [self._field.options[self._at][0]]

    def draw(self) -> None:
        width = self.size.width
        if width <= 0:
            return
        lines = option_lines(self._field, self._ticked, self._at if self.has_focus else -1, width)
        self.styles.height = len(lines)
        self.show(*lines)

    def action_go_on(self, step: int) -> None:
        self.post_message(FieldControl.GoOn(step))

    def action_step(self, step: int) -> None:
        count = len(self._field.options)
        self._at = (self._at + step) % count
        if self._field.kind == "choice":
            self._change(self._field.options[self._at][0])
        self.draw()

    def action_tick(self) -> None:
        word = self._field.options[self._at][0]
        if self._field.kind == "choice":
            self.action_step(1)
            return
        ticked = {*self._ticked} ^ {word}
        self._change(" ".join(each for each, _ in self._field.options if each in ticked))

    def _change(self, value: str) -> None:
        self._field = self._field._replace(value=value)
        self.draw()
        self.post_message(FieldControl.ChangeField(self.field_name, value))

    def on_resize(self, event: events.Resize) -> None:
        self.draw()

    def on_focus(self) -> None:
        self.draw()

    def on_blur(self) -> None:
        self.draw()


def option_lines(field: RuleField, ticked: list[str], at: int, width: int) -> list[StyledLine]:
    """The words, as many beside each other as there is room for, all columns alike.

    :param at: the one that the keys are at; -1: they are elsewhere.
    """
    cells = max(len(label) for _, label in field.options) + 6
    columns = max(1, min(len(field.options), width // cells))
    lines: list[StyledLine] = []
    spans: list[StyledSpan] = []
    for index, (word, label) in enumerate(field.options):
        on = word in ticked
        mark = ("[x]" if on else "[ ]") if field.kind == "ticks" else "(•)" if on else "( )"
        role: TextRole = "key" if index == at else "plain" if on else "muted"
        text = f"{mark} {label}"
        spans.append((text, role))
        if (index + 1) % columns == 0:
            lines.append(tuple(spans))
            spans = []
        else:
            spans.append((" " * (cells - len(text)), "plain"))
    if spans:
        lines.append(tuple(spans))
    if field.behind:
        lines[-1] = crop((*lines[-1], (f"  {field.behind}", "muted")), width)
    return lines


class FieldRow(Vertical):
    """A field with its name before it; below it, while it has the focus, what is to be said about it."""

    DEFAULT_CSS = """
    FieldRow { height: auto; }
    FieldRow .line { height: auto; }
    FieldRow .label { width: 16; }
    FieldRow .mark { width: 2; }
    FieldRow .behind { width: auto; }
    FieldRow .notes { height: 0; margin: 0 0 0 18; }
    """

    def __init__(self, field: RuleField, ending: Callable[[str], str]) -> None:
        super().__init__()
        self.field = field
        self._notes: list[FieldNote] = []
        self._label, self._mark = StaticLines(), StaticLines()
        self._behind, self._below = StaticLines(), StaticLines()
        self.control: WrittenField | OptionField = (
            WrittenField(field, ending) if field.kind == "text" else OptionField(field)
        )

    def compose(self) -> ComposeResult:
        self._label.add_class("label")
        self._mark.add_class("mark")
        self._below.add_class("notes")
        with Horizontal(classes="line"):
            yield self._label
            yield self._mark
            yield self.control
            if self.field.kind == "text" and self.field.behind:
                self._behind.styles.width = len(self.field.behind) + 2
                yield self._behind
        yield self._below

    def on_mount(self) -> None:
        self.draw()

    @property
    def is_focused(self) -> bool:
        return self.control.has_focus

    def update_row(self, field: RuleField, notes: list[FieldNote]) -> None:
        """The same field with what has become of it; what is typed is left alone."""
        self.field, self._notes = field, notes
        if isinstance(self.control, OptionField):
            self.control.update_field(field)
        self.draw()

    def draw(self) -> None:
        """Its name, its mark, and its notes while it has the focus."""
        focused = self.is_focused
        role: TextRole = "accent" if focused else "plain"
        self._label.show(((f"   {self.field.label}", role),))
        levels = [note.level for note in self._notes]
        worst: NoteLevel = "error" if "error" in levels else "warning" if "warning" in levels else "info"
        self._mark.show((NOTE_MARKS[worst],))
        self._behind.show(((f" {self.field.behind}", "muted"),))
        rows = self.field.notes if focused and self.field.kind == "text" else 0
        self._below.styles.height = rows
        width = self.size.width - LABEL_WIDTH - 2
        if rows and width > 0:
            lines = note_lines(self._notes, width, rows)
            if not lines and self.field.has_list:
                lines = [(("F2 lists what there is", "muted"),)]
            self._below.show(*lines)
        else:
            self._below.show()

    def on_descendant_focus(self) -> None:
        self.draw()

    def on_descendant_blur(self) -> None:
        self.draw()

    def on_resize(self) -> None:
        self.draw()
