"""Text for a screen: rows of styled pieces, fitted to cells. Pure, without widgets."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from typing import Literal, NamedTuple, TypeAlias

from rich.cells import cell_len, set_cell_size

from rise_engine.base.text import clean as clean
from rise_engine.base.typed_values import JSON_TYPES as JSON_TYPES
from rise_engine.base.typed_values import format_value as format_value
from rise_engine.base.typed_values import json_type_name as json_type_name
from rise_engine.base.typed_values import parse_typed_value as parse_typed_value

TextRole: TypeAlias = Literal["plain", "strong", "muted", "accent", "wait", "fault", "key", "alarm", "call", "match"]
"""The meaning of a piece of text; the theme decides its look. Only `fault` and `alarm` are red.

`call` is an amber `alarm`: important, but no fault. `match`: a filter's match.
"""

StyledSpan: TypeAlias = tuple[str, TextRole]
StyledLine: TypeAlias = tuple[StyledSpan, ...]

_OPENING_QUOTES = ("“", "„", "«", '"')


class ListRow(NamedTuple):
    """One row of a list: its id, and its text."""

    id: str
    line: StyledLine
    selectable: bool = True
    full: str = ""
    """The text for filters, if the line has no room for all of it."""


def cell_width(text: str) -> int:
    """The number of cells that a text takes."""
    return len(text) if text.isascii() else cell_len(text)


@lru_cache(2048)  # columns of a list repeat their texts
def fit(text: str, width: int, *, right: bool = False) -> str:
    """The text in exactly `width` cells; a longer text ends in `…`."""
    if width <= 0:
        return ""
    text = clean(text)
    length = cell_width(text)
    if length > width:
        head = set_cell_size(text, width - 1).rstrip()
        return head + "…" + " " * (width - 1 - cell_len(head))
    pad = " " * (width - length)
    return pad + text if right else text + pad


def shorten(text: str, width: int) -> str:
    """The text in at most `width` cells; a longer text ends in `…`."""
    return fit(text, width).rstrip()


def fit_end(text: str, width: int) -> str:
    """Like `fit`, but a longer text is cut at its start: `…1, step 3`."""
    text = clean(text)
    if width <= 0 or cell_len(text) <= width:
        return fit(text, width)
    while cell_len(text) > width - 1:
        text = text[1:]
    return fit("…" + text.lstrip(), width)


def fit_middle(text: str, width: int) -> str:
    """Like `fit`, but a longer text is cut in the middle, so that names that begin alike differ (`partic…_name`)."""
    text = clean(text)
    if width < 5 or cell_len(text) <= width:
        return fit(text, width)
    end = text[-(width // 2) :]
    while cell_len(end) > width // 2:
        end = end[1:]
    head = set_cell_size(text, width - 1 - cell_len(end)).rstrip()
    return fit(f"{head}…{end}", width)


def fixed_span(text: str, width: int, role: TextRole = "plain", *, right: bool = False) -> StyledSpan:
    """A piece of fixed width, for one column of a row."""
    return fit(text, width, right=right), role


def line_width(line: Iterable[StyledSpan]) -> int:
    return sum(cell_width(text) for text, _ in line)


def plain_text(line: Iterable[StyledSpan]) -> str:
    """The characters of a line, for searching and for tests."""
    return "".join(text for text, _ in line)


def highlight_matches(line: StyledLine, matches: Iterable[tuple[int, int]]) -> StyledLine:
    """The line with the characters of these spans, in order, in the role `match`."""
    spans: list[StyledSpan] = []
    left = list(matches)
    column = 0
    for text, role in line:
        at = 0
        while left and left[0][0] < column + len(text):
            start, end = (min(max(0, edge - column), len(text)) for edge in left[0])
            spans += [(text[at:start], role), (text[start:end], "match")]
            at = end
            if left[0][1] > column + len(text):
                break  # it continues in the next piece
            del left[0]
        spans.append((text[at:], role))
        column += len(text)
    return tuple(span for span in spans if span[0])


def crop(line: StyledLine, width: int) -> StyledLine:
    """The line in at most `width` cells; a longer one ends in `…`."""
    if line_width(line) <= width:
        return line
    kept: list[StyledSpan] = []
    room = width
    for text, role in line:
        text = clean(text)
        if cell_len(text) >= room:
            kept.append((fit(text + " " * room, room), role))
            break
        kept.append((text, role))
        room -= cell_len(text)
    return tuple(kept)


def align_at_both_ends(left: StyledLine, right: StyledLine, width: int) -> StyledLine:
    """Two pieces at the two ends of a row. The left one is cut if necessary."""
    right = crop(right, width)
    room = width - line_width(right)
    left = crop(left, max(0, room - 1))
    return (*left, (" " * (room - line_width(left)), "plain"), *right)


def heading_line(name: str, state: StyledSpan, right: StyledLine, width: int) -> StyledLine:
    """A name, its state, and a piece at the other end. The name is cut, the state never."""
    room = width - line_width(right) - cell_len(state[0]) - 4
    shown = fit(name, max(4, room)) if cell_len(clean(name)) > room else clean(name)
    return align_at_both_ends(((f" {shown}  ", "strong"), state), right, width)


def quoted(text: str) -> str:
    """The robot's words on the screen. A text that begins with a quotation mark keeps its own."""
    text = clean(text)
    return text if text.startswith(_OPENING_QUOTES) else f"“{text}”"


def wrap(text: str, width: int) -> list[str]:
    """A text on the lines that it needs. A word longer than a line is cut."""
    lines, line = [], ""
    for word in clean(text).split():
        if line and cell_len(line) + 1 + cell_len(word) > width:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}".strip()
    return [*lines, line]


def format_seconds(value: float) -> str:
    """A duration: `0.4`, `12.3`, `3:05`, `1:02:07`; to a tenth of a second below a minute."""
    value = max(0.0, value)
    if value < 59.95:
        return f"{value:.1f}"
    whole = round(value)
    hours, minutes = divmod(whole // 60, 60)
    return f"{hours}:{minutes:02}:{whole % 60:02}" if hours else f"{minutes}:{whole % 60:02}"


def format_duration(value: float) -> str:
    """A duration, with its unit if it needs one."""
    return f"{format_seconds(value)} s" if value < 59.95 else format_seconds(value)


def format_age(value: float) -> str:
    """An age in few cells: `3 s`, `12 min`, `2 h`."""
    value = max(0.0, value)
    if value < 60:
        return f"{int(value)} s"
    return f"{int(value // 60)} min" if value < 3600 else f"{int(value // 3600)} h"


def format_clock(value: float, *, tenths: bool = False) -> str:
    """Session time: `00:14:32`, or `00:14:32.1`."""
    value = max(0.0, value)
    whole = int(value)
    text = f"{whole // 3600:02}:{whole // 60 % 60:02}:{whole % 60:02}"
    return f"{text}.{int(value * 10) % 10}" if tenths else text
