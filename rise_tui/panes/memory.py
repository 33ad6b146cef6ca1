"""The working memory: values with their types, changed in place."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import NamedTuple

from textual.widget import Widget

from rise_tui.actions import bindings
from rise_tui.messages import TaskAsked, Told
from rise_tui.panes.pane import ListPane
from rise_tui.store import Store
from rise_tui.text import Line, Row, Span, age, cell, type_word, value_text
from rise_tui.widgets.editor import RowEditor

ADD = "\0add"
"""The row that adds a key; keyboards without Insert reach it with Enter."""


class Columns(NamedTuple):
    key: int
    value: int
    type: int
    source: int
    age: int

    @classmethod
    def of(cls, width: int) -> Columns:
        kind, when = 8, 6
        source = 0 if width < 56 else min(20, width // 5)
        rest = width - kind - when - source - 4
        key = min(26, max(10, rest // 2))
        return cls(key, rest - key, kind, source, when)


class MemoryPane(ListPane):
    """The memory and its editor."""

    PLACE = "memory"
    BINDINGS = bindings("memory")
    TITLE = "Memory"
    TOPICS = frozenset({"memory", "status"})

    DEFAULT_CSS = """
    MemoryPane { layers: default edit; }
    """

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.editor = RowEditor()

    def body(self) -> Sequence[Widget]:
        return [self.list, self.editor]

    def subtitle(self) -> Line:
        return ((f"{len(self.store.view.memory)}", "muted"),)

    def make_rows(self, width: int) -> list[Row]:
        columns, now = Columns.of(width), self.store.now()
        rows = []
        for key, entry in self.store.view.memory.items():
            sent = self._sent(key)
            kind = "↑ sent" if sent else type_word(entry.value)
            when = "start" if entry.source == "file" else age(now - entry.changed)
            line: list[Span] = [
                (" ", "plain"),
                cell(key, columns.key),
                (" ", "plain"),
                cell(value_text(entry.value), columns.value, "strong"),
                (" ", "plain"),
                cell(kind, columns.type, "wait" if sent else "muted"),
            ]
            if columns.source:
                line.append(cell(entry.source, columns.source, "muted"))
            line.append(cell(when, columns.age, "muted", right=True))
            rows.append(Row(key, tuple(line)))
        rows.append(Row(ADD, ((" + add a key", "muted"),)))
        if self.editor.is_open:
            self.editor.check(self.store.view.memory)
        return rows

    def _sent(self, key: str) -> bool:
        start = json.dumps({key: 0}, ensure_ascii=False)[:-2]
        return any(
            (sent.function == "deleteValue" and sent.behavior == key)
            or (sent.function == "assignValue" and sent.behavior.startswith(start))
            for sent in self.store.sent.values()
        )

    def do(self, action: str) -> None:
        key = self.list.current
        if reason := self.store.cannot_act():
            self.post_message(Told(reason))
        elif action == "memory.add" or key == ADD:
            if action != "memory.delete":
                self._open("", *(self.store.deleted or ("", None)))
        elif key not in self.store.view.memory:
            self.post_message(Told("no key is selected"))
        elif action == "memory.edit":
            self._open(key, key, self.store.view.memory[key].value)
        elif action == "memory.delete":
            value = self.store.view.memory[key].value
            self.store.deleted = (key, value)
            self.post_message(TaskAsked("deleteValue", key))
            self.post_message(Told(f"deleting {key} = {value_text(value)}; add (ins) brings it back"))

    def _open(self, editing: str, key: str, value: object) -> None:
        row = editing or ADD
        self.list.select(row)
        y = 1 + self.list.cursor - self.list.scroll_offset.y
        columns = Columns.of(self.list.row_width)
        text = value_text(value) if key else ""
        self.editor.open(editing, key, text, y=y, key_width=columns.key, value_width=columns.value)

    def on_row_editor_done(self, event: RowEditor.Done) -> None:
        event.stop()
        self.list.focus()
        if event.key:
            behavior = json.dumps({event.key: event.value}, ensure_ascii=False)
            if self.store.deleted is not None and self.store.deleted[0] == event.key:
                self.store.deleted = None
            self.post_message(TaskAsked("assignValue", behavior))
