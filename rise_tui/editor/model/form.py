"""Forms as values: their fields, what is said about each, and the edits that make them true. Pure.

A form is immutable: what is typed gives another one. One widget shows all of them (`rise_tui/editor/rules/`).
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Literal, NamedTuple, TypeAlias

from rise_engine.author.edit.edits import AnyEdit
from rise_tui.editor.model.condition_reading import FieldNote
from rise_tui.editor.model.study_names import NameChoice

FieldKind: TypeAlias = Literal["text", "choice", "ticks"]


class RuleField(NamedTuple):
    """One field, as it is shown."""

    name: str
    label: str
    value: str
    """Of a choice, the word that is chosen; of ticks, those that are ticked, with blanks between."""
    kind: FieldKind = "text"
    options: tuple[tuple[str, str], ...] = ()
    """Of a choice and of ticks: each word, and what is shown for it."""
    behind: str = ""
    """What stands behind the field, muted."""
    placeholder: str = ""
    notes: int = 1
    """Lines kept below it while it has the focus."""
    has_list: bool = False
    """Whether names can be chosen for it (F2)."""
    new: str = ""
    """What a name is called that is none of them and may be made; empty: it may not."""


class RuleForm:
    """A form. Subclasses are dataclasses."""

    title: str

    @property
    def is_new(self) -> bool:
        """Whether what it is about is only being made: then an empty field is not wrong before it was filled in."""
        return False

    @property
    @abstractmethod
    def fields(self) -> tuple[RuleField, ...]:
        """The fields, in their order."""

    @abstractmethod
    def with_value(self, field: str, value: str) -> RuleForm:
        """The form with another value."""

    @abstractmethod
    def notes(self) -> dict[str, list[FieldNote]]:
        """What is to be said about each field, the most important first."""

    @abstractmethod
    def edits(self) -> tuple[AnyEdit, ...]:
        """What makes it true; nothing when nothing was changed."""

    def choices(self, field: str) -> list[NameChoice]:
        """What can be chosen for a field."""
        return []

    def ending(self, field: str, text: str) -> str:
        """What could be added at the end of what is typed; empty: nothing is sure."""
        return complete_name(text, self.choices(field))

    def missing(self) -> str:
        """Why it cannot be done like this, not even as a draft; empty: it can."""
        return ""


def complete_name(text: str, choices: list[NameChoice]) -> str:
    """The rest of the first name that begins with what is typed."""
    begun = text.casefold()
    found = next((each.name for each in choices if begun and each.name.casefold().startswith(begun)), "")
    return found[len(text) :]
