"""A form as plain data: fields with what stands in them, what can stand there, and the edits that change it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple, TypeAlias

from rise_engine.author.edit.edits import AnyEdit
from rise_tui.rendering.text import ListRow, StyledLine, StyledSpan, cell_width, clean, crop, fixed_span

FieldKind: TypeAlias = Literal["text", "choice", "many", "fixed"]
"""Typed in its place; one of `choices`; any number of them; only shown."""
NOT_GIVEN = "–"
MakeEdits: TypeAlias = Callable[[str | None], tuple[AnyEdit, ...]]
LEAST_LABEL, MOST_VALUE = 13, 24
"""Cells of the labels, at least, and of values behind which the notes stand below each other, at most."""


class FieldChoice(NamedTuple):
    """Something that can be chosen."""

    value: str
    title: str
    help: str = ""


def no_edits(text: str | None) -> tuple[AnyEdit, ...]:
    """Of a field that cannot be changed."""
    return ()


class EditField(NamedTuple):
    """One row of a form."""

    id: str
    label: str
    kind: FieldKind = "fixed"
    text: str | None = None
    """What stands there, unescaped; None: nothing is given. Of `many`, the chosen values joined by commas."""
    shown: str = ""
    """Instead of `text`, where that reads better."""
    note: str = ""
    """What is beside it: unit, range, what holds when nothing is given."""
    choices: Sequence[FieldChoice] = ()
    is_free: bool = False
    """Whether something else than a choice may be typed."""
    required: bool = False
    reason: str = ""
    """Why it cannot be changed here."""
    edits: MakeEdits = no_edits
    """What makes it this text; None: takes it away. May raise EditRefused for a text that cannot be meant."""


class FormColumns(NamedTuple):
    """Where what stands in a form, so that all its rows line up."""

    value: int
    """Cells before the values."""
    note: int
    """Cells before the notes of values that are not longer."""


def form_columns(fields: Sequence[EditField], width: int) -> FormColumns:
    """As wide as the longest label and value; one that is longer than most pushes its own note away, not all."""
    label = max((cell_width(_label(each)) for each in fields), default=0) + 1
    value = min(max(LEAST_LABEL + 3, label), max(LEAST_LABEL + 3, width // 3))
    values = [cell_width(_value(each)) for each in fields if each.reason or each.note]
    return FormColumns(value, value + max((each for each in values if each <= MOST_VALUE), default=0) + 2)


def field_rows(fields: Sequence[EditField], width: int) -> list[ListRow]:
    """A form's rows."""
    columns = form_columns(fields, width)
    return [
        ListRow(each.id, crop(field_line(each, columns), width), full=f"{each.label} {each.text or ''}")
        for each in fields
    ]


def field_line(field: EditField, columns: FormColumns) -> StyledLine:
    """Label, value and note, however wide that is."""
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


def _label(field: EditField) -> str:
    return f"   {field.label}{' *' if field.required else ''}"


def _value(field: EditField) -> str:
    return clean(field.shown or (field.text if field.text is not None else NOT_GIVEN)) or "“”"
