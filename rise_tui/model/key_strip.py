"""The strip of the study's own keys: awaited keys first, then events, assignments and rules, then acts. Pure.

Keys do not jump around. Keys that some rule may wait for share the front, and only the awaited ones move there. Every
other key has a fixed place.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from rise_engine.author.drawing.study_keys import ACT, RULE, StudyKeys, key_title
from rise_engine.scenario.model import KeyBinding, Scenario
from rise_tui.model.states import EXPECTED, RUNNING, SENT
from rise_tui.model.store import Store
from rise_tui.rendering.text import StyledLine, StyledSpan, cell_width, shorten

TITLE, TITLE_NARROW = 24, 16
"""Cells for the title of a key."""
NARROW = 100
TALL = 30
MAX_LINES = 2


class KeyStripPiece(NamedTuple):
    """A key in the strip: line, first cell, cell after the last. Without a key: the number of hidden ones."""

    key: KeyBinding | None
    line: int
    start: int
    end: int


class KeyStripLines(NamedTuple):
    lines: tuple[StyledLine, ...]
    pieces: tuple[KeyStripPiece, ...]


def key_strip_height(scenario: Scenario, keys: StudyKeys, width: int, height: int) -> int:
    """The lines for all keys except those of acts, at most two; in a tall terminal two if acts have keys."""
    if not scenario.keys:
        return 0
    every = [*keys.answer_keys, *keys.other_keys]
    if height >= TALL or not every:
        every += keys.act_keys
    return 1 if len(_place_keys(every, width, 1)) == len(every) else MAX_LINES


def key_strip_lines(store: Store, width: int, rows: int) -> KeyStripLines:
    """The keys in `rows` lines of `width` cells."""
    keys, awaited = store.study_keys, store.expected_keys()
    ordered = [
        *(key for key in keys.answer_keys if key.key in awaited),
        *(key for key in keys.act_keys if key.key in awaited and _is_idle(store, key)),
        *(key for key in keys.answer_keys if key.key not in awaited),
        *keys.other_keys,
    ]
    ordered += [key for key in keys.act_keys if key not in ordered]
    positions = _place_keys(ordered, width, rows)
    lines: list[list[StyledSpan]] = [[] for _ in range(rows)]
    pieces = []
    for key, (line, start) in zip(ordered, positions, strict=False):
        spans = _key_spans(key, store, width, key.key in awaited)
        lines[line] += spans
        pieces.append(KeyStripPiece(key, line, start, start + _key_width(key, width)))
    if rows and (hidden := len(ordered) - len(positions)):
        text = _more_text(hidden)
        start = sum(cell_width(text) for text, _ in lines[-1])
        gap = max(0, width - start - cell_width(text) - 1)
        lines[-1] += [(" " * gap, "plain"), (text[:-1], "muted"), ("?", "key")]
        pieces.append(KeyStripPiece(None, rows - 1, start + gap, start + gap + cell_width(text)))
    return KeyStripLines(tuple(tuple(line) for line in lines), tuple(pieces))


def _more_text(hidden: int) -> str:
    return f"+{hidden} more ?"


def _place_keys(keys: Sequence[KeyBinding], width: int, rows: int) -> list[tuple[int, int]]:
    """Line and cell of each key that fits, in order. The last line leaves room for the number of hidden keys."""
    positions: list[tuple[int, int]] = []
    line = column = 0
    for key in keys:
        needed = _key_width(key, width)
        kept = 0 if key is keys[-1] else cell_width(_more_text(len(keys))) + 1
        if column + needed > width - (kept if line == rows - 1 else 0):
            line, column = line + 1, 0
            if line >= rows or needed > width - (kept if line == rows - 1 else 0):
                break
        positions.append((line, column))
        column += needed
    return positions


def _title_text(key: KeyBinding, width: int) -> str:
    return shorten(key_title(key), TITLE_NARROW if width < NARROW else TITLE)


def _key_width(key: KeyBinding, width: int) -> int:
    return 1 + cell_width(key.label) + 1 + cell_width(_title_text(key, width)) + 1


def _key_spans(key: KeyBinding, store: Store, width: int, awaited: bool) -> list[StyledSpan]:
    off = store.is_covered or store.task_blocked(key.function) is not None
    title = _title_text(key, width)
    if store.is_sent((key.function,), key.task_behavior):
        mark: StyledSpan = (SENT.glyph, SENT.role)
    elif key.function in (ACT, RULE) and _is_running(store, key):
        mark = (RUNNING.glyph, RUNNING.role)
    elif awaited:
        mark = (EXPECTED.glyph, "muted" if off else EXPECTED.role)
    else:
        mark = (" ", "plain")
    return [
        mark,
        (key.label, "muted" if off else "key"),
        (f" {title} ", "muted" if off else "strong" if awaited else "plain"),
    ]


def _is_running(store: Store, key: KeyBinding) -> bool:
    return bool(store.act(key.behavior).running) if key.function == ACT else store.rule(key.behavior).running


def _is_idle(store: Store, key: KeyBinding) -> bool:
    act = store.act(key.behavior)
    return not act.running and not act.waiting
