"""What git has left in a file that it could not join, as rows: both versions of each place, to choose from."""

from __future__ import annotations

import re

from rise_engine.edit.conflicts import conflicts_of
from rise_engine.scenario.merge_conflicts import Keep, MergeConflict
from rise_tui.editing.model.draft import FilePlace, StudyDraft, count
from rise_tui.rendering.text import ListRow, TextRole, clean, crop, wrap

MOST_LINES = 12
"""Lines of one version that are shown."""
_OPENING = re.compile(
    r"<(Dialog|InteractionRule|State)\b[^>]*?\b(?:name|id)\s*=\s*[\"']([^\"']*)|</(Dialog|InteractionRule)"
)
_WORDS = {"Dialog": "the act", "InteractionRule": "the rule", "State": "state"}


def conflict_rows(draft: StudyDraft, file: str, width: int) -> list[ListRow]:
    """For each place both versions, each under a row that chooses it; and one that keeps both."""
    text, conflicts = conflicts_of(file, draft.files.get(file, b""))
    rows: list[ListRow] = []

    def add(line: str, role: TextRole, id: str = "") -> None:
        rows.append(ListRow(id, crop(((line, role),), width), selectable=bool(id)))

    for number, each in enumerate(conflicts):
        where = place_in_words(text.text, each)
        add(f" {number + 1} of {len(conflicts)}: line {text.line(each.start)}{where}", "accent")
        for keep, title in _titles(each):
            add(f"   {title}", "strong", conflict_id(number, keep))
            if keep != "both":
                lines = text.text[slice(*(each.yours if keep == "yours" else each.theirs))].splitlines()
                for line in lines[:MOST_LINES] or ["(nothing)"]:
                    for piece in wrap(clean(line.expandtabs(2)).strip(), max(20, width - 8)) or [""]:
                        add(f"     │ {piece}", "plain" if lines else "muted")
                if len(lines) > MOST_LINES:
                    add(f"     │ … {count(len(lines) - MOST_LINES, 'more line')}: e opens the file", "muted")
    return rows


def _titles(conflict: MergeConflict) -> tuple[tuple[Keep, str], ...]:
    yours = f" ({clean(conflict.your_name)})" if conflict.your_name else ""
    theirs = f" ({clean(conflict.their_name)})" if conflict.their_name else ""
    return (
        ("yours", f"keep yours{yours}:"),
        ("theirs", f"take the other's{theirs}:"),
        ("both", "keep both, yours and then the other's"),
    )


def conflict_id(number: int, keep: Keep) -> str:
    """Of a row that chooses."""
    return f"{number}\0{keep}"


def split_conflict_id(id: str) -> tuple[int, Keep] | None:
    """Which conflict, and what of it is kept; None for no such row."""
    number, _, keep = id.partition("\0")
    if keep in ("yours", "theirs", "both"):
        return int(number), keep  # type: ignore[return-value]
    return None


def place_in_words(text: str, conflict: MergeConflict) -> str:
    """In or behind which act or rule a conflict stands: ", in the act R_Yes"; empty: in none."""
    owner, state, is_open = "", "", False
    for found in _OPENING.finditer(text, 0, conflict.start):
        kind, name, closed = found.groups()
        if closed:
            is_open, state = False, ""
        elif kind == "State":
            state = f", {_WORDS[kind]} {clean(name)}"
        else:
            owner, state, is_open = f"{_WORDS[kind]} {clean(name)}", "", True
    if not owner:
        return ""
    return f", {'in' if is_open else 'behind'} {owner}{state if is_open else ''}"


def conflict_place(draft: StudyDraft, file: str, number: int) -> FilePlace:
    """The lines of a conflict."""
    text, conflicts = conflicts_of(file, draft.files.get(file, b""))
    if not 0 <= number < len(conflicts):
        return FilePlace(file, 1, 1)
    return FilePlace(file, text.line(conflicts[number].start), text.line(conflicts[number].closing))
