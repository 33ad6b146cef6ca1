"""The lines of a file around a place, with what differs from what is saved."""

from __future__ import annotations

from difflib import SequenceMatcher

from rise_tui.editor.model.draft import FilePlace, StudyDraft
from rise_tui.rendering.text import StyledLine, TextRole, clean, crop

MOST_COMPARED = 4_000
"""Lines; longer files show no differences, which would take too long to find for each key."""


def file_lines(draft: StudyDraft, place: FilePlace, width: int, most: int) -> list[StyledLine]:
    """At most `most` lines: those of the place; `+` and `-` before what differs from what is saved."""
    now = _lines(draft.files.get(place.file, b""))
    was = _lines(draft.saved.get(place.file, b""))
    first, last = max(0, place.line - 1), min(len(now), place.end)
    marked: list[tuple[int, str, str]] = []
    if now == was or max(len(now), len(was)) > MOST_COMPARED:
        marked = [(number + 1, " ", now[number]) for number in range(first, last)]
    else:
        for tag, i1, i2, j1, j2 in SequenceMatcher(None, was, now, autojunk=False).get_opcodes():
            near = j2 >= first and j1 <= last
            if tag != "equal" and near:
                marked += [(i + 1, "-", was[i]) for i in range(i1, i2)]
            sign = " " if tag == "equal" else "+"
            marked += [(j + 1, sign, now[j]) for j in range(j1, j2) if first <= j < last]
    changed = next((at for at, (_, sign, _) in enumerate(marked) if sign != " "), 0)
    begin = max(0, min(changed - most // 2, len(marked) - most))
    lines: list[StyledLine] = []
    for number, sign, text in marked[begin : begin + most]:
        role: TextRole = "strong" if sign == "+" else "muted" if sign == "-" else "plain"
        lines.append(crop(((f" {number:>4}{sign}", "muted"), ("| ", "muted"), (clean(text), role)), width))
    return lines


def _lines(data: bytes) -> list[str]:
    return data.decode("utf-8", "replace").expandtabs(4).splitlines()
