"""A form as plain data: fields with their values, their choices, and the edits that change them. Pure.

The fields of a page change a study one by one (`EditField.edits`). A `Form` is filled in as a whole.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, NamedTuple, Self, TypeAlias

from rise_engine.author.edit.edits import AnyEdit
from rise_engine.scenario.diagnostics import Diagnostic
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    StyledSpan,
    TextRole,
    cell_width,
    clean,
    crop,
    fixed_span,
    line_width,
    wrap,
)

FieldKind: TypeAlias = Literal["text", "choice", "many", "fixed", "option", "ticks", "heading"]
"""`text`: typed in its row. `choice`, `many`: one or any number of `choices`, in a list that opens. `fixed`: only
shown. `option`, `ticks`: one or any number of `choices`, all of them in the form. `heading`: above other fields."""
NoteLevel: TypeAlias = Literal["error", "warning", "info"]
NOT_GIVEN = "–"
TYPED = "as it is typed"
"""The use of a value that is not among the choices."""
MakeEdits: TypeAlias = Callable[[str | None], tuple[AnyEdit, ...]]
MIN_LABEL, MAX_VALUE = 13, 24
"""Minimum cells for labels, and maximum cells for values whose notes line up."""
NOTE_MARKS: dict[NoteLevel, StyledSpan] = {"error": ("✗ ", "fault"), "warning": ("▲ ", "wait"), "info": ("", "muted")}


class FieldChoice(NamedTuple):
    """Something to choose."""

    value: str
    title: str
    help: str = ""


class FieldNote(NamedTuple):
    """A remark about a field while it is filled in."""

    level: NoteLevel
    text: str


def no_edits(text: str | None) -> tuple[AnyEdit, ...]:
    """The edits of a field that cannot be changed."""
    return ()


class EditField(NamedTuple):
    """One field of a form."""

    id: str
    label: str
    kind: FieldKind = "fixed"
    text: str | None = None
    """The value, unescaped; None: not given. `many` and `ticks` join the chosen values with commas."""
    shown: str = ""
    """Replaces `text` where this is easier to read."""
    note: str = ""
    """The text beside the value: unit, range, default."""
    choices: Sequence[FieldChoice] = ()
    question: str = ""
    """The title of the list of choices; empty: the label."""
    new: str = ""
    """The use of a value that is not among the choices; empty: it must be one of them."""
    required: bool = False
    can_be_cleared: bool = True
    """Whether the list of choices offers to remove the value."""
    reason: str = ""
    """Why the field cannot be changed here."""
    edits: MakeEdits = no_edits
    """Returns the edits that set this text; None: remove it. May raise EditRefused for a text without meaning."""
    empty: str = NOT_GIVEN
    """The text for a field without a value."""
    remarks: Sequence[FieldNote] = ()
    """Remarks about the value, the most important first."""
    is_expression: bool = False
    """Whether its choices are names for an expression, and not whole values."""

    @property
    def chosen(self) -> tuple[str, ...]:
        """The chosen values."""
        return tuple(filter(None, (self.text or "").split(",")))


@dataclass(frozen=True)
class Form:
    """A form that is filled in as a whole. It is immutable: typing makes a new one. Subclasses are dataclasses."""

    values: Mapping[str, str]
    """The values by the ids of the fields. Values of hidden fields stay until the form closes."""

    @property
    @abstractmethod
    def title(self) -> str:
        """The subject of the form."""

    @property
    @abstractmethod
    def fields(self) -> Sequence[EditField]:
        """The fields for these values, in order."""

    @abstractmethod
    def edits(self) -> tuple[AnyEdit, ...]:
        """Return the edits of the form; none if nothing was changed. The check of the study finds errors.

        :raises EditRefused: a required value is missing.
        """

    def following(self) -> Form | None:
        """The form that F5 opens after this one was carried out."""
        return None

    def value(self, field: str) -> str:
        """A value without blanks around it; empty: not given."""
        return self.values.get(field, "").strip()

    def with_value(self, field: str, value: str) -> Self:
        """The form with another value."""
        return replace(self, values={**self.values, field: value})

    def text(
        self,
        id: str,
        label: str,
        empty: str = NOT_GIVEN,
        *,
        note: str = "",
        new: str = "",
        choices: Sequence[FieldChoice] = (),
        remarks: Sequence[FieldNote] = (),
    ) -> EditField:
        """A field that is typed. F2 lists its choices."""
        value = self.values.get(id) or None
        return EditField(id, label, "text", value, note=note, choices=choices, new=new, empty=empty, remarks=remarks)

    def options(self, id: str, label: str, words: Mapping[str, str], kind: FieldKind = "option") -> EditField:
        """A field that shows all its choices, in words."""
        choices = [FieldChoice(value, title) for value, title in words.items()]
        return EditField(id, label, kind, self.values.get(id, ""), choices=choices)


def complete_name(text: str, names: Sequence[str]) -> str:
    """Return the rest of the first name that begins with the typed text. The slash of an event may be omitted."""
    begun = text.casefold()
    for name in names if text else ():
        for shown in (name, name.removeprefix("/")):
            if shown.casefold().startswith(begun):
                return shown[len(text) :]
    return ""


def info(text: str) -> list[FieldNote]:
    """A remark without a mark; none for an empty text."""
    return [FieldNote("info", text)] if text else []


def note_of(finding: Diagnostic | None) -> list[FieldNote]:
    """A diagnostic as a note."""
    return [FieldNote(finding.severity, clean(finding.message))] if finding is not None else []


def note_lines(notes: Sequence[FieldNote], width: int, most: int) -> list[StyledLine]:
    """The notes in at most `most` lines; the last line is cut."""
    lines: list[StyledLine] = []
    for note in notes:
        mark = NOTE_MARKS[note.level]
        lead = line_width((mark,))
        for number, piece in enumerate(wrap(note.text, max(10, width - lead))):
            lines.append((mark if number == 0 else (" " * lead, "plain"), (piece, mark[1])))
    if len(lines) > most:
        lines[most - 1] = crop((*lines[most - 1], (" …" + " " * width, "muted")), width)
    return lines[:most]


# --- rows -------------------------------------------------------------------------------------------------------------


class FormColumns(NamedTuple):
    """The columns of a form, so that all its rows line up."""

    value: int
    """Cells before the values."""
    note: int
    """Cells before the notes; a longer value moves its own note."""


def form_columns(fields: Sequence[EditField], width: int) -> FormColumns:
    """Columns for the longest label and value. An unusually long value moves only its own note."""
    fields = [each for each in fields if each.kind != "heading"]
    label = max((cell_width(_label(each)) for each in fields), default=0) + 1
    value = min(max(MIN_LABEL + 3, label), max(MIN_LABEL + 3, width // 3))
    values = [cell_width(_value(each)) for each in fields if each.reason or each.note]
    return FormColumns(value, value + max((each for each in values if each <= MAX_VALUE), default=0) + 2)


def field_rows(fields: Sequence[EditField], width: int, at: tuple[str, int] = ("", -1)) -> list[ListRow]:
    """A form's rows.

    :param at: id of the field with the options for the keys, and the number of the selected option.
    """
    columns = form_columns(fields, width)
    rows: list[ListRow] = []
    for each in fields:
        if each.kind == "heading":
            line: StyledLine = ((f" {clean(each.label)}", "accent"), (f"  {each.note}", "muted"))
            rows.append(ListRow("", crop(line, width), selectable=False))
            continue
        full = f"{each.label} {each.text or ''}"
        if each.kind in ("option", "ticks"):
            lines = _option_lines(each, columns, width, at[1] if at[0] == each.id else -1)
            rows.append(ListRow(each.id, lines[0], full=full))
            rows += [ListRow("", line, selectable=False) for line in lines[1:]]
        else:
            rows.append(ListRow(each.id, crop(field_line(each, columns), width), full=full))
    return rows


def field_line(field: EditField, columns: FormColumns) -> StyledLine:
    """Label, value and note, at full width."""
    off = bool(field.reason) or field.kind == "fixed"
    value = _value(field).ljust(columns.note - columns.value - 2)
    pieces: list[StyledSpan] = [
        fixed_span(_label(field), columns.value - 1, "muted" if off else "plain"), (" ", "plain"),
        (value, "muted" if off or (field.text is None and not field.shown) else "strong"),
    ]  # fmt: skip
    note = field.reason or field.note
    if note:
        pieces.append((f"  {clean(note)}", "wait" if field.reason else "muted"))
    return tuple(pieces)


def _option_lines(field: EditField, columns: FormColumns, width: int, at: int) -> list[StyledLine]:
    """All options in columns, as many side by side as fit."""
    on, signs = field.chosen, ("[ ]", "[x]") if field.kind == "ticks" else ("( )", "(•)")
    cells = max(len(each.title) for each in field.choices) + 6
    beside = max(1, min(len(field.choices), (width - columns.value) // cells))
    lines: list[StyledLine] = []
    for first in range(0, len(field.choices), beside):
        label = fixed_span(_label(field) if first == 0 else "", columns.value, "plain")
        line: list[StyledSpan] = [label]
        for index, each in enumerate(field.choices[first : first + beside], first):
            is_on = each.value in on
            role: TextRole = "key" if index == at else "plain" if is_on else "muted"
            line.append(fixed_span(f"{signs[is_on]} {each.title}", cells, role))
        lines.append(tuple(line))
    if field.note:
        lines[-1] = (*lines[-1], (f"  {field.note}", "muted"))
    return [crop(line, width) for line in lines]


def _label(field: EditField) -> str:
    return f"   {field.label}{' *' if field.required else ''}"


def _value(field: EditField) -> str:
    return clean(field.shown or (field.text if field.text is not None else field.empty)) or "“”"
