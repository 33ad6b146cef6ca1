"""A form as plain data: fields with what stands in them, what can stand there, and the edits that change it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple, TypeAlias

from rise_engine.edit.edits import AnyEdit
from rise_tui.rendering.text import ListRow, StyledLine, StyledSpan, clean, crop, fixed_span

FieldKind: TypeAlias = Literal["text", "choice", "many", "fixed"]
"""Typed in its place; one of `choices`; any number of them; only shown."""
NOT_GIVEN = "–"
MakeEdits: TypeAlias = Callable[[str | None], tuple[AnyEdit, ...]]
LABEL_WIDTH = 13
LABEL_WIDTH_WIDE = 20


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


def label_width(width: int) -> int:
    """Cells before the values of a form."""
    return LABEL_WIDTH if width < 90 else LABEL_WIDTH_WIDE


def field_rows(fields: Sequence[EditField], width: int) -> list[ListRow]:
    """A form's rows."""
    return [ListRow(each.id, field_line(each, width), full=f"{each.label} {each.text or ''}") for each in fields]


def field_line(field: EditField, width: int) -> StyledLine:
    """Label, value and note."""
    off = bool(field.reason) or field.kind == "fixed"
    label = f"   {field.label}{' *' if field.required else ''}"
    value = clean(field.shown or (field.text if field.text is not None else NOT_GIVEN))
    value = value or "“”"
    pieces: list[StyledSpan] = [fixed_span(label, label_width(width) + 2, "muted" if off else "plain"), (" ", "plain")]
    pieces.append((value, "muted" if off or (field.text is None and not field.shown) else "strong"))
    note = field.reason or field.note
    if note:
        pieces.append((f"  {clean(note)}", "wait" if field.reason else "muted"))
    return crop(tuple(pieces), width)
