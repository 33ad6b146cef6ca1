"""The working memory: values with their types, unfolded if they have parts, edited in place, with undo."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from textual import on, work
from textual.widget import Widget

from rise_engine.kernel.view import MemoryView
from rise_tui.actions import bindings_in
from rise_tui.key_labels import why_blocked
from rise_tui.model.log_text import value_rows
from rise_tui.model.memory_changes import (
    CHANGE_QUESTION,
    JsonPath,
    NoSuchPath,
    assignment,
    changed_key,
    children,
    condition_change_lines,
    path_text,
    value_at,
    with_removed,
    with_replaced,
)
from rise_tui.model.store import Store
from rise_tui.panes.pane import ListPane
from rise_tui.rendering.text import (
    ListRow,
    StyledLine,
    StyledSpan,
    cell_width,
    fit_middle,
    fixed_span,
    format_age,
    format_clock,
    format_value,
    json_type_name,
)
from rise_tui.screens.dialog import Dialog, DialogChoice
from rise_tui.screens.reading import DetailScreen
from rise_tui.widgets.memory_editor import PresentValue, RowEditor

ADD = "\0add"
"""The row that adds a key. Keyboards without Insert reach it with Enter."""
MIN_VALUE = 8
"""Cells that a value keeps beside a long key."""
MAX_PARTS = 200
"""Parts of one value that are shown as rows."""


def _row_id(path: JsonPath) -> str:
    return "\0".join(map(str, path))


class MemoryColumns(NamedTuple):
    key: int
    value: int
    type: int
    source: int
    age: int

    @classmethod
    def from_width(cls, width: int, longest: int) -> MemoryColumns:
        """The columns for a width. `longest`: cells of the longest key. Keys get their room while values keep some."""
        kind, when = 8, 6
        source = 0 if width < 56 else min(20, width // 5)
        rest = width - kind - when - source - 4
        key = min(26, max(10, rest // 2, min(longest, rest - MIN_VALUE)))
        return cls(key, rest - key, kind, source, when)


class MemoryPane(ListPane):
    """The memory and its editor."""

    SCOPE = "memory"
    BINDINGS = bindings_in("memory")
    TITLE = "Memory"
    PARTS = frozenset({"memory", "status"})

    DEFAULT_CSS = "MemoryPane { layers: default edit; }"

    def __init__(self, store: Store) -> None:
        super().__init__(store)
        self.editor = RowEditor()
        self._unfolded: set[JsonPath] = set()
        self._paths: dict[str, JsonPath] = {}
        """The path of each row."""
        self._editing: JsonPath = ()

    def body_widgets(self) -> Sequence[Widget]:
        return [self.row_list, self.editor]

    def subtitle(self) -> StyledLine:
        return ((f"{len(self._entries())}", "muted"),)

    # --- rows ---------------------------------------------------------------------------------------------------------

    def make_rows(self, width: int) -> list[ListRow]:
        columns = self._columns(width)
        self._paths.clear()
        rows = []
        for key, entry in self._entries().items():
            rows.append(self._row((key,), entry.value, columns, entry))
            rows += self._child_rows((key,), entry.value, columns)
        rows.append(ListRow(ADD, ((" + add a key", "muted"),)))
        if self.editor.is_open:
            self.editor.draw()
        return rows

    def _columns(self, width: int) -> MemoryColumns:
        return MemoryColumns.from_width(width, max(map(cell_width, self._entries()), default=0))

    def _entries(self) -> dict[str, MemoryView]:
        """The keys of the memory, then the tables."""
        tables = self.store.scenario.tables.items()
        return {
            **self.store.view.memory,
            **{name: MemoryView(table.records, None, "file", 0.0) for name, table in tables},
        }

    def _child_rows(self, path: JsonPath, value: Any, columns: MemoryColumns) -> Iterator[ListRow]:
        """The rows below an unfolded value."""
        if path not in self._unfolded:
            return
        for number, (step, inner) in enumerate(children(value)):
            if number == MAX_PARTS:
                more = f"{'  ' * len(path)}   and {len(value) - MAX_PARTS} more"
                yield ListRow("", ((more, "muted"),), selectable=False)
                return
            yield self._row((*path, step), inner, columns)
            yield from self._child_rows((*path, step), inner, columns)

    def _row(self, path: JsonPath, value: Any, columns: MemoryColumns, entry: MemoryView | None = None) -> ListRow:
        """The row of a key or, without `entry`, of a part of its value."""
        name = path_text(path)
        row_id = _row_id(path)
        self._paths[row_id] = path
        sent = entry is not None and self._is_sent(str(path[0]))
        table = self.store.scenario.tables.get(str(path[0])) if len(path) == 1 else None
        kind = "table" if table is not None else "↑ sent" if sent else json_type_name(value)
        fold = " " if not any(children(value)) else "▾" if path in self._unfolded else "▸"
        label = "  " * (len(path) - 1) + (name if len(path) == 1 else f".{path[-1]}")
        text = format_value(value) if table is None else table.size_text
        line: list[StyledSpan] = [
            (fold, "muted"),
            (fit_middle(label, columns.key), "plain"),
            (" ", "plain"),
            fixed_span(text, columns.value, "strong"),
            (" ", "plain"),
            fixed_span(kind, columns.type, "wait" if sent else "muted"),
        ]
        source = entry.source if entry is not None else ""
        if columns.source:
            line.append(fixed_span(source, columns.source, "muted"))
        line.append(fixed_span(self._age_text(entry), columns.age, "muted", right=True))
        return ListRow(row_id, tuple(line), full=f"{name} {text} {kind} {source}")

    def _age_text(self, entry: MemoryView | None) -> str:
        if entry is None:
            return ""
        return "start" if entry.source == "file" else format_age(self.store.now() - entry.changed)

    def _is_sent(self, key: str) -> bool:
        start = json.dumps({key: 0}, ensure_ascii=False)[:-2]
        return any(
            (sent.function == "deleteValue" and sent.behavior == key)
            or (sent.function == "assignValue" and sent.behavior.startswith(start))
            for sent in self.store.sent.values()
        )

    def _value_at(self, path: JsonPath) -> Any:
        """The present value of a row. Raises NoSuchPath."""
        entry = self._entries().get(str(path[0]))
        if entry is None:
            raise NoSuchPath(path_text(path))
        return value_at(entry.value, path[1:])

    # --- actions ------------------------------------------------------------------------------------------------------

    def carry_out(self, action: str) -> None:
        path = self._paths.get(self.row_list.current_id, ())
        if action == "memory.unfold":
            self._unfold(path)
        elif action == "memory.fold":
            self._fold(path)
        elif reason := why_blocked(self.store, "change"):
            self.host.show_notice(reason)
        elif action == "memory.undo":
            self._undo()
        elif action == "memory.save":
            self._ask_to_save()
        elif action == "memory.add" or self.row_list.current_id == ADD:
            if action != "memory.delete":
                self._open_editor((), *(self.store.last_deletion or ("", None)))
        elif not path:
            self.host.show_notice("no key is selected")
        elif (name := str(path[0])) in self.store.scenario.tables:
            self.host.show_notice(f"{name} is a table and cannot be changed here; edit tables/{name}.csv")
        elif action == "memory.edit":
            self._open_editor(path, path_text(path), self._value_at(path))
        elif action == "memory.delete":
            self._delete(path)

    @work(group="keep", exclusive=True)
    async def _ask_to_save(self) -> None:
        from rise_tui.panes.save_start_values import ask_to_save_start_values  # imports the file editing, rarely used

        await ask_to_save_start_values(self)

    def _delete(self, path: JsonPath) -> None:
        key, value = str(path[0]), self._value_at(path)
        if len(path) == 1:
            self.store.last_deletion = (key, value)
            function, behavior = "deleteValue", key
        else:
            function, behavior = assignment(key, with_removed(self.store.view.memory[key].value, path[1:]))
        self._send(function, behavior, f"deleting {path_text(path)} = {format_value(value)}; undo (^U) brings it back")

    def _undo(self) -> None:
        step = self.store.undo_stack.next_step(self.store.view.memory)
        if step.kind == "do" and any(sent.behavior == step.behavior for sent in self.store.sent.values()):
            self.host.show_notice("the last undo is still on its way")
            return
        if step.kind == "do":
            self._send(step.function, step.behavior, step.notice)
        else:
            self.host.show_notice(step.notice)

    # --- parts of a value ---------------------------------------------------------------------------------------------

    def _unfold(self, path: JsonPath) -> None:
        if not path:
            return
        value = self._value_at(path)
        if not any(children(value)) or path in self._unfolded:
            self._show_in_full(path)
            return
        self._unfolded.add(path)
        self.repaint()

    def _fold(self, path: JsonPath) -> None:
        """Fold this value, or else the one that contains it."""
        while path and path not in self._unfolded:
            path = path[:-1]
        if path:
            self._unfolded = {each for each in self._unfolded if each[: len(path)] != path}
            self.row_list.select(_row_id(path))
            self.repaint()

    def _show_in_full(self, path: JsonPath) -> None:
        """Show a value in full, because its row may have no room for it."""

        def rows(width: int) -> list[ListRow]:
            entry = self._entries().get(str(path[0]))
            try:
                value = self._value_at(path)
            except NoSuchPath:
                value = None
            if entry is None:
                return value_rows(path_text(path), "deleted", "", "", width)
            about = f"{format_clock(entry.changed, tenths=True)} by {entry.source}" + (
                f", before that {format_value(entry.old)}" if entry.source != "file" and len(path) == 1 else ""
            )
            return value_rows(path_text(path), format_value(value), json_type_name(value), about, width)

        self.app.push_screen(DetailScreen("Memory", rows))

    # --- the editor ---------------------------------------------------------------------------------------------------

    def _open_editor(self, path: JsonPath, key: str, value: object) -> None:
        self._editing = path
        self.row_list.select(self.row_list.current_id if path else ADD)
        last = self.row_list.size.height - 1
        y = 1 + min(
            self.row_list.cursor - self.row_list.scroll_offset.y, max(0, last - 1)
        )  # a second row may be needed below
        columns = self._columns(self.row_list.row_width)
        text = format_value(value) if key else ""
        self.editor.open(
            path_text(path), key, text, self._present_value, y=y, key_width=columns.key, value_width=columns.value
        )

    def _present_value(self, key: str) -> PresentValue:
        """The present value of a key, or of the part that is being edited."""
        path: JsonPath = self._editing or (key,)
        entry = self.store.view.memory.get(str(path[0]))
        try:
            return PresentValue(format_value(self._value_at(path)), entry.source if entry is not None else "")
        except NoSuchPath:
            return PresentValue("")

    @on(RowEditor.SaveRow)
    def _save_row(self, event: RowEditor.SaveRow) -> None:
        event.stop()
        self.screen.set_focus(self.row_list)
        if not event.key:
            return
        path: JsonPath = self._editing or (event.key,)
        key, value = str(path[0]), event.value
        if len(path) > 1:
            try:
                value = with_replaced(self.store.view.memory[key].value, path[1:], event.value)
            except LookupError:
                self.host.show_notice(f"{event.key} is gone: {key} has changed; nothing was sent")
                return
        if self.store.last_deletion is not None and self.store.last_deletion[0] == key:
            self.store.last_deletion = None
        self._send(*assignment(key, value))

    def _send(self, function: str, behavior: str, notice: str = "") -> None:
        """Send a change, after a question if another value than the condition's would be given to one of its keys."""

        key = changed_key(function, behavior)
        before = self.store.view.memory.get(key)

        def send(answer: str | None = "c") -> None:
            if not answer:
                return
            if self.store.view.memory.get(key) is not before:
                self.host.show_notice(f"{key} has changed meanwhile: nothing was sent")
                return
            self.host.send(function, behavior)
            if notice:
                self.host.show_notice(notice)

        if lines := condition_change_lines(self.store.view, function, behavior):
            self.app.push_screen(Dialog(CHANGE_QUESTION, lines, DialogChoice("c", "Change"), no="Keep"), send)
        else:
            send()
