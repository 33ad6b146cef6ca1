"""The working memory: values with their types, unfolded where they have parts, changed in place, and undone."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from textual import on
from textual.widget import Widget

from rise_engine.view import MemoryView
from rise_tui.actions import bindings, why_blocked
from rise_tui.messages import TaskAsked, Told
from rise_tui.model.nested import NoSuchPart, Path, part, parts, removed, replaced, written
from rise_tui.model.store import Store
from rise_tui.model.task_text import value_rows
from rise_tui.panes.pane import ListPane
from rise_tui.panes.save_start_values import ask_to_save_start_values
from rise_tui.screens.reading import Reading
from rise_tui.text import Line, Row, Span, age, cell, cells, clock, fit_middle, type_word, value_text
from rise_tui.widgets.editor import Present, RowEditor

ADD = "\0add"
"""The row that adds a key; keyboards without Insert reach it with Enter."""
LEAST_VALUE = 8
"""Cells that a value keeps beside a long key."""
MOST_PARTS = 200
"""Parts of one value that are shown as rows."""


class Columns(NamedTuple):
    key: int
    value: int
    type: int
    source: int
    age: int

    @classmethod
    def of(cls, width: int, longest: int = 0) -> Columns:
        """`longest`: cells of the longest key. Keys get what they need as long as values keep some room."""
        kind, when = 8, 6
        source = 0 if width < 56 else min(20, width // 5)
        rest = width - kind - when - source - 4
        key = min(26, max(10, rest // 2, min(longest, rest - LEAST_VALUE)))
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
        self._unfolded: set[Path] = set()
        self._paths: dict[str, Path] = {}
        """What each row stands for."""
        self._editing: Path = ()

    def body(self) -> Sequence[Widget]:
        return [self.list, self.editor]

    def subtitle(self) -> Line:
        return ((f"{len(self.store.view.memory)}", "muted"),)

    # --- rows ---------------------------------------------------------------------------------------------------------

    def make_rows(self, width: int) -> list[Row]:
        columns = self._columns(width)
        self._paths.clear()
        rows = []
        for key, entry in self.store.view.memory.items():
            rows.append(self._row((key,), entry.value, columns, entry))
            rows += self._parts((key,), entry.value, columns)
        rows.append(Row(ADD, ((" + add a key", "muted"),)))
        if self.editor.is_open:
            self.editor.check()
        return rows

    def _columns(self, width: int) -> Columns:
        return Columns.of(width, max(map(cells, self.store.view.memory), default=0))

    def _parts(self, path: Path, value: Any, columns: Columns) -> Iterator[Row]:
        """The rows below an unfolded value."""
        if path not in self._unfolded:
            return
        for number, (step, inner) in enumerate(parts(value)):
            if number == MOST_PARTS:
                more = f"{'  ' * len(path)}   and {len(value) - MOST_PARTS} more"
                yield Row("", ((more, "muted"),), selectable=False)
                return
            yield self._row((*path, step), inner, columns)
            yield from self._parts((*path, step), inner, columns)

    def _row(self, path: Path, value: Any, columns: Columns, entry: MemoryView | None = None) -> Row:
        """A key, or with no `entry` a part of its value."""
        name = written(path)
        row_id = str(path[0]) if len(path) == 1 else "\0".join(map(str, path))
        self._paths[row_id] = path
        sent = entry is not None and self._sent(str(path[0]))
        kind = "↑ sent" if sent else type_word(value)
        fold = " " if not any(True for _ in parts(value)) else "▾" if path in self._unfolded else "▸"
        label = "  " * (len(path) - 1) + (name if len(path) == 1 else f".{path[-1]}")
        text = value_text(value)
        line: list[Span] = [
            (fold, "muted"),
            (fit_middle(label, columns.key), "plain"),
            (" ", "plain"),
            cell(text, columns.value, "strong"),
            (" ", "plain"),
            cell(kind, columns.type, "wait" if sent else "muted"),
        ]
        source = entry.source if entry is not None else ""
        if columns.source:
            line.append(cell(source, columns.source, "muted"))
        line.append(cell(self._age(entry), columns.age, "muted", right=True))
        return Row(row_id, tuple(line), full=f"{name} {text} {kind} {source}")

    def _age(self, entry: MemoryView | None) -> str:
        if entry is None:
            return ""
        return "start" if entry.source == "file" else age(self.store.now() - entry.changed)

    def _sent(self, key: str) -> bool:
        start = json.dumps({key: 0}, ensure_ascii=False)[:-2]
        return any(
            (sent.function == "deleteValue" and sent.behavior == key)
            or (sent.function == "assignValue" and sent.behavior.startswith(start))
            for sent in self.store.sent.values()
        )

    def _part(self, path: Path) -> Any:
        """The value of a row at this moment. Raises NoSuchPart."""
        entry = self.store.view.memory.get(str(path[0]))
        if entry is None:
            raise NoSuchPart(written(path))
        return part(entry.value, path[1:])

    # --- actions ------------------------------------------------------------------------------------------------------

    def do(self, action: str) -> None:
        path = self._paths.get(self.list.current, ())
        if action == "memory.unfold":
            self._unfold(path)
        elif action == "memory.fold":
            self._fold(path)
        elif reason := why_blocked(self.store, "change"):
            self.post_message(Told(reason))
        elif action == "memory.undo":
            self._undo()
        elif action == "memory.save":
            self.run_worker(ask_to_save_start_values(self), group="keep", exclusive=True)
        elif action == "memory.add" or self.list.current == ADD:
            if action != "memory.delete":
                self._open((), *(self.store.deleted or ("", None)))
        elif not path:
            self.post_message(Told("no key is selected"))
        elif action == "memory.edit":
            self._open(path, written(path), self._part(path))
        elif action == "memory.delete":
            self._delete(path)

    def _delete(self, path: Path) -> None:
        key, value = str(path[0]), self._part(path)
        if len(path) == 1:
            self.store.deleted = (key, value)
            self.post_message(TaskAsked("deleteValue", key))
        else:
            self._assign(key, removed(self.store.view.memory[key].value, path[1:]))
        self.post_message(Told(f"deleting {written(path)} = {value_text(value)}; undo (^U) brings it back"))

    def _undo(self) -> None:
        step = self.store.changes.next(self.store.view.memory)
        if step.kind == "do" and any(sent.behavior == step.behavior for sent in self.store.sent.values()):
            self.post_message(Told("the last undo is still on its way"))
            return
        self.post_message(Told(step.said))
        if step.kind == "do":
            self.post_message(TaskAsked(step.function, step.behavior))

    # --- parts of a value ---------------------------------------------------------------------------------------------

    def _unfold(self, path: Path) -> None:
        if not path:
            return
        value = self._part(path)
        if not any(True for _ in parts(value)) or path in self._unfolded:
            self._read(path)
            return
        self._unfolded.add(path)
        self.repaint()

    def _fold(self, path: Path) -> None:
        """This value, or else the one that it is a part of."""
        while path and path not in self._unfolded:
            path = path[:-1]
        if path:
            self._unfolded = {each for each in self._unfolded if each[: len(path)] != path}
            self.list.select(str(path[0]) if len(path) == 1 else "\0".join(map(str, path)))
            self.repaint()

    def _read(self, path: Path) -> None:
        """A value in full: its row may have no room for it."""

        def rows(width: int) -> list[Row]:
            entry = self.store.view.memory.get(str(path[0]))
            try:
                value = self._part(path)
            except NoSuchPart:
                value = None
            if entry is None:
                return value_rows(written(path), "it is deleted now", "", "", width)
            about = f"{clock(entry.changed, tenths=True)} by {entry.source}" + (
                f", before that {value_text(entry.old)}" if entry.source != "file" and len(path) == 1 else ""
            )
            return value_rows(written(path), value_text(value), type_word(value), about, width)

        self.app.push_screen(Reading("Memory", rows))

    # --- the editor ---------------------------------------------------------------------------------------------------

    def _open(self, path: Path, key: str, value: object) -> None:
        self._editing = path
        self.list.select(self.list.current if path else ADD)
        last = self.list.size.height - 1
        y = 1 + min(self.list.cursor - self.list.scroll_offset.y, max(0, last - 1))  # a second row may be needed below
        columns = self._columns(self.list.row_width)
        text = value_text(value) if key else ""
        self.editor.open(written(path), key, text, self._present, y=y, key_width=columns.key, value_width=columns.value)

    def _present(self, key: str) -> Present:
        """What a key, or the part that is being edited, has at this moment."""
        path: Path = self._editing or (key,)
        entry = self.store.view.memory.get(str(path[0]))
        try:
            return Present(value_text(self._part(path)), entry.source if entry is not None else "")
        except NoSuchPart:
            return Present("")

    @on(RowEditor.Done)
    def _edited(self, event: RowEditor.Done) -> None:
        event.stop()
        self.screen.set_focus(self.list)
        if not event.key:
            return
        path: Path = self._editing or (event.key,)
        key, value = str(path[0]), event.value
        if len(path) > 1:
            try:
                value = replaced(self.store.view.memory[key].value, path[1:], event.value)
            except LookupError:
                self.post_message(Told(f"{event.key} is gone: {key} has changed; nothing was sent"))
                return
        if self.store.deleted is not None and self.store.deleted[0] == key:
            self.store.deleted = None
        self._assign(key, value)

    def _assign(self, key: str, value: Any) -> None:
        self.post_message(TaskAsked("assignValue", json.dumps({key: value}, ensure_ascii=False)))
