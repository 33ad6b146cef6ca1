"""Changes that wait for the author, as rows: own ones that were set aside, proposed ones, what each would change."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import SequenceMatcher

from rise_engine.edit.history import changed_names
from rise_engine.edit.waiting import Outlook
from rise_tui.editing.model.draft import StudyDraft, count
from rise_tui.rendering.text import ListRow, StyledLine, TextRole, clean, crop, fixed_span, wrap

MOST_LINES = 200
"""Lines of files that are compared on the screen."""
_SIDES = {"yours": ("the other's", "yours"), "proposed": ("now", "proposed")}
"""What the files say now, and what they would say, in a word each."""


def waiting_text(draft: StudyDraft) -> str:
    """What waits, in words: "1 change of yours was set aside, 3 changes are proposed"; empty: nothing."""
    own, proposed = (
        sum(each.waiting.origin == origin and not each.waiting.given_up for each in draft.waiting)
        for origin in ("yours", "proposed")
    )
    texts = [f"{count(own, 'change')} of yours {'was' if own == 1 else 'were'} set aside"] if own else []
    texts += [f"{count(proposed, 'change')} {'is' if proposed == 1 else 'are'} proposed"] if proposed else []
    return ", ".join(texts)


def waiting_rows(draft: StudyDraft, width: int) -> list[ListRow]:
    """A row for each change, in three groups."""
    rows: list[ListRow] = []

    def add(title: str, outlooks: Sequence[Outlook], role: TextRole = "plain") -> None:
        if outlooks:
            rows.append(ListRow("", crop(((f" {title}", "accent"),), width), selectable=False))
        for each in outlooks:
            text = clean("; ".join(each.says)) or "a change"
            line: StyledLine = ((" ✗ ", "fault"), (text, "muted")) if each.why_not else (("   ", "plain"), (text, role))
            rows.append(ListRow(str(each.waiting.number), crop(line, width)))

    left = [each for each in draft.waiting if not each.waiting.given_up]
    add("YOURS, SET ASIDE: somebody has changed the same", [each for each in left if each.waiting.origin == "yours"])
    add("PROPOSED", [each for each in left if each.waiting.origin == "proposed"])
    add("GIVEN UP: until you leave the editor", [each for each in draft.waiting if each.waiting.given_up], "muted")
    return rows


def outlook_rows(outlook: Outlook, width: int) -> list[ListRow]:
    """What a change would do: in words, why it cannot be made, and line by line beside what stands there now."""
    rows: list[StyledLine] = []

    def add(text: str, role: TextRole = "plain", indent: str = " ") -> None:
        pieces = wrap(clean(text), max(20, width - len(indent) - 2))
        rows.extend(((f"{indent}{'  ' if number else ''}{piece}", role),) for number, piece in enumerate(pieces))

    for sentence in outlook.says:
        add(sentence, "strong")
    for sentence in outlook.noticed:
        add(f"▲ {sentence}", "wait")
    if outlook.why_not:
        add(f"✗ it cannot be made now: {outlook.why_not}", "fault")
    for place, lines in compared(outlook):
        rows.append(crop(((f" {place}", "muted"),), width))
        for side, text in lines:
            rows += _side_rows(_SIDES[outlook.waiting.origin][side], text, "strong" if side else "plain", width)
        if len(rows) > MOST_LINES:
            rows.append(((" … and more: ctrl+o shows all of it once it is made", "muted"),))
            break
    return [ListRow("", line, selectable=False) for line in rows]


def _side_rows(word: str, text: str, role: TextRole, width: int) -> Iterator[StyledLine]:
    room = max(20, width - 16)
    for number, piece in enumerate(wrap(clean(text.expandtabs(2)), room) or [""]):
        yield fixed_span(f" {'' if number else word}", 13, "muted"), ("│ ", "muted"), (piece, role)


def compared(outlook: Outlook) -> Iterator[tuple[str, list[tuple[int, str]]]]:
    """Each place that differs ("acts/a.xml, line 12"), with its lines: 0 as they are now, 1 as they would be."""
    for name in sorted(changed_names(outlook.before, outlook.after)):
        old, new = (_lines(side.get(name)) for side in (outlook.before, outlook.after))
        head = _count_equal(old, new)
        tail = _count_equal(old[head:][::-1], new[head:][::-1])
        before, after = old[head : len(old) - tail], new[head : len(new) - tail]
        for tag, i1, i2, j1, j2 in SequenceMatcher(None, before, after, autojunk=False).get_opcodes():
            if tag != "equal":
                lines = [(0, line) for line in before[i1:i2]] + [(1, line) for line in after[j1:j2]]
                place = f"line {head + i1 + 1}" if i2 > i1 else f"behind line {head + i1}"
                yield f"{name}, {place}" if name in outlook.before else f"{name}, a new file", lines[:MOST_LINES]


def _lines(data: bytes | None) -> list[str]:
    return (data or b"").decode("utf-8", "replace").splitlines()


def _count_equal(one: Sequence[str], other: Sequence[str]) -> int:
    number = 0
    for left, right in zip(one, other, strict=False):
        if left != right:
            break
        number += 1
    return number
