"""A table of texts as somebody gives it back, whatever kind of file it was."""

from __future__ import annotations

from msgspec import Struct


class ReadRow(Struct, frozen=True):
    """A row."""

    line: int
    """Its number in the file, for sentences."""
    values: dict[str, str]
    """By column."""
    confirmed: frozenset[str] = frozenset()
    """Languages in which somebody has said that the translation is right as it is (gettext: it is not fuzzy)."""


class ReadTable(Struct, frozen=True):
    columns: tuple[str, ...]
    rows: tuple[ReadRow, ...]
    what: str = "row"
    """What a row is called in sentences."""
