"""The files of a study as texts: what is planned in one becomes splices of it."""

from __future__ import annotations

from collections.abc import Iterable

from rise_engine.author.edit.plan import Files
from rise_engine.syntax.changes import EditRefused, Splice, TextEdit


class EditedText:
    """One file of a study as text."""

    def __init__(self, name: str, data: bytes, encoding: str = "utf-8") -> None:
        """:raises EditRefused: it is not in this encoding."""
        self.name = name
        try:
            self.text = data.decode("utf-8-sig" if encoding == "utf-8" else encoding)
        except UnicodeDecodeError:
            raise EditRefused(f"{name} is not {encoding.upper()}; save it as UTF-8 first") from None

    def line(self, offset: int) -> int:
        """The number of the line of a character, from 1; as an editor counts, a lone CR ends one too."""
        before = self.text[:offset].replace("\r\n", "\n")
        return before.count("\n") + before.count("\r") + 1

    def splices(self, edits: Iterable[TextEdit]) -> tuple[Splice, ...]:
        """The same changes with the file's name; those that change nothing are left out."""
        return tuple(Splice(self.name, *edit) for edit in edits if self.text[edit.start : edit.end] != edit.text)


def file_of(files: Files, name: str) -> EditedText:
    """A file of the study. :raises EditRefused: there is none of this name, or it is not UTF-8."""
    if name not in files:
        raise EditRefused(f"there is no file {name} in this study")
    return EditedText(name, files[name])
