"""Changes of texts: ranges of characters and their replacements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from difflib import SequenceMatcher
from typing import NamedTuple

from rise_engine.base.errors import RiseError


class EditRefused(RiseError, ValueError):
    """An edit cannot be made; the message has the reason and a remedy, for a person."""


class TextEdit(NamedTuple):
    """Characters `start` to `end` of a text, and their replacement."""

    start: int
    end: int
    text: str


class Splice(NamedTuple):
    """Characters `start` to `end` of a file's text (without byte order mark), and their replacement."""

    file: str
    start: int
    end: int
    text: str


def changed_text(text: str, edits: Iterable[TextEdit | Splice]) -> str:
    """Apply edits to a text. Insertions at the same place keep their order.

    :raises ValueError: edits overlap or are outside the text, which is an error of the caller.
    """
    pieces, at = [], 0
    for edit in sorted(edits, key=lambda each: (each.start, each.end)):
        if not at <= edit.start <= edit.end <= len(text):
            raise ValueError(f"characters {edit.start} to {edit.end} cannot be replaced")
        pieces += [text[at : edit.start], edit.text]
        at = edit.end
    return "".join([*pieces, text[at:]])


def edits_between(before: str, after: str) -> list[TextEdit]:
    """The edits that turn one text into another: one for each range of lines that differ, from its first to its last
    different character."""
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
