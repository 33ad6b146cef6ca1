"""Files as text, changed at characters and written as bytes: what is planned in characters becomes splices of bytes."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import SequenceMatcher
from typing import NamedTuple

from rise_engine.edit.plan import EditRefused, Files, Splice

_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


class TextEdit(NamedTuple):
    """Characters `start` to `end` of a text, and what takes their place."""

    start: int
    end: int
    text: str


class EditedText:
    """One file of a study as text."""

    def __init__(self, name: str, data: bytes, encoding: str = "utf-8") -> None:
        """:raises EditRefused: it is not in this encoding."""
        self.name = name
        self._mark = len(_BYTE_ORDER_MARK) if encoding == "utf-8" and data.startswith(_BYTE_ORDER_MARK) else 0
        self._encoding = encoding
        try:
            self.text = data[self._mark :].decode(encoding)
        except UnicodeDecodeError:
            raise EditRefused(f"{name} is not {encoding.upper()}; save it as UTF-8 first") from None
        self._is_ascii = self.text.isascii()

    def byte_offset(self, offset: int) -> int:
        """Where a character begins in the file."""
        if self._is_ascii:
            return self._mark + offset
        return self._mark + len(self.text[:offset].encode(self._encoding))

    def line(self, offset: int) -> int:
        """The number of the line of a character, from 1; as an editor counts, a lone CR ends one too."""
        before = self.text[:offset].replace("\r\n", "\n")
        return before.count("\n") + before.count("\r") + 1

    def splices(self, edits: Sequence[TextEdit]) -> tuple[Splice, ...]:
        """The same changes in bytes; those that change nothing are left out.

        :raises EditRefused: the new text has a character that the file's encoding has not.
        """
        found = []
        for edit in edits:
            if self.text[edit.start : edit.end] == edit.text:
                continue
            try:
                data = edit.text.encode(self._encoding)
            except UnicodeEncodeError as error:
                character = error.object[error.start]
                raise EditRefused(f"{self.name} is {self._encoding.upper()}, which has no `{character}`") from None
            found.append(Splice(self.name, self.byte_offset(edit.start), self.byte_offset(edit.end), data))
        return tuple(found)


def changed_text(text: str, edits: Sequence[TextEdit]) -> str:
    """A text after edits, of which no two overlap; what is put in at one place stands in their order."""
    pieces, at = [], 0
    for edit in sorted(edits, key=lambda each: (each.start, each.end)):
        pieces += [text[at : edit.start], edit.text]
        at = edit.end
    return "".join([*pieces, text[at:]])


def edits_between(before: str, after: str) -> list[TextEdit]:
    """The changes from one text to another: one for each stretch of lines that differ, and within it from the first
    character that differs to the last."""
    old, new = before.splitlines(keepends=True), after.splitlines(keepends=True)
    first = _count_common(old, new)
    last = _count_common(old[first:][::-1], new[first:][::-1])
    old_middle, new_middle = old[first : len(old) - last], new[first : len(new) - last]
    starts = [sum(map(len, old[:first]))]
    for line in old_middle:
        starts.append(starts[-1] + len(line))
    edits = []
    for kind, i, j, k, m in SequenceMatcher(None, old_middle, new_middle, autojunk=False).get_opcodes():
        if kind != "equal":
            edits.append(_trimmed(starts[i], "".join(old_middle[i:j]), "".join(new_middle[k:m])))
    return edits


def _count_common(one: Sequence[str], other: Sequence[str]) -> int:
    count = 0
    for left, right in zip(one, other, strict=False):
        if left != right:
            break
        count += 1
    return count


def _trimmed(start: int, old: str, new: str) -> TextEdit:
    head = _count_common(old, new)
    tail = _count_common(old[head:][::-1], new[head:][::-1])
    return TextEdit(start + head, start + len(old) - tail, new[head : len(new) - tail])


def file_of(files: Files, name: str) -> EditedText:
    """A file of the study. :raises EditRefused: there is none of this name, or it is not UTF-8."""
    if name not in files:
        raise EditRefused(f"there is no file {name} in this study")
    return EditedText(name, files[name])
